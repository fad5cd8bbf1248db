"""LEDs behind relays of a Numato board, one lit at a time; every relay is read back."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from labrig.acquire import Connections, LedLight

from ..light_switches import LedSwitches
from .board import CHANNELS, Board, BoardRelay

Name = Annotated[str, Field(min_length=1)]
Number = Annotated[int, Field(ge=0, lt=len(CHANNELS))]


class RelayLed(LedLight):
    """An LED on a relay, with what is known of its light.

    Attributes
    ----------
    relay
        Number of the relay that switches the LED, counted from 0.
    """

    relay: Number


def _led(value: Any) -> Any:
    return value if isinstance(value, dict | RelayLed) else {"relay": value}


Led = Annotated[RelayLed, BeforeValidator(_led, json_schema_input_type=Number | RelayLed)]


class NumatoLedBank(LedSwitches):
    """Several relays of one Numato board, each switching an LED.

    Parameters
    ----------
    address
        Serial port of the board; its other relays may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(BaseModel):
        """Keys of LEDs on relays of a Numato board in a rig file.

        Attributes
        ----------
        relays
            Relay of each LED by the LED's name, counted from 0, for example
            `{"450 nm": 1, "525 nm": 2}`; or with the LED's light
            `{"450 nm": {relay: 1, centre: 450, fwhm: 20, settling: 0.5 s}}`.
        """

        model_config = ConfigDict(frozen=True, extra="forbid")

        relays: dict[Name, Led] = Field(min_length=1)

        @model_validator(mode="after")
        def _a_relay_each(self) -> Self:
            if len({led.relay for led in self.relays.values()}) < len(self.relays):
                raise ValueError("expected a relay of its own for each LED in 'relays'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relays = {name: led.relay for name, led in settings.relays.items()}
        self._board = Board(address, connections)
        relays = {name: BoardRelay(self._board, relay) for name, relay in self._relays.items()}
        super().__init__(self._board.name, relays, settings.relays, self._board.resynchronise)

    @classmethod
    def declared_leds(cls, settings: Settings) -> Mapping[str, LedLight]:
        """Return what the rig file says of the LEDs' light by their names, for plans."""
        return settings.relays

    def reads_back(self) -> bool:
        """Return True: every Numato board reports the states of its relays."""
        return True

    def identity(self) -> str:
        """Return maker, firmware version and id of the board, and the names of the LEDs."""
        leds = ", ".join(f"{name} on relay {relay}" for name, relay in self._relays.items())
        return f"Numato relay board, {self._board.identity()}, LEDs {leds}"
