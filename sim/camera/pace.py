"""A simulated room in real time, for programs that have no simulated clock."""

from labrig.foundation.clock import Clock, VirtualClock


class Pace:
    """Coupling of a simulated room's time to that of the PC.

    The room's clock stands still inside a transaction and is advanced before the next.

    Parameters
    ----------
    clock
        The PC's clock.
    room_clock
        The room's clock, which nothing else advances.
    """

    def __init__(self, clock: Clock, room_clock: VirtualClock) -> None:
        self._clock = clock
        self._room_clock = room_clock
        self._zero_s = clock.now() - room_clock.now()

    def catch_up(self) -> float:
        """Advance the room's clock to the PC's; return the room's time."""
        behind_s = self._clock.now() - self._zero_s - self._room_clock.now()
        self._room_clock.spend(max(0.0, behind_s))
        return self._room_clock.now()
