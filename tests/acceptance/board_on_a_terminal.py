"""An emulated relay board at the far end of a pseudo-terminal, in this process, in real time."""

import os
import pty
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from labrig.sim.boards import NumatoBoard

RELAY = 3
RIG = """
name: half a bench
devices:
  lamp: {{driver: numato_relay, address: "{address}", relay: 3}}
"""


class WatchedBoard(NumatoBoard):
    """Knows how many bytes it was sent, and when its lamp was switched.

    Attributes
    ----------
    switched
        Pairs of `time.monotonic` and whether the lamp was on from then.
    """

    def __init__(self) -> None:
        super().__init__(8, lambda relay, on: self.switched.append((time.monotonic(), on)))
        self.switched: list[tuple[float, bool]] = []
        self.heard_bytes = 0

    @property
    def lamp_on(self) -> bool:
        return self.states[RELAY]

    def receive(self, data: bytes) -> bytes:
        self.heard_bytes += len(data)
        return super().receive(data)


@contextmanager
def on_a_terminal(board: WatchedBoard) -> Iterator[str]:
    """The terminal device at whose other end `board` is."""
    ours, theirs = pty.openpty()

    def serve() -> None:
        while True:
            try:
                os.write(ours, board.receive(os.read(ours, 100)))
            except OSError:
                return

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield os.ttyname(theirs)
    finally:
        os.close(theirs)
        os.close(ours)
