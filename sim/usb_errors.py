"""The errors that pyusb's libusb backend raises, with the same numbers."""

import errno

import usb.core


def stalled() -> Exception:
    """Return the error of a halted endpoint."""
    return _usb_error("Pipe error", -9, errno.EPIPE)


def timed_out() -> Exception:
    """Return the error of a transfer that did not happen in the time given."""
    error: Exception = usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
    return error


def unplugged() -> Exception:
    """Return the error of a device that is gone, or came back as another one."""
    return _usb_error("No such device (it may have been disconnected)", -4, errno.ENODEV)


def overflowed() -> Exception:
    """Return the error of a packet longer than the rest of the host's buffer."""
    return _usb_error("Overflow", -8, errno.EOVERFLOW)


def claimed_by_another() -> Exception:
    """Return the error of an interface that another program holds."""
    return _usb_error("Resource busy", -6, errno.EBUSY)


def not_found() -> Exception:
    """Return the error of a missing interface, setting or endpoint."""
    return _usb_error("Entity not found", -5, errno.ENOENT)


def _usb_error(text: str, libusb_code: int, number: int) -> Exception:
    error: Exception = usb.core.USBError(text, libusb_code, number)
    return error
