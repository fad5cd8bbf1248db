"""Common part of a trap door and a lamp shield, which a servo swings to and fro."""

from typing import ClassVar

from labrig.acquire import Connections

from .servo import Servo, ServoSettings


class ServoDoor:
    """Part of the bench on one channel of a Pololu Maestro.

    Parameters
    ----------
    address
        The Maestro's command port; other channels of it may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    #: Name of the device in messages.
    what: ClassVar[str]

    @staticmethod
    def declared_travel_s(settings: ServoSettings) -> float:
        """Return the seconds from the command until the door has stopped, for plans."""
        return settings.travel

    def __init__(self, address: str, settings: ServoSettings, connections: Connections) -> None:
        self._channel, self._travel_s = settings.channel, self.declared_travel_s(settings)
        self._servo = Servo(address, settings, connections)

    def identity(self) -> str:
        """Return the Maestro's channel and pulse; a Maestro reports no model or serial number."""
        return (
            f"Pololu Maestro servo controller, {self.what} on channel {self._channel}, "
            f"pulse {self._servo.pulse_s * 1e6:.2f} µs"
        )

    def travel_s(self) -> float:
        """Return the seconds from the command until the door has stopped, from the rig file."""
        return self._travel_s

    def heartbeat(self) -> None:
        """Restart the Maestro's serial time-out, and check that it has not run out."""
        self._servo.raise_errors()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
