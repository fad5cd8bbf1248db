"""Failures of the communication with a camera; all of them are `DeviceError` to the outside."""

from labrig.foundation.errors import DeviceError, DeviceLostError

MAX_SHOWN_BYTES = 32


def shown(data: bytes) -> str:
    """Return bytes for a message: all of them in hexadecimal if few, else the first ones."""
    if not data:
        return "nothing"
    if len(data) <= MAX_SHOWN_BYTES:
        return f"'{data.hex(' ')}'"
    return f"{len(data)} bytes '{data[:MAX_SHOWN_BYTES].hex(' ')} …'"


class NoAnswerError(DeviceError):
    """The camera did not answer in time."""


class UnpluggedError(DeviceLostError):
    """The camera is gone: cable, battery or its own power saving."""


class StallError(DeviceError):
    """The camera halted an endpoint, its way of cancelling a transaction."""


class MalformedError(DeviceError):
    """Bytes that violate the protocol; the message always shows them.

    Parameters
    ----------
    expected
        Start of the message: the expected bytes.
    received
        Bytes that came instead.
    remedy
        Remedy for the user.
    """

    def __init__(
        self, expected: str, received: bytes, remedy: str = "switch the camera off and on"
    ) -> None:
        super().__init__(f"{expected}, got {shown(received)}: {remedy}")


class RefusedError(DeviceError):
    """The camera answered something other than OK.

    Attributes
    ----------
    code
        Response code of the camera.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code
