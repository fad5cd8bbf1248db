"""The driver against the bytes of its wire, and on the simulated bench."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import labrig
from labrig.acquire import LAMP, Lamp, load_driver
from labrig.foundation.clock import VirtualClock

RIG = Path(__file__).parents[1] / "rig.yaml"


class Wire:
    """A line that expects these commands and gives these answers; nothing passes on a cable."""

    def __init__(self, *exchanges: tuple[bytes, bytes]) -> None:
        self.clock = VirtualClock()
        self.left = list(exchanges)
        self._coming = b""

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> "Wire":
        return self

    @property
    def in_waiting(self) -> int:
        return len(self._coming)

    def read(self, size: int = 1) -> bytes:
        received, self._coming = self._coming[:size], self._coming[size:]
        return received

    def write(self, data: bytes) -> int:
        expected, answer = self.left.pop(0)
        assert data == expected
        self._coming += answer
        return len(data)


ON = (b"relay on 3\r", b"relay on 3\n\r>")
OFF = (b"relay off 3\r", b"relay off 3\n\r>")


def reads(state: bytes) -> tuple[bytes, bytes]:
    return b"relay read 3\r", b"relay read 3\n\r" + state + b"\n\r>"


def relay(wire: Wire) -> Lamp:
    lamp = load_driver("lamp", "my_relay", "a test")
    return lamp("COM3", lamp.Settings(relay=3), wire)


def test_the_bytes_on_the_wire() -> None:
    wire = Wire(ON, reads(b"on"), (b"\r", b"\n\r>"), OFF, reads(b"off"))
    lamp = relay(wire)
    assert isinstance(lamp, Lamp)
    lamp.on()
    lamp.make_safe()
    assert wire.left == []


@pytest.mark.parametrize("answer", [reads(b"off"), (b"relay read 3\r", b"")])
def test_a_relay_that_does_not_switch_is_an_error(answer: tuple[bytes, bytes]) -> None:
    with pytest.raises(labrig.DeviceError):
        relay(Wire(ON, answer)).on()


@contextmanager
def bench() -> Iterator[Lamp]:
    with labrig.open_bench(labrig.read_rig_file(RIG), str(RIG)) as opened, opened.devices() as rig:
        yield rig[LAMP]


def test_on_the_simulated_bench() -> None:
    with bench() as lamp:
        assert not lamp.is_on()
        lamp.on()
        assert lamp.is_on()
        lamp.make_safe()
        assert not lamp.is_on()
