"""What can go wrong, by whose hand it is mended.

Every message says what was expected, what came and what to do, in one line; the command line
shows that line and leaves with the class's exit code.
"""

from typing import ClassVar


class LabrigError(Exception):
    """Base of everything labrig raises on purpose."""

    exit_code: ClassVar[int] = 2


class UsageError(LabrigError):
    """The user's input: a malformed file, an unknown name, a rig in use."""

    exit_code = 2


class ProtocolError(UsageError):
    """A plan that cannot work on this rig; nothing has moved."""


class DeviceError(LabrigError):
    """A device that did not answer, or answered something else.

    Attributes
    ----------
    unsafe
        Keys of the devices that could not confirm their safe state.
    """

    exit_code = 3
    unsafe: tuple[str, ...] = ()


class DeviceLostError(DeviceError):
    """A device that is gone: unplugged, switched off, asleep; it may come back."""


class UnclearAnswerError(DeviceLostError):
    """A device that is there but silent or not to be understood; asked again, it may answer."""


class DataError(LabrigError):
    """Data that cannot be used; what was recorded is kept."""

    exit_code = 4


class FrameError(DataError):
    """A photograph that cannot be reduced."""


class FitError(DataError):
    """Data from which no parameter can be had."""


class DiskError(LabrigError):
    """The disk is full, slow beyond use or gone."""

    exit_code = 5
