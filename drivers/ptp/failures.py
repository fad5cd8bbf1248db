"""The ways in which talking to a camera fails; all of them are `DeviceError` to the outside."""

from labrig.errors import DeviceError, DeviceLostError

MOST_SHOWN_BYTES = 32


def shown(data: bytes) -> str:
    """How a message shows bytes: all of them in hexadecimal if few, else how they begin."""
    if not data:
        return "nothing"
    if len(data) <= MOST_SHOWN_BYTES:
        return f"'{data.hex(' ')}'"
    return f"{len(data)} bytes '{data[:MOST_SHOWN_BYTES].hex(' ')} …'"


class NoAnswerError(DeviceError):
    """The camera did not answer in time."""


class UnpluggedError(DeviceLostError):
    """The camera is gone: cable, battery or its own power saving."""


class StallError(DeviceError):
    """The camera halted an endpoint, its way of giving a transaction up."""


class MalformedError(DeviceError):
    """Bytes that are not what the protocol says; the message always shows them.

    Parameters
    ----------
    expected
        The message's beginning: what should have come.
    came
        What came instead.
    remedy
        What to do.
    """

    def __init__(
        self, expected: str, came: bytes, remedy: str = "switch the camera off and on"
    ) -> None:
        super().__init__(f"{expected}, got {shown(came)}: {remedy}")


class RefusedError(DeviceError):
    """The camera answered something other than OK.

    Attributes
    ----------
    code
        Its response code.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code
