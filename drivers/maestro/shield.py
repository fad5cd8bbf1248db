"""A shield before the lamp, on a servo."""

from typing import Self

from pydantic import model_validator

from labrig.acquire.connections import Connections

from .servo import PulseS, Servo, ServoSettings, quarters


class MaestroShield:
    """A shield that a servo on a Pololu Maestro swings before the lamp.

    Read back and timed as a `MaestroDoor`. Safe is uncovered: a hot lamp behind a shield cannot
    lose its heat.

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
        covering, uncovering
            Length of the servo's pulse at either end, such as `1000 us`.
        """

        covering: PulseS
        uncovering: PulseS

        @model_validator(mode="after")
        def _two_ends(self) -> Self:
            if quarters(self.covering) == quarters(self.uncovering):
                raise ValueError("expected two different pulses for 'covering' and 'uncovering'")
            return self

    @staticmethod
    def declared_travel_s(settings: Settings) -> float:
        """For plans: seconds from the command until the shield has stopped."""
        return settings.travel

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._servo = Servo(address, settings, connections)

    def identity(self) -> str:
        """The Maestro's channel and its pulse; a Maestro does not tell its model or serial."""
        return (
            f"Pololu Maestro servo controller, lamp shield on channel {self._settings.channel}, "
            f"pulse {self._servo.pulse_s * 1e6:.2f} µs"
        )

    def cover(self) -> None:
        """Begin to cover the lamp; errors and the pulse are read back."""
        self._servo.go(self._settings.covering)

    def uncover(self) -> None:
        """Begin to uncover the lamp; errors and the pulse are read back."""
        self._servo.go(self._settings.uncovering)

    def travel_s(self) -> float:
        """Seconds from the command until the shield has stopped, as the rig file says."""
        return self.declared_travel_s(self._settings)

    def heartbeat(self) -> None:
        """Keep the Maestro's serial time-out from running out, and see that it has not."""
        self._servo.raise_errors()

    def make_safe(self) -> None:
        """Bring the line back into step, then uncover; returns when it has had the time."""
        self._servo.bring(self._settings.uncovering)

    def disconnect(self) -> None:
        """The port belongs to the connections, which close it."""
