"""Interface of the simulated room for a camera body: light turned into a RAW file."""

from functools import cached_property
from typing import Protocol


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
