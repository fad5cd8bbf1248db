"""The USB cable between the PC and a serial board, with its faults."""

from collections.abc import Sequence
from typing import Protocol

from labrig.foundation.clock import VirtualClock

from ..faults import FaultTime


class Board(Protocol):
    """The far end of a serial line."""

    def receive(self, data: bytes) -> bytes:
        """Return the board's answer to these bytes."""


class SerialCable:
    """A board at the end of a cable.

    Parameters
    ----------
    board
        Board with its own power supply, which does not notice that the cable is out.
    clock
        The room's clock.
    unplugged
        Times at which the cable is out.
    silent
        Times at which the board neither receives nor answers.
    echo_lost
        Times at which the board's echo does not arrive; the rest of its answer does.
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
        return not self._is_any_on(self._unplugged)

    @property
    def plugging(self) -> int:
        """Number of pulls of the cable: a port that was open before is dead for good."""
        now_s = self._clock.now()
        return sum(out.at <= now_s for out in self._unplugged)

    def has_held(self, plugging: int) -> bool:
        """Return whether the cable is in, and has been since that number of pulls."""
        return not self._unplugged or (self.is_plugged and self.plugging == plugging)

    def carry(self, data: bytes) -> bytes:
        """Carry bytes to the board; return its answer."""
        if self._is_any_on(self._silent):
            return b""
        answer = self._board.receive(data)
        return (
            answer.removeprefix(data.rstrip(b"\r")) if self._is_any_on(self._echo_lost) else answer
        )

    def _is_any_on(self, spans: Sequence[FaultTime]) -> bool:
        now_s = self._clock.now()
        return any(span.is_on(now_s) for span in spans)
