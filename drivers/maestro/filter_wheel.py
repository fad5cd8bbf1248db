"""A home-made filter wheel or slide on a servo."""

from collections.abc import Mapping, Sequence
from typing import Self

from pydantic import Field, model_validator

from labrig.acquire import Connections

from .servo import PulseS, Servo, ServoSettings, quarters


class MaestroFilterWheel:
    """Filters on an arm, a slide or a wheel that a servo on a Pololu Maestro moves.

    The read-back is the pulse that the Maestro sends, not the place of the filter.

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
            Length of the servo's pulse with each filter before the lamp, by the filter's name, for
            example `{bandpass-450: 1100 us, bandpass-500: 1300 us}`.
        open
            Length of the servo's pulse with no filter before the lamp, for example `1000 us`.
        """

        filters: Mapping[str, PulseS] = Field(min_length=1)
        open: PulseS

        @model_validator(mode="after")
        def _different_pulses(self) -> Self:
            pulses = [quarters(self.open), *map(quarters, self.filters.values())]
            if len(set(pulses)) < len(pulses):
                raise ValueError("expected a pulse of its own for every filter and for 'open'")
            return self

    @classmethod
    def declared_filters(cls, settings: Settings) -> Sequence[str]:
        """Return the filters that the rig file names."""
        return tuple(settings.filters)

    @classmethod
    def declared_turn_s(cls, settings: Settings) -> float:
        """Return the longest time of a turn in seconds, from the rig file."""
        return settings.travel

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._servo = Servo(address, settings, connections)

    def identity(self) -> str:
        """Return the Maestro's channel and pulse; a Maestro reports no model or serial number."""
        return (
            f"Pololu Maestro servo controller, filter wheel on channel {self._settings.channel}, "
            f"pulse {self._servo.pulse_s * 1e6:.2f} µs"
        )

    def filters(self) -> tuple[str, ...]:
        """Return the names of the filters in the wheel."""
        return tuple(self._settings.filters)

    def put(self, name: str | None) -> None:
        """Turn to a filter or to the open place; return when the servo has had the time."""
        pulse_s = self._settings.open if name is None else self._settings.filters[name]
        self._servo.bring(pulse_s)

    def heartbeat(self) -> None:
        """Restart the Maestro's serial time-out, and check that it has not run out."""
        self._servo.raise_errors()

    def make_safe(self) -> None:
        """Resynchronise the line, then turn to the open place."""
        self._servo.bring(self._settings.open)

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
