"""A trap door on a servo."""

from typing import Self

from pydantic import model_validator

from labrig.acquire.connections import Connections

from .servo import PulseS, Servo, ServoSettings, quarters


class MaestroDoor:
    """A trap door moved by a servo on a Pololu Maestro.

    What is read back is the pulse that the Maestro sends, not the angle of the door: a door that
    is stuck, or a servo without power, is seen by the camera alone. A servo takes a new pulse with
    its next frame, so the door starts 0 to 20 ms after the command, differently each time.

    Parameters
    ----------
    address
        The Maestro's command port; other channels of it may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Opens the port.
    """

    class Settings(ServoSettings):
        """Keys of the rig file.

        Attributes
        ----------
        closed, open
            Length of the servo's pulse at either end, such as `1000 us`.
        """

        closed: PulseS
        open: PulseS

        @model_validator(mode="after")
        def _two_ends(self) -> Self:
            if quarters(self.closed) == quarters(self.open):
                raise ValueError("expected two different pulses for 'closed' and 'open'")
            return self

    @staticmethod
    def declared_travel_s(settings: Settings) -> float:
        """For plans: seconds from the command until the door has stopped."""
        return settings.travel

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._servo = Servo(address, settings, connections)

    def identity(self) -> str:
        """The Maestro's channel and its pulse; a Maestro does not tell its model or serial."""
        return (
            f"Pololu Maestro servo controller, trap door on channel {self._settings.channel}, "
            f"pulse {self._servo.pulse_s * 1e6:.2f} µs"
        )

    def open(self) -> None:
        """Begin to open; errors and the pulse are read back."""
        self._servo.go(self._settings.open)

    def close(self) -> None:
        """Begin to close; errors and the pulse are read back."""
        self._servo.go(self._settings.closed)

    def travel_s(self) -> float:
        """Seconds from the command until the door has stopped, as the rig file says."""
        return self.declared_travel_s(self._settings)

    def heartbeat(self) -> None:
        """Keep the Maestro's serial time-out from running out, and see that it has not."""
        self._servo.raise_errors()

    def make_safe(self) -> None:
        """Bring the line back into step, then close; returns when the door has had the time."""
        self._servo.bring(self._settings.closed)

    def disconnect(self) -> None:
        """The port belongs to the connections, which close it."""
