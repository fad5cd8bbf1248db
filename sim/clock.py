"""Time in the simulated room, where the PC may fall asleep and its time of day be stepped."""

from collections.abc import Iterable

from labrig.foundation.clock import VirtualClock

from .faults import Nap, Step


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
