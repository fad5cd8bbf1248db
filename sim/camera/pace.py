"""A simulated room in real time, for programs that have no simulated clock."""

from labrig.clock import Clock, VirtualClock


class Pace:
    """Lets the time of a simulated room pass as that of the PC does.

    The room's clock stands still inside a transaction and is moved up before the next.

    Parameters
    ----------
    clock
        The PC's.
    room_clock
        The room's, which nothing else moves.
    """

    def __init__(self, clock: Clock, room_clock: VirtualClock) -> None:
        self._clock = clock
        self._room_clock = room_clock
        self._zero_s = clock.now() - room_clock.now()

    def catch_up(self) -> float:
        """Move the room's clock up to the PC's; the room's time."""
        behind_s = self._clock.now() - self._zero_s - self._room_clock.now()
        self._room_clock.spend(max(0.0, behind_s))
        return self._room_clock.now()
