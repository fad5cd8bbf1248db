"""Things that a servo on a Pololu Maestro brings into place, one position for each."""

from collections.abc import Mapping
from typing import ClassVar

from labrig.acquire import Connections

from ..named_places import FilterPlaces, NamedPlaces, SamplePlaces
from .servo import PulseS, Servo, ServoSettings, quarters


class ServoPlaces(NamedPlaces[float]):
    """Common part of a filter wheel and a sample changer on a servo.

    The read-back is the pulse that the Maestro sends, not the place of the thing.
    """

    #: Name of the device in messages.
    what: ClassVar[str]

    def __init__(
        self,
        address: str,
        settings: ServoSettings,
        connections: Connections,
        pulses_s: Mapping[str, float],
        empty_s: float,
    ) -> None:
        super().__init__(pulses_s, empty_s)
        self._channel = settings.channel
        self._servo = Servo(address, settings, connections)

    @classmethod
    def declared_turn_s(cls, settings: ServoSettings) -> float:
        """Return the longest time of a turn in seconds, from the rig file."""
        return settings.travel

    def identity(self) -> str:
        """Return the Maestro's channel and pulse; a Maestro reports no model or serial number."""
        return (
            f"Pololu Maestro servo controller, {self.what} on channel {self._channel}, "
            f"pulse {self._servo.pulse_s * 1e6:.2f} µs"
        )

    def _move(self, position: float) -> None:
        self._servo.bring(position)

    def heartbeat(self) -> None:
        """Restart the Maestro's serial time-out, and check that it has not run out."""
        self._servo.raise_errors()

    def make_safe(self) -> None:
        """Resynchronise the line, then turn to the empty place."""
        self._servo.bring(self._empty)

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""


def require_different(pulses_s: Mapping[str, PulseS], empty_s: PulseS, what: str) -> None:
    """Raise ValueError if two places have one pulse."""
    pulses = [quarters(empty_s), *map(quarters, pulses_s.values())]
    if len(set(pulses)) < len(pulses):
        raise ValueError(f"expected a pulse of its own for every {what}")


class ServoFilters(ServoPlaces, FilterPlaces[float]):
    """Filters that a servo brings before lamp or camera."""

    what = "filter wheel"


class ServoSamples(ServoPlaces, SamplePlaces[float]):
    """Samples that a servo brings into the light."""

    what = "sample changer"
