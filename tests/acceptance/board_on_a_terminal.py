"""An emulated relay board at the far end of a pseudo-terminal, in this process, in real time."""

import time

from labrig.sim.boards import NumatoBoard

RELAY = 3
RIG = """
name: half a bench
devices:
  lamp: {{driver: numato, address: "{address}", relay: 3}}
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
