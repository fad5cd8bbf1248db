"""The ways in which talking to a camera fails; all of them are `DeviceError` to the outside."""

from labrig.errors import DeviceError, DeviceLostError


class NoAnswerError(DeviceError):
    """The camera did not answer in time."""


class UnpluggedError(DeviceLostError):
    """The camera is gone: cable, battery or its own power saving."""


class StallError(DeviceError):
    """The camera halted an endpoint, its way of giving a transaction up."""


class MalformedError(DeviceError):
    """Bytes that are not what the protocol says."""


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
