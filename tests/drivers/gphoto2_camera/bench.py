"""The driver on a served simulated camera, and on a toy of libgphoto2."""

import json
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from labrig.acquire.connections import SerialPort
from labrig.drivers.gphoto2_camera import Gphoto2Camera
from labrig.foundation.clock import Clock, SystemClock, VirtualClock
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation
from tests.counterparts.served import EPOCH_S, Film, served

TOY = Path(__file__).parent / "toy"
TIFF = b"II*\0" + bytes(60)
JPEG = b"\xff\xd8\xff" + bytes(61)
#: As libgphoto2 shows a Nikon, shortened.
NIKON: dict[str, list[str]] = {
    "manufacturer": ["Nikon Corporation"],
    "cameramodel": ["D7000"],
    "capturetarget": ["Memory card", "Internal RAM", "Memory card"],
    "capturemode": ["Continuous Low Speed", "Single Shot", "Continuous Low Speed", "Timer"],
    "autofocus": ["On", "On", "Off"],
    "imagequality": ["JPEG Fine", "JPEG Basic", "JPEG Fine", "NEF+Basic", "NEF (Raw)"],
    "expprogram": ["M", "M", "P", "A", "S"],
    "focusmode": ["Manual", "Manual", "AF-S"],
    "isoauto": ["Off", "On", "Off"],
    "longexpnr": ["Off", "On", "Off"],
    "iso": ["200", "100", "200", "400", "800", "1600", "3200", "Hi 1"],
    "f-number": ["f/5.6", "f/4", "f/4.5", "f/5", "f/5.6", "f/8"],
    "shutterspeed": ["0.0166s", "0.0166s"],
    "shutterspeed2": [
        "1/60", "1/8000", "1/125", "1/60", "1/30", "1/3", "10/25", "1/2", "10/16", "10/13", "1",
        "13/10", "2", "30", "Bulb",
    ],
}  # fmt: skip


class FastClock(SystemClock):
    """Time-outs of seconds pass in tenths of one; a busy PC starts a process in less."""

    def now(self) -> float:
        return 10 * super().now()


class Loopback:
    """Connections on this PC alone."""

    def __init__(self, clock: Clock | None = None, usb: Any = None) -> None:
        self.clock = clock or SystemClock()
        self._usb = usb

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        raise NotImplementedError

    def usb(self, address: str, serial_of: object = None) -> Any:
        return self._usb

    def tcp(self, address: str, default_port: int) -> socket.socket:
        return socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2])))


class Seen(Film):
    """A film that can also be looked through."""

    def preview(self, at_s: float) -> NDArray[np.uint8]:
        assert isinstance(self.sensor, Room)
        return self.sensor.preview(at_s)


@contextmanager
def connected(
    address: str, clock: Clock | None = None, **settings: object
) -> Iterator[Gphoto2Camera]:
    """The driver; rig file keys as they are written there."""
    parsed = Gphoto2Camera.Settings.model_validate(settings)
    camera = Gphoto2Camera(address, parsed, Loopback(clock))
    try:
        yield camera
    finally:
        camera.disconnect()


@contextmanager
def photographing(
    clock: Clock | None = None, **settings: object
) -> Iterator[tuple[Gphoto2Camera, Seen]]:
    """The driver and what the simulated camera's sensor, in a small lit room, has seen."""
    room_clock = VirtualClock(EPOCH_S)
    content = {"sample": "blue-paint", "initial": {"lamp": "on"}}
    simulation = Simulation.model_validate(content | {"sensor": {"width": 96, "height": 64}})
    film = Seen(Room(simulation, room_clock))
    with served(film, room_clock) as server, connected(server.address, clock, **settings) as camera:
        yield camera, film


class ToyBench:
    """Tells the toy what it is, and what it was told."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self._path = folder / "toy.json"
        monkeypatch.setenv("GPHOTO2_TOY", str(self._path))
        monkeypatch.setenv("PYTHONPATH", str(TOY))

    def describe(self, changes: dict[str, list[str]], toy: dict[str, Any] | None = None) -> None:
        """A Nikon, changed as told; one with an empty list is without that setting."""
        changed = {name: labels for name, labels in (NIKON | changes).items() if labels}
        self._path.write_text(json.dumps({"settings": changed} | (toy or {})))

    @contextmanager
    def connected(
        self,
        changes: dict[str, list[str]],
        toy: dict[str, Any] | None = None,
        clock: Clock | None = None,
        **settings: object,
    ) -> Iterator[Gphoto2Camera]:
        """The driver on that Nikon; rig file keys as they are written there."""
        self.describe(changes, toy)
        with closing(socket.create_server(("127.0.0.1", 0))) as somebody:
            address = f"ptpip://127.0.0.1:{somebody.getsockname()[1]}"
            with connected(address, clock, answer_timeout="50 ms", **settings) as camera:
                yield camera

    def log(self) -> list[str]:
        """What the driver has made libgphoto2 do."""
        with suppress(FileNotFoundError):
            return self._path.with_suffix(".log").read_text().splitlines()
        return []
