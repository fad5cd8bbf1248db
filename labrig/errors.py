"""Exceptions, divided by who can resolve them, each with its exit code.

Every message states what was expected, what was received and what to do, in one line; the command
line prints that line and ends with the class's exit code.
"""

from typing import ClassVar


class LabrigError(Exception):
    """Base class of all errors that labrig raises deliberately."""

    exit_code: ClassVar[int] = 2


class UsageError(LabrigError):
    """Invalid input of the user: a malformed file, an unknown name, a rig in use."""

    exit_code = 2


class ProtocolError(UsageError):
    """A plan that cannot work on this rig, found before anything has moved."""


class DeviceError(LabrigError):
    """A device that did not answer, or gave an unexpected answer.

    Attributes
    ----------
    unsafe
        Keys of the devices that could not confirm their safe state.
    """

    exit_code = 3
    unsafe: tuple[str, ...] = ()


class DeviceLostError(DeviceError):
    """A lost device (unplugged, switched off, asleep), which may come back."""


class UnclearAnswerError(DeviceLostError):
    """A device that is present but silent or unintelligible; a second query may succeed."""


class DataError(LabrigError):
    """Data that cannot be used; recorded data are kept."""

    exit_code = 4


class FrameError(DataError):
    """A frame that cannot be reduced."""


class FitError(DataError):
    """Data that do not constrain the parameters of a fit."""


class DiskError(LabrigError):
    """A disk that is full, too slow or gone."""

    exit_code = 5
