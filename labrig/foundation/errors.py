"""Exceptions, divided by who can resolve them, each with its exit code.

Every message states what was expected, what was received and what to do, in one line; the command
line prints that line and ends with the class's exit code.
"""

import errno
from mmap import mmap
from typing import ClassVar

#: Messages of the loader of shared libraries that lacks memory.
_LOADER_TEXTS = ("failed to map segment", "annot allocate memory", "cannot create shared object")

#: Message of Python, which has no error of its own for it.
_NO_THREAD = "can't start new thread"


class LabrigError(Exception):
    """Base class of all errors that labrig raises deliberately."""

    exit_code: ClassVar[int] = 2


class UsageError(LabrigError):
    """Invalid input of the user: a malformed file, an unknown name, a rig in use."""

    exit_code = 2


class ProtocolError(UsageError):
    """A plan that cannot work on this rig, found before anything has moved."""


class MissingDeviceError(ProtocolError):
    """A rig that lacks a device of the protocol.

    Attributes
    ----------
    key
        Key of the device under `devices:` of a rig file.
    """

    def __init__(self, message: str, key: str) -> None:
        super().__init__(message)
        self.key = key


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


class FlickerUnknownError(FitError):
    """A decay with too few bright frames to estimate their flicker beside its rates."""


class DiskError(LabrigError):
    """A disk that is full, too slow or gone."""

    exit_code = 5


class MemoryShortageError(LabrigError):
    """A PC that has too little memory left."""

    exit_code = 5


def memory_shortage(error: BaseException) -> MemoryShortageError:
    """Return the error to raise for an allocation that failed, whose text says what was asked."""
    asked = f" ({error})" if str(error) else ""
    return MemoryShortageError(
        f"this PC has too little memory left{asked}; close other programs, or use a PC with more "
        "memory"
    )


def require_memory(size_bytes: int) -> None:
    """Refuse to load libraries that crash where memory is short, before they are loaded.

    Raises
    ------
    MemoryShortageError
        This process cannot have so much more memory.
    """
    try:
        mmap(-1, size_bytes).close()
    except OSError:
        asked = MemoryError(f"{size_bytes / 1e6:.0f} MB are needed to begin")
        raise memory_shortage(asked) from None


def is_memory_shortage(error: BaseException) -> bool:
    """Return whether an error is a lack of memory, also of libraries' loader or of a thread."""
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    if isinstance(error, ImportError):
        return any(text in str(error) for text in _LOADER_TEXTS)
    return isinstance(error, MemoryError) or str(error) == _NO_THREAD
