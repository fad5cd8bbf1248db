"""A shield before the lamp, on a servo."""

from typing import Self

from pydantic import model_validator

from labrig.acquire import Connections

from .servo import PulseS, ServoSettings, quarters
from .swung import ServoDoor


class MaestroShield(ServoDoor):
    """A shield that a servo on a Pololu Maestro swings before the lamp.

    Its read-back and timing are those of `MaestroDoor`. Its safe position is uncovered: a hot lamp
    behind a shield cannot lose its heat.
    """

    what = "lamp shield"

    class Settings(ServoSettings):
        """Keys of a lamp shield on a Pololu Maestro in a rig file.

        Attributes
        ----------
        covering
            Length of the servo's pulse with the shield before the lamp, for example `1000 us`.
        uncovering
            Length of the servo's pulse with the shield away from the lamp, its safe end, for
            example `2000 us`.
        """

        covering: PulseS
        uncovering: PulseS

        @model_validator(mode="after")
        def _two_ends(self) -> Self:
            if quarters(self.covering) == quarters(self.uncovering):
                raise ValueError("expected two different pulses for 'covering' and 'uncovering'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._settings = settings

    def cover(self) -> None:
        """Begin to cover the lamp; errors and the pulse are read back."""
        self._servo.go(self._settings.covering)

    def uncover(self) -> None:
        """Begin to uncover the lamp; errors and the pulse are read back."""
        self._servo.go(self._settings.uncovering)

    def make_safe(self) -> None:
        """Resynchronise the line, then uncover; return when the shield has had the time."""
        self._servo.bring(self._settings.uncovering)
