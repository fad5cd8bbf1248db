"""A simulated camera with nothing but a clock and a cable around it, for drivers."""

import hashlib
from typing import Any, NoReturn

import usb.core

from labrig.acquire.connections import SerialPort
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.sim.camera import SimulatedCamera


class Picture:
    """A sensor whose files say what was exposed; sizes that end on packet borders included."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.taken: list[tuple[float, float]] = []

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        self.taken.append((start_s, exposure_s))
        text = f"{start_s:.6f} {exposure_s:.6f} {iso}".encode()
        return hashlib.sha256(text).digest() * (self.size // 32) + b"x" * (self.size % 32)


class StoppingClock(VirtualClock):
    """Is interrupted at its n-th wait."""

    waits_left = -1

    def _pause_until(self, deadline_s: float) -> None:
        self.waits_left -= 1
        if self.waits_left == 0:
            self.interrupt(2)
        super()._pause_until(deadline_s)


class Wired:
    """Connections to one camera."""

    def __init__(self, clock: VirtualClock, camera: SimulatedCamera) -> None:
        self.clock = clock
        self._camera = camera

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        raise AssertionError("no serial line here")

    def usb(self, address: str, serial_of: object = None) -> Any:
        found = usb.core.find(backend=self._camera.backend)
        if found is None:
            raise DeviceError("no camera")
        return found

    def tcp(self, address: str, default_port: int) -> NoReturn:
        raise AssertionError("no network here")
