"""The disk of the PC in the simulated room: the real one, with faults."""

import errno
import os
from collections.abc import Sequence
from typing import BinaryIO

from labrig.clock import VirtualClock

from .faults import AfterBytes, Slowness


class SimulatedDisk:
    """Durable writing to the real disk, limited by the faults.

    Parameters
    ----------
    clock
        The room's clock.
    full
        Times at which the disk is full; with `after_bytes`, a write is cut off at that byte.
    slow
        Times at which each write takes long.
    """

    def __init__(
        self, clock: VirtualClock, full: Sequence[AfterBytes], slow: Sequence[Slowness]
    ) -> None:
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
        fits = self._fits(len(data))
        file.write(data[:fits])
        os.fsync(file.fileno())
        self._written_bytes += fits
        if fits < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

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
