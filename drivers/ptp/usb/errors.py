"""What pyusb's errors mean to somebody with a camera on the desk."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager

import usb.core

from labrig.errors import DeviceError

from ..failures import NoAnswerError, StallError, UnpluggedError

WAKE_UP = "switch the camera on, its automatic switching-off to never, and check cable and battery"

_GONE = {errno.ENODEV, errno.EIO, errno.ENXIO, errno.ESHUTDOWN}


@contextmanager
def usb_errors_explained(context: str) -> Iterator[None]:
    """Turn pyusb's errors into `DeviceError`.

    Parameters
    ----------
    context
        Which device, and what was being done.

    Raises
    ------
    DeviceError
        In place of any error of pyusb: `NoAnswerError`, `StallError`, `UnpluggedError` or plain.
    """
    try:
        yield
    except usb.core.USBError as failure:
        number = failure.errno
        if isinstance(failure, usb.core.USBTimeoutError) or number == errno.ETIMEDOUT:
            raise NoAnswerError(f"{context}: no answer: {WAKE_UP}") from failure
        if number == errno.EPIPE:
            raise StallError(f"{context}: it halted the transfer (stall): try again") from failure
        if number in _GONE:
            raise UnpluggedError(f"{context}: it is gone ({failure}): {WAKE_UP}") from failure
        raise DeviceError(f"{context}: {failure}: {_remedy(number)}") from failure
    except (usb.core.NoBackendError, NotImplementedError) as failure:
        raise DeviceError(
            f"{context}: this PC has no USB driver for it ({failure}): install libusb, "
            "on Windows give the camera the WinUSB driver with Zadig"
        ) from failure


def _remedy(number: int | None) -> str:
    if number == errno.EBUSY:
        return (
            "another program holds it: close the desktop's photo import (gvfs, PTPCamera), "
            "gphoto2 and EOS Utility"
        )
    if number == errno.EACCES:
        return "you may not use it: add a udev rule for the camera, or log in at the PC itself"
    return "unplug it and plug it in again"
