"""Serial lines for drivers under test: a scripted one, one with an emulated board at its end."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn, Protocol

from labrig.foundation.clock import Interrupted, VirtualClock

#: What must be written, and what comes back for it.
Script = list[tuple[bytes, bytes]]


class Board(Protocol):
    def receive(self, data: bytes) -> bytes: ...


class ScriptedPort:
    """Plays (what must be written, what comes back) in order; bytes come one per millisecond."""

    def __init__(self, clock: VirtualClock, script: Script) -> None:
        self.script = script
        self._clock = clock
        self._coming: list[tuple[float, bytes]] = []

    @property
    def in_waiting(self) -> int:
        return sum(due_s <= self._clock.now() for due_s, _ in self._coming)

    def read(self, size: int = 1, /) -> bytes:
        count = min(size, self.in_waiting)
        taken, self._coming = self._coming[:count], self._coming[count:]
        return b"".join(byte for _, byte in taken)

    def write(self, data: bytes, /) -> int:
        expected, answer = self.script.pop(0)
        assert data == expected
        now_s = self._clock.now()
        self._coming += [(now_s + 0.001 * n, answer[n : n + 1]) for n in range(len(answer))]
        return len(data)

    def close(self) -> None:
        pass


class BoardPort(ScriptedPort):
    """The same line with an emulated board at its end; each answer is late by `late_s`."""

    def __init__(self, clock: VirtualClock, board: Board, late_s: float = 0.0) -> None:
        super().__init__(clock, [])
        self._board = board
        self._late_s = late_s

    def write(self, data: bytes, /) -> int:
        now_s = self._clock.now()
        begins_s = max([now_s + self._late_s, *(due_s for due_s, _ in self._coming[-1:])])
        for n, byte in enumerate(self._board.receive(data)):
            self._coming.append((begins_s + 0.001 * n, bytes((byte,))))
        return len(data)


class Wired:
    """Connections with one port."""

    def __init__(self, clock: VirtualClock, port: ScriptedPort) -> None:
        self.clock = clock
        self._port = port

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> ScriptedPort:
        return self._port

    def usb(self, address: str, serial_of: object = None) -> None:
        raise AssertionError("no USB here")

    def tcp(self, address: str, default_port: int) -> NoReturn:
        raise AssertionError("no network here")


class InterruptingClock(VirtualClock):
    """Interrupts at the n-th wait."""

    waits_left = 10**9

    def _pause_until(self, deadline_s: float) -> None:
        self.waits_left -= 1
        if self.waits_left == 0:
            self.interrupt(2)
        super()._pause_until(deadline_s)

    @contextmanager
    def interrupted_after(self, waits: int) -> Iterator[None]:
        """Interrupt what is done within after so many waits; undisturbed afterwards."""
        self.waits_left = waits
        with suppress(Interrupted):
            yield
        self.waits_left = 10**9
