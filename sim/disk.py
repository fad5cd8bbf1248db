"""The disk of the PC in the simulated room: the real one, with faults."""

import errno
import os
from collections.abc import Sequence
from typing import Any, BinaryIO, cast

from labrig.foundation.clock import VirtualClock
from labrig.foundation.output_file import Disk

from .faults import AfterBytes, Slowness


class SimulatedDisk:
    """Durable writing by another disk, to whose files the faults happen.

    The faults lie below the code that writes on a bench: a file on a full disk takes what still
    fits and returns that number, as the system does, and fails at the next write.

    Parameters
    ----------
    disk
        Disk that writes.
    clock
        The room's clock.
    full
        Times at which the disk is full; with `after_bytes`, a write is cut off at that byte.
    slow
        Times at which each write takes long.
    """

    def __init__(
        self,
        disk: Disk,
        clock: VirtualClock,
        full: Sequence[AfterBytes],
        slow: Sequence[Slowness],
    ) -> None:
        self._disk = disk
        self._clock = clock
        self._full = list(full)
        self._slow = slow
        self._written_bytes = 0

    def write(self, file: BinaryIO, data: bytes) -> None:
        """Append to an unbuffered file and wait until the disk has it.

        Raises
        ------
        OSError
            The disk is full (ENOSPC); the bytes that still fitted are in the file.
        """
        now_s = self._clock.now()
        self._clock.spend(sum(slow.takes for slow in self._slow if slow.is_on(now_s)))
        self._disk.write(cast("BinaryIO", _File(self, file)), data)

    def write_once(self, file: BinaryIO, data: Any) -> int:
        """Append what fits of the data, as one call of the system, and return its bytes."""
        fits = self._fits(len(data))
        if fits == 0 < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written_bytes = file.write(data[:fits])
        self._written_bytes += written_bytes
        return written_bytes

    def _fits(self, size: int) -> int:
        """Return how many of that number of bytes the disk has room for."""
        now_s, fits = self._clock.now(), size
        for number, fault in enumerate(self._full):
            if fault.after_bytes is None:
                fits = 0 if fault.is_on(now_s) else fits
            elif self._written_bytes + size > fault.after_bytes:
                fits = min(fits, fault.after_bytes - self._written_bytes)
                # From here on it is full until somebody makes room.
                self._full[number] = fault.model_copy(update={"at": now_s, "after_bytes": None})
        return fits


class _File:
    """A file on the simulated disk: what durable writing asks of one."""

    def __init__(self, disk: SimulatedDisk, file: BinaryIO) -> None:
        self._disk = disk
        self._file = file

    def write(self, data: Any) -> int:
        return self._disk.write_once(self._file, data)

    def fileno(self) -> int:
        return self._file.fileno()
