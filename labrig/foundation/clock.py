"""Clocks: everything that waits or records a time takes one of these.

Times are seconds of the clock's own monotonic scale; `Clock.wall` turns them into seconds since
1970, anchored once, so that a stepped PC clock does not distort a measurement.
"""

import ctypes
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

#: Interval of checks for an interruption during a wait, so that Ctrl-C acts at once everywhere.
CHECK_INTERVAL_S = 0.05
#: Difference of clocks that means sleep; on a PC that is awake they agree much better.
SLEPT_S = 0.3
#: Steps of the time of day that are noticed, and how far two clocks of a PC may run apart; on
#: Windows they do by 1e-4.
STEP_S, DRIFT = 1.0, 3e-4
#: A clock that includes sleep of the PC, and one that does not, by `sys.platform`.
SLEEP_CLOCKS = {
    "linux": ("CLOCK_BOOTTIME", "CLOCK_MONOTONIC"),
    "darwin": ("CLOCK_MONOTONIC_RAW", "CLOCK_UPTIME_RAW"),
}

Reading = Callable[[], float]


class Interrupted(BaseException):
    """Ctrl-C or another signal, raised at a wait (never inside a device transaction)."""

    def __init__(self, signum: int, text: str = "interrupted") -> None:
        super().__init__(text)
        self.signum = signum


class Slept(BaseException):
    """Sleep of the PC, raised at a wait after it woke up."""

    def __init__(self, slept_s: float) -> None:
        super().__init__(f"this PC slept for {slept_s:.1f} s")
        self.slept_s = slept_s


class Clock(ABC):
    """Source of time, and the only place where a run can be interrupted."""

    def __init__(self, epoch_s: float) -> None:
        self.epoch_s = epoch_s
        self._signum: int | None = None
        self._shields = 0
        self._slept_before_s: float | None = None
        self._compared_s, self._ahead_s = 0.0, 0.0

    @abstractmethod
    def now(self) -> float:
        """Return seconds on the clock's own scale, which never steps back and includes sleep."""

    @abstractmethod
    def slept_s(self) -> float:
        """Return for how many seconds the PC has slept since an arbitrary time, as far as known."""

    def time_of_day(self) -> float:
        """Return seconds since 1970 by the clock of the PC, which somebody may step."""
        return self.wall()

    @abstractmethod
    def _pause_until(self, deadline_s: float) -> None:
        """Let time pass until `deadline_s`; an early return allows a check for interruptions."""

    def wall(self, at_s: float | None = None) -> float:
        """Return seconds since 1970 at `at_s` (default: now)."""
        return self.epoch_s + (self.now() if at_s is None else at_s)

    def step_s(self) -> float:
        """Return by how much the PC's time of day was set ahead since the last call; 0 if not.

        Negative if it was set back. Neither `now` nor `wall` follow such a step.
        """
        now_s, ahead_s = self.now(), self.time_of_day() - self.wall()
        step_s, lasted_s = ahead_s - self._ahead_s, now_s - self._compared_s
        self._ahead_s, self._compared_s = ahead_s, now_s
        return step_s if abs(step_s) > STEP_S + DRIFT * lasted_s else 0.0

    def sleep_until(self, deadline_s: float) -> None:
        """Wait until an absolute time; raise `Interrupted` if a stop was requested."""
        self._check_interruption()
        while self.now() < deadline_s:
            self._pause_until(deadline_s)
            self._check_interruption()

    def sleep(self, duration_s: float) -> None:
        """Wait for `duration_s` seconds."""
        self.sleep_until(self.now() + duration_s)

    def interrupt(self, signum: int) -> None:
        """Request an interruption at the next wait. Safe to call from a signal handler."""
        self._signum = signum

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Suppress interruptions at waits, so that the safe state is reached."""
        self._shields += 1
        try:
            yield
        finally:
            self._shields -= 1

    @contextmanager
    def noticing_sleep(self) -> Iterator[None]:
        """Raise `Slept` at a wait, or at the end, if the PC slept meanwhile.

        Raises
        ------
        Slept
            The PC slept since the beginning.
        """
        self._slept_before_s = self.slept_s()
        try:
            yield
            self._notice_sleep()
        finally:
            self._slept_before_s = None

    def _check_interruption(self) -> None:
        if self._shields:
            return
        if self._signum is not None:
            signum, self._signum = self._signum, None
            raise Interrupted(signum)
        self._notice_sleep()

    def _notice_sleep(self) -> None:
        if self._slept_before_s is None:
            return
        slept_s = self.slept_s() - self._slept_before_s
        if slept_s > SLEPT_S:
            raise Slept(slept_s)


class SystemClock(Clock):
    """The PC's monotonic clock.

    Parameters
    ----------
    platform
        Platform, with the values of `sys.platform`. Sleep of the PC is detected on Linux, and, not
        tested, on macOS and Windows.
    """

    def __init__(self, platform: str = sys.platform) -> None:
        self._now, self._through_sleep, self._awake = _readings(platform)
        super().__init__(epoch_s=time.time() - self._now())
        self._compared_s = self._now()

    def time_of_day(self) -> float:
        return time.time()

    def now(self) -> float:
        return self._now()

    def slept_s(self) -> float:
        # In this order: a process that is stopped between the two has not slept.
        through_sleep_s = self._through_sleep()
        return through_sleep_s - self._awake()

    def _pause_until(self, deadline_s: float) -> None:
        time.sleep(min(max(deadline_s - self._now(), 0.0), CHECK_INTERVAL_S))


def _readings(platform: str) -> tuple[Reading, Reading, Reading]:
    """Return the measuring clock, one that includes sleep, and one that does not."""
    if platform == "win32":
        kernel32 = vars(ctypes)["windll"].kernel32
        # The performance counter goes on, too, but runs apart from the other two by 0.3 s an hour.
        return time.perf_counter, partial(_ticks_s, kernel32), partial(_unbiased_s, kernel32)
    if platform not in SLEEP_CLOCKS:
        return time.perf_counter, time.perf_counter, time.perf_counter
    through_sleep, awake = (
        partial(time.clock_gettime, getattr(time, name)) for name in SLEEP_CLOCKS[platform]
    )
    return through_sleep, through_sleep, awake


def _ticks_s(kernel32: Any) -> float:
    kernel32.GetTickCount64.restype = ctypes.c_uint64
    return float(kernel32.GetTickCount64()) * 1e-3


def _unbiased_s(kernel32: Any) -> float:
    ticks = ctypes.c_uint64()
    kernel32.QueryUnbiasedInterruptTime(ctypes.byref(ticks))
    return ticks.value * 1e-7


class VirtualClock(Clock):
    """Clock whose time passes only by waiting, for planning and simulated rooms.

    Parameters
    ----------
    epoch_s
        Seconds since 1970 at the clock's zero.
    """

    def __init__(self, epoch_s: float = 0.0) -> None:
        super().__init__(epoch_s)
        self._now_s = 0.0

    def now(self) -> float:
        return self._now_s

    def slept_s(self) -> float:
        return 0.0

    def spend(self, duration_s: float) -> None:
        """Let a simulated transaction take time, without interruption."""
        self._now_s += duration_s

    def _pause_until(self, deadline_s: float) -> None:
        self._now_s = max(self._now_s, deadline_s)
