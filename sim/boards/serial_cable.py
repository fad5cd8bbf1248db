"""The USB cable between the PC and a serial board, and what can be wrong with it."""

from collections.abc import Sequence
from typing import Protocol

from labrig.clock import VirtualClock

from ..faults import FaultTime


class Board(Protocol):
    """The far end of a serial line."""

    def receive(self, data: bytes) -> bytes:
        """What it sends back for these bytes."""


class SerialCable:
    """A board at the end of a cable.

    Parameters
    ----------
    board
        Has its own power supply: it does not notice that the cable is out.
    clock
        The room's.
    unplugged
        When the cable is out.
    silent
        When the board neither hears nor answers.
    echo_lost
        When the board's echo does not arrive; the rest of its answer does.
    """

    def __init__(
        self,
        board: Board,
        clock: VirtualClock,
        *,
        unplugged: Sequence[FaultTime] = (),
        silent: Sequence[FaultTime] = (),
        echo_lost: Sequence[FaultTime] = (),
    ) -> None:
        self._board = board
        self._clock = clock
        self._unplugged = unplugged
        self._silent = silent
        self._echo_lost = echo_lost

    @property
    def is_plugged(self) -> bool:
        """Whether the cable is in now."""
        return not self._now(self._unplugged)

    @property
    def plugging(self) -> int:
        """How often the cable was pulled: a port that was open before that is dead for good."""
        now_s = self._clock.now()
        return sum(out.at <= now_s for out in self._unplugged)

    def has_held(self, plugging: int) -> bool:
        """Whether the cable is in, and has been since it had been pulled so often."""
        return not self._unplugged or (self.is_plugged and self.plugging == plugging)

    def carry(self, data: bytes) -> bytes:
        """Bytes to the board; what comes back for them."""
        if self._now(self._silent):
            return b""
        answer = self._board.receive(data)
        return answer.removeprefix(data.rstrip(b"\r")) if self._now(self._echo_lost) else answer

    def _now(self, whens: Sequence[FaultTime]) -> bool:
        now_s = self._clock.now()
        return any(when.is_on(now_s) for when in whens)
