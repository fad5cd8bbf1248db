"""Files that are either whole or not there."""

import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Protocol

from labrig.errors import DiskError


class Disk(Protocol):
    """Takes what has to survive a power cut."""

    def write(self, file: BinaryIO, data: bytes) -> None:
        """Append to an unbuffered file and wait until the disk has it.

        Raises
        ------
        OSError
            Full, or gone; part of `data` may be in the file.
        """


class RealDisk:
    """The disk of this PC."""

    def write(self, file: BinaryIO, data: bytes) -> None:
        """As `Disk.write`."""
        left = memoryview(data)
        while left:
            left = left[file.write(left) :]
        os.fsync(file.fileno())


REAL_DISK: Disk = RealDisk()


def write_durably(path: Path, data: bytes, disk: Disk = REAL_DISK) -> None:
    """Write `data` to `path` by way of `.part`, on the disk before the name appears.

    Raises
    ------
    DiskError
        The disk is full or gone; `path` is as it was, or as it should be.
    """
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb", buffering=0) as file:
            disk.write(file, data)
        part.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise DiskError(
            f"{path}: {len(data) / 1e6:.2g} MB cannot be written ({error.strerror}); see that "
            "the disk is there and has room"
        ) from None


def sync_folder(folder: Path) -> None:
    """Make what was made or renamed in `folder` durable, where there is a way (not on Windows)."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
