"""What a servo swings to and fro: all that a trap door and a lamp shield have in common."""

from typing import ClassVar

from labrig.acquire import Connections

from .servo import Servo, ServoSettings


class Swung:
    """Something on one channel of a Pololu Maestro.

    Parameters
    ----------
    address
        The Maestro's command port; other channels of it may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Opens the port.
    """

    #: What it is called.
    what: ClassVar[str]

    @staticmethod
    def declared_travel_s(settings: ServoSettings) -> float:
        """For plans: seconds from the command until it has stopped."""
        return settings.travel

    def __init__(self, address: str, settings: ServoSettings, connections: Connections) -> None:
        self._channel, self._travel_s = settings.channel, self.declared_travel_s(settings)
        self._servo = Servo(address, settings, connections)

    def identity(self) -> str:
        """The Maestro's channel and its pulse; a Maestro does not tell its model or serial."""
        return (
            f"Pololu Maestro servo controller, {self.what} on channel {self._channel}, "
            f"pulse {self._servo.pulse_s * 1e6:.2f} µs"
        )

    def travel_s(self) -> float:
        """Seconds from the command until it has stopped, as the rig file says."""
        return self._travel_s

    def heartbeat(self) -> None:
        """Keep the Maestro's serial time-out from running out, and see that it has not."""
        self._servo.raise_errors()

    def disconnect(self) -> None:
        """The port belongs to the connections, which close it."""
