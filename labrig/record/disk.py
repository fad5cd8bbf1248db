"""The disk under a run folder: bytes that are there when the call returns."""

import os
from typing import BinaryIO, Protocol


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
