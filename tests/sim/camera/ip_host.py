"""A host that speaks PTP/IP by hand to a server in its own thread; knows nothing of sim's codec."""

import socket
import struct
from contextlib import suppress
from dataclasses import dataclass, field

from labrig.foundation.clock import VirtualClock
from labrig.sim.camera import PtpIpServer
from tests.counterparts.served import EPOCH_S, Film, camera_on

INTRODUCTION = bytes(16) + "host\0".encode("utf-16-le") + b"\0\0\1\0"
#: Rounds without a word after which nothing more comes.
QUIET_ROUNDS = 3


def packet(kind: int, payload: bytes = b"") -> bytes:
    return struct.pack("<II", 8 + len(payload), kind) + payload


def request(opcode: int, transaction_id: int, *params: int, direction: int = 1) -> bytes:
    head = struct.pack("<IHI", direction, opcode, transaction_id)
    return packet(6, head + struct.pack(f"<{len(params)}I", *params))


def start(transaction_id: int, size: int) -> bytes:
    return packet(9, struct.pack("<IQ", transaction_id, size))


def piece(kind: int, transaction_id: int, data: bytes = b"") -> bytes:
    return packet(kind, struct.pack("<I", transaction_id) + data)


@dataclass
class Bench:
    """A server whose room's time the test moves by hand."""

    film: Film = field(default_factory=Film)

    def __post_init__(self) -> None:
        self.clock = VirtualClock(EPOCH_S)
        self.responder = camera_on(self.clock, self.film).responder
        self.server = PtpIpServer(self.responder, self.clock.now)
        self._lines: list[Line] = []

    def line(self) -> "Line":
        self._lines.append(Line(self))
        return self._lines[-1]

    def let_in(self) -> tuple["Line", "Line"]:
        """Command and event connection of one host."""
        command, event = self.line(), self.line()
        ((kind, ack),) = command.say(packet(1, INTRODUCTION))
        assert kind == 2
        assert event.say(packet(3, ack[:4])) == [(4, b"")]
        return command, event

    def work(self) -> None:
        self.server.serve_once(0.0)

    def close(self) -> None:
        for line in self._lines:
            line.close()
        self.server.close()


class Line:
    """One connection."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._socket = socket.create_connection(("127.0.0.1", bench.server.port), 5.0)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._heard = b""
        self.is_cut = False
        bench.work()

    def say(self, said: bytes) -> list[tuple[int, bytes]]:
        """What comes back until nothing more does: kinds and payloads."""
        with suppress(OSError):
            assert self._socket.send(said) == len(said)
        return self.hear()

    def hear(self, at_most: int = 1 << 20) -> list[tuple[int, bytes]]:
        quiet = 0
        while quiet < QUIET_ROUNDS and not self.is_cut:
            self._bench.server.serve_once(0.002)
            quiet += 1
            try:
                received = self._socket.recv(at_most)
            except BlockingIOError:
                continue
            except OSError:
                received = b""
            self.is_cut = not received
            self._heard += received
            quiet = 0
        return self._packets()

    def close(self) -> None:
        self._socket.close()

    def _packets(self) -> list[tuple[int, bytes]]:
        packets = []
        while len(self._heard) >= 8:
            length, kind = struct.unpack_from("<II", self._heard)
            if len(self._heard) < length:
                break
            packets.append((kind, self._heard[8:length]))
            self._heard = self._heard[length:]
        return packets
