"""The one clock: everything that waits or stamps a time is given one of these.

Times are seconds of the clock's own monotonic scale; `Clock.wall` turns them into seconds since
1970, anchored once, so that a stepped PC clock cannot bend a measurement.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

#: A sleeping PC looks up this often, so that Ctrl-C is answered at once on every system.
LOOK_UP_S = 0.05


class Interrupted(BaseException):
    """Ctrl-C or another signal, delivered at a wait (never inside a device transaction)."""

    def __init__(self, signum: int, text: str = "interrupted") -> None:
        super().__init__(text)
        self.signum = signum


class Clock(ABC):
    """Time, and the only place where a run can be interrupted."""

    def __init__(self, epoch_s: float) -> None:
        self.epoch_s = epoch_s
        self._signum: int | None = None
        self._shields = 0

    @abstractmethod
    def now(self) -> float:
        """Seconds on the clock's own scale, never stepping back."""

    @abstractmethod
    def _pause_until(self, deadline_s: float) -> None:
        """Let time pass until `deadline_s`; may return early to look for an interruption."""

    def wall(self, at_s: float | None = None) -> float:
        """Seconds since 1970 at `at_s` (default: now)."""
        return self.epoch_s + (self.now() if at_s is None else at_s)

    def sleep_until(self, deadline_s: float) -> None:
        """Wait for an absolute time; raises `Interrupted` if somebody asked to stop."""
        self._look_up()
        while self.now() < deadline_s:
            self._pause_until(deadline_s)
            self._look_up()

    def sleep(self, duration_s: float) -> None:
        """Wait for `duration_s` seconds."""
        self.sleep_until(self.now() + duration_s)

    def interrupt(self, signum: int) -> None:
        """Ask for an interruption at the next wait. Safe to call from a signal handler."""
        self._signum = signum

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Waits inside do not raise: the way to the safe state is walked to its end."""
        self._shields += 1
        try:
            yield
        finally:
            self._shields -= 1

    def _look_up(self) -> None:
        if self._signum is not None and not self._shields:
            signum, self._signum = self._signum, None
            raise Interrupted(signum)


class SystemClock(Clock):
    """The PC's monotonic clock."""

    def __init__(self) -> None:
        super().__init__(epoch_s=time.time() - time.perf_counter())

    def now(self) -> float:
        return time.perf_counter()

    def _pause_until(self, deadline_s: float) -> None:
        time.sleep(min(max(deadline_s - time.perf_counter(), 0.0), LOOK_UP_S))


class VirtualClock(Clock):
    """Time that passes only when somebody waits: planning and simulated rooms.

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

    def spend(self, duration_s: float) -> None:
        """Let a simulated transaction cost time; no interruption inside a transaction."""
        self._now_s += duration_s

    def _pause_until(self, deadline_s: float) -> None:
        self._now_s = max(self._now_s, deadline_s)
