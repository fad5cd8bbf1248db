"""A simulated camera on the loopback network, in a thread of its own and in real time."""

import random
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

from labrig.foundation.clock import Interrupted, SystemClock, VirtualClock
from labrig.sim.camera import BodySettings, Pace, PtpIpServer, Sensor, SimulatedCamera

EPOCH_S = 1_767_225_600.0
#: A server that does not end by then hangs.
MAX_S = 20.0
_SIGINT = 2


class Taken(NamedTuple):
    exposure_s: float
    iso: int
    f_number: float


@dataclass
class Film:
    """A sensor that remembers how it was used and what it delivered."""

    sensor: Sensor | None = None
    size: int = 3000
    taken: list[Taken] = field(default_factory=list)
    delivered: list[bytes] = field(default_factory=list)

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        self.taken.append(Taken(exposure_s, iso, f_number))
        if self.sensor is None:
            raw = random.Random(len(self.taken)).randbytes(self.size)
        else:
            raw = self.sensor.photograph(start_s, exposure_s, iso, f_number)
        self.delivered.append(raw)
        return raw


EOS, STANDARD = BodySettings(body="eos"), BodySettings(body="standard")


def camera_on(clock: VirtualClock, film: Film, body: BodySettings = EOS) -> SimulatedCamera:
    return SimulatedCamera(clock, film, serial="0730100001", seed=1, body=body)


@contextmanager
def served(
    film: Film, room_clock: VirtualClock | None = None, body: BodySettings = EOS
) -> Iterator[PtpIpServer]:
    """The camera behind a server; what goes wrong in the server's thread fails the test."""
    clock, room_clock = SystemClock(), room_clock or VirtualClock(EPOCH_S)
    failures: list[BaseException] = []

    def serve() -> None:
        try:
            server.serve(clock)
        except Interrupted:
            pass
        except BaseException as failure:
            failures.append(failure)

    responder = camera_on(room_clock, film, body).responder
    with closing(PtpIpServer(responder, Pace(clock, room_clock).catch_up)) as server:
        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            clock.interrupt(_SIGINT)
            thread.join(MAX_S)
            assert not thread.is_alive(), "the server does not end"
    assert not failures, failures
