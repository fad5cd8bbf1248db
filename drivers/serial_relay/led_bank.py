"""LEDs behind relays of any board on a serial line, one lit at a time."""

from collections.abc import Mapping, Sequence
from typing import Self

from pydantic import Field, model_validator

from labrig.acquire import Connections, Finding, LedLight

from ..light_switches import LightSwitches, Name
from .board import Board, Relay, findings
from .settings import BoardSettings, SwitchCommands
from .wire_text import wire_text


class CommandedLed(LedLight, SwitchCommands):
    """Commands of an LED's relay, with what is known of its light."""


class SerialLedBank(LightSwitches):
    """Several relays of a board whose commands are in the rig file, each switching an LED.

    Parameters
    ----------
    address
        Serial port of the board; its other relays may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(BoardSettings):
        """Keys of LEDs on relays of any board on a serial line in a rig file.

        Attributes
        ----------
        channels
            Commands of each LED's relay by the LED's name, for example
            `{"450 nm": {on: on 1, off: off 1, centre: 450, fwhm: 20, settling: 0.5 s}}`.
        """

        channels: dict[Name, CommandedLed] = Field(min_length=1)

        @model_validator(mode="after")
        def _a_relay_each(self) -> Self:
            if len({wire_text(led.on.send) for led in self.channels.values()}) < len(self.channels):
                raise ValueError("expected a command 'on' of its own for each LED in 'channels'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._board = Board(address, settings, connections)
        self._relays = {
            name: Relay(self._board, commands, name) for name, commands in settings.channels.items()
        }
        off = [relay.off for relay in self._relays.values()]
        super().__init__(
            self._board.name,
            self._relays,
            settings.channels,
            lambda: self._board.resynchronise(off),
        )

    @classmethod
    def declared_leds(cls, settings: Settings) -> Mapping[str, LedLight]:
        """Return what the rig file says of the LEDs' light by their names, for plans."""
        return settings.channels

    def reads_back(self) -> bool:
        """Return whether the rig file has a query for the state of every LED."""
        return all(relay.reads_back for relay in self._relays.values())

    def identity(self) -> str:
        """Return the board's answer to its identity query, or its address, and the LEDs' names."""
        return f"serial relays, {self._board.identity()}, LEDs {', '.join(self._relays)}"

    def findings(self) -> Sequence[Finding]:
        """Return whether anything but the camera can verify that the LEDs were switched."""
        return findings(self._relays.values())

    def heartbeat(self) -> None:
        """Restart the board's watchdog, if the rig file says how."""
        self._board.keep_alive()
