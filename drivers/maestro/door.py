"""A trap door on a servo."""

from typing import Self

from pydantic import model_validator

from labrig.acquire import Connections

from .servo import PulseS, ServoSettings, quarters
from .swung import ServoDoor


class MaestroDoor(ServoDoor):
    """A trap door moved by a servo on a Pololu Maestro.

    The read-back is the pulse that the Maestro sends, not the angle of the door: a door that is
    stuck, or a servo without power, is seen by the camera alone. A servo takes a new pulse with its
    next frame, so the door starts 0 to 20 ms after the command, differently each time.
    """

    what = "trap door"

    class Settings(ServoSettings):
        """Keys of a trap door on a Pololu Maestro in a rig file.

        Attributes
        ----------
        closed
            Length of the servo's pulse with the door closed, for example `1000 us`.
        open
            Length of the servo's pulse with the door open, for example `2000 us`.
        """

        closed: PulseS
        open: PulseS

        @model_validator(mode="after")
        def _two_ends(self) -> Self:
            if quarters(self.closed) == quarters(self.open):
                raise ValueError("expected two different pulses for 'closed' and 'open'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._settings = settings

    def open(self) -> None:
        """Begin to open; errors and the pulse are read back."""
        self._servo.go(self._settings.open)

    def close(self) -> None:
        """Begin to close; errors and the pulse are read back."""
        self._servo.go(self._settings.closed)

    def make_safe(self) -> None:
        """Resynchronise the line, then close; return when the door has had the time."""
        self._servo.bring(self._settings.closed)
