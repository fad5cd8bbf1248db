"""One serial line: what belongs to an answer is read, and nothing of the next."""

import pytest

from labrig.drivers.serial_line import SerialLine
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UnclearAnswerError


class FullPort:
    """A port in whose buffer several answers have arrived at once."""

    def __init__(self, received: bytes) -> None:
        self.left = received

    @property
    def in_waiting(self) -> int:
        return len(self.left)

    def read(self, size: int = 1, /) -> bytes:
        taken, self.left = self.left[:size], self.left[size:]
        return taken

    def write(self, data: bytes, /) -> int:
        return len(data)

    def close(self) -> None:
        pass


def test_answers_that_arrived_together_are_read_one_by_one() -> None:
    port = FullPort(b"one\ntwo\n\x01\x02\x03rest")
    line = SerialLine(port, VirtualClock(), "the board")
    assert line.read_until(b"\n", 1.0) == b"one\n"
    assert line.read_until(b"\n", 1.0) == b"two\n"
    assert line.read_exactly(3, 1.0) == b"\x01\x02\x03"
    assert line.drain() == b"rest"
    with pytest.raises(UnclearAnswerError, match=r"within 1 s: expected .* got b''"):
        line.read_until(b"\n", 1.0)
