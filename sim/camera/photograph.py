"""Interface of a simulated room for a camera body, and the room in real time."""

from functools import cached_property
from typing import Protocol

from labrig.foundation.clock import Clock, VirtualClock


class Sensor(Protocol):
    """The sensor behind the shutter, standing in a simulated room."""

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        """Return the RAW file of an exposure that began at start_s and is over."""
        ...


class Photograph:
    """One exposure, computed when it is read for the first time."""

    def __init__(
        self, sensor: Sensor, start_s: float, exposure_s: float, iso: int, f_number: float
    ) -> None:
        self.start_s = start_s
        self._sensor = sensor
        self._exposure_s = exposure_s
        self._iso = iso
        self._f_number = f_number

    @cached_property
    def raw(self) -> bytes:
        """Bytes of the RAW file."""
        return self._sensor.photograph(self.start_s, self._exposure_s, self._iso, self._f_number)


class Pace:
    """Coupling of a simulated room's time to that of the PC.

    The room's clock stands still inside a transaction and is advanced before the next.

    Parameters
    ----------
    clock
        The PC's clock.
    room_clock
        The room's clock, which nothing else advances.
    """

    def __init__(self, clock: Clock, room_clock: VirtualClock) -> None:
        self._clock = clock
        self._room_clock = room_clock
        self._zero_s = clock.now() - room_clock.now()

    def catch_up(self) -> float:
        """Advance the room's clock to the PC's; return the room's time."""
        behind_s = self._clock.now() - self._zero_s - self._room_clock.now()
        self._room_clock.spend(max(0.0, behind_s))
        return self._room_clock.now()
