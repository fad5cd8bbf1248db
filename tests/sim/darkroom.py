"""A small room with everything on its bench, and how tests handle it."""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
import rawpy

from labrig.foundation.arrays import FloatArray
from labrig.foundation.clock import VirtualClock
from labrig.sim.arrangement import Arrangement
from labrig.sim.bench_settings import DoorSettings
from labrig.sim.boards import ChangerBoard, Pulse
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation

SMALL: Mapping[str, Any] = {
    "sample": [{"material": "blue-paint", "region": [0.0, 0.1, 1.0, 0.8]}],
    "sensor": {"width": 96, "height": 64, "flicker": 0.0},
}
#: Straight, untilted, both places alike: a column is a wavelength.
STRIP = {"region": [8, 16, 80, 32]}
LVF = {"centre": [400, 700], "bend_nm": 0, "before_camera": STRIP, "on_sample": STRIP}
DOOR = DoorSettings()


class Darkroom:
    """A room, its clock, changer and servo."""

    def __init__(self, **changed: Any) -> None:
        self.simulation = Simulation.model_validate({**SMALL, **changed})
        self.clock = VirtualClock(self.simulation.epoch.timestamp())
        self._pulses = [Pulse(0.0, DOOR.closed, 0.0)]
        self.room = Room(self.simulation, self.clock, lambda channel: self._pulses)
        self._changer = ChangerBoard(self.room.tasks)

    def do(self, *tasks: str) -> None:
        """The changer does one thing after the other."""
        for task in tasks:
            self._changer.do(task)

    def swing(self, width_s: float) -> None:
        """The servo is sent other pulses; the door comes to rest."""
        self._pulses.append(Pulse(self.clock.now(), width_s, 0.0))
        self.clock.spend(0.5)

    def charge(self, duration_s: float) -> None:
        """Lamp on, and off until it is dark."""
        self.room.switch_lamp(True)
        self.clock.spend(duration_s)
        self.room.switch_lamp(False)
        self.clock.spend(3.0)

    def shoot(self, exposure_s: float = 1.0, iso: int = 400, f_number: float = 4.0) -> FloatArray:
        """A photograph from now on, DN above black, shape (height, width)."""
        start_s = self.clock.now()
        self.clock.spend(exposure_s)
        return mosaic(self.room.photograph(start_s, exposure_s, iso, f_number))

    @property
    def arranged(self) -> Arrangement:
        """As the bench is now."""
        return self.room.arrangements.last


def mosaic(dng: bytes) -> FloatArray:
    """DN above black, shape (height, width)."""
    with rawpy.imread(io.BytesIO(dng)) as raw:
        return np.asarray(raw.raw_image_visible, dtype=np.float64) - 1024


def colours(frame: FloatArray) -> FloatArray:
    """R, G, B of Bayer cells, shape (height / 2, width / 2, 3)."""
    green = (frame[0::2, 1::2] + frame[1::2, 0::2]) / 2
    return np.stack([frame[0::2, 0::2], green, frame[1::2, 1::2]], axis=-1)


def columns(frame: FloatArray) -> FloatArray:
    """Sum of R, G, B for every column of Bayer cells within the middle of `STRIP`."""
    profile: FloatArray = colours(frame)[10:22].mean(axis=0).sum(axis=-1)
    return profile
