"""The errors that pyusb's libusb backend raises, with the same numbers."""

import errno

import usb.core


def stalled() -> Exception:
    """The endpoint is halted."""
    return _usb_error("Pipe error", -9, errno.EPIPE)


def timed_out() -> Exception:
    """Nothing came, or nothing was taken, in the time given."""
    error: Exception = usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
    return error


def unplugged() -> Exception:
    """The device is gone, or went and came back as another one."""
    return _usb_error("No such device (it may have been disconnected)", -4, errno.ENODEV)


def overflowed() -> Exception:
    """A packet was longer than what was left of the host's buffer."""
    return _usb_error("Overflow", -8, errno.EOVERFLOW)


def claimed_by_another() -> Exception:
    """Somebody else holds the interface."""
    return _usb_error("Resource busy", -6, errno.EBUSY)


def not_found() -> Exception:
    """No such interface, setting or endpoint."""
    return _usb_error("Entity not found", -5, errno.ENOENT)


def _usb_error(text: str, libusb_code: int, number: int) -> Exception:
    error: Exception = usb.core.USBError(text, libusb_code, number)
    return error
