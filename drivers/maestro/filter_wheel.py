"""A home-made filter wheel or slide on a servo."""

from collections.abc import Mapping
from typing import Self

from pydantic import Field, model_validator

from labrig.acquire import Connections

from .places import ServoFilters, require_different
from .servo import PulseS, ServoSettings


class MaestroFilterWheel(ServoFilters):
    """Filters on an arm, a slide or a wheel that a servo on a Pololu Maestro moves.

    Parameters
    ----------
    address
        The Maestro's command port; other channels of it may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(ServoSettings):
        """Keys of a filter wheel on a servo in a rig file.

        Attributes
        ----------
        filters
            Length of the servo's pulse with each filter in place, by the filter's name, for example
            `{bandpass-450: 1100 us, bandpass-500: 1300 us}`.
        open
            Length of the servo's pulse with no filter in place, for example `1000 us`.
        """

        filters: Mapping[str, PulseS] = Field(min_length=1)
        open: PulseS

        @model_validator(mode="after")
        def _different_pulses(self) -> Self:
            require_different(self.filters, self.open, "filter and for 'open'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(address, settings, connections, settings.filters, settings.open)
