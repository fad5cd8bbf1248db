"""The PC in the simulated room: its clock, which sleeps and steps, and its disk, with faults."""

import errno
import os
from collections.abc import Iterable, Sequence
from typing import Any, BinaryIO, cast

from labrig.foundation.clock import VirtualClock
from labrig.foundation.output_file import Disk

from .faults import AfterBytes, Nap, Slowness, Step


class RoomClock(VirtualClock):
    """The room's time, which goes on while the PC sleeps.

    Parameters
    ----------
    epoch_s
        Seconds since 1970 at the clock's zero.
    naps
        Times at which the PC sleeps; those that began before the room was opened are over.
    ahead, back
        Times at which the time of day is set ahead and back, if that is after the room was opened.
    """

    def __init__(
        self,
        epoch_s: float,
        naps: Iterable[Nap] = (),
        ahead: Iterable[Step] = (),
        back: Iterable[Step] = (),
    ) -> None:
        super().__init__(epoch_s)
        self._naps = sorted((nap for nap in naps if nap.at >= 0.0), key=lambda nap: nap.at)
        self._slept_s = 0.0
        self._steps = [(step, 1) for step in ahead if step.at > 0.0]
        self._steps += [(step, -1) for step in back if step.at > 0.0]

    def time_of_day(self) -> float:
        steps = (sign * step.by for step, sign in self._steps if step.is_on(self._now_s))
        return self.wall() + sum(steps)

    def slept_s(self) -> float:
        return self._slept_s

    def spend(self, duration_s: float) -> None:
        """Spend time as a virtual clock does, prolonged by sleep."""
        super().spend(duration_s)
        self._sleep_if_due()

    def _pause_until(self, deadline_s: float) -> None:
        super()._pause_until(min(deadline_s, self._naps[0].at) if self._naps else deadline_s)
        self._sleep_if_due()

    def _sleep_if_due(self) -> None:
        while self._naps and self._naps[0].at <= self._now_s:
            lasting_s = self._naps.pop(0).lasting
            self._now_s += lasting_s
            self._slept_s += lasting_s


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
