"""Failures of libgphoto2 and their remedies; all of them are `DeviceError` to the outside."""

from labrig.foundation.errors import DeviceError, DeviceLostError

#: libgphoto2's own numbers, gphoto2-result.h and gphoto2-port-result.h.
GENERAL, NOT_SUPPORTED, IO, TIMEOUT = -1, -6, -7, -10
IO_READ, IO_WRITE, USB_FIND, USB_CLAIM, IO_LOCK = -34, -35, -52, -53, -60
MODEL_NOT_FOUND, CAMERA_BUSY = -105, -110

_GONE = (IO, IO_READ, IO_WRITE, USB_FIND)

_LOOK = "look at its cable or network, its battery, and whether it has switched itself off"
_HELD = "another program holds it; 'labrig rig devices' says which and how to make it let go"
_ADVICE = {
    NOT_SUPPORTED: "libgphoto2 cannot do this with this camera",
    TIMEOUT: "switch it off and on",
    USB_CLAIM: _HELD,
    IO_LOCK: _HELD,
    MODEL_NOT_FOUND: "libgphoto2 knows no camera there; set its USB mode to PTP or PC remote",
    CAMERA_BUSY: "wait until its card lamp is off, leave its menus, and try again",
}
_ELSE = "set its dial to M and its lens to MF, leave its menus, and try again"


class BusyError(DeviceError):
    """The camera is not ready yet."""


class PerhapsReleasedError(DeviceError):
    """The camera was busy before its release or after it: whether it released is unknown."""


class UnspecifiedError(DeviceError):
    """Unspecified error of libgphoto2, which is also its first one when the line breaks."""


def failure(context: str, code: int, text: str) -> DeviceError:
    """Return the error for libgphoto2's answer; `context` names the device and the purpose."""
    problem = f"{context}: libgphoto2 says '{text}' ({code})"
    if code in _GONE:
        return DeviceLostError(f"{problem}: {_LOOK}")
    kind = {CAMERA_BUSY: BusyError, GENERAL: UnspecifiedError}.get(code, DeviceError)
    return kind(f"{problem}: {_ADVICE.get(code, _ELSE)}")
