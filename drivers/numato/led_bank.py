"""LEDs behind relays of a Numato board, one lit at a time; every relay is read back."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from labrig.acquire import Connections, LedLight
from labrig.foundation.models import FrozenModel

from ..light_switches import Name
from .relay_bank import Number, RelayBank, require_a_relay_each


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


class NumatoLedBank(RelayBank):
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

    nouns = "LEDs"

    class Settings(FrozenModel):
        """Keys of LEDs on relays of a Numato board in a rig file.

        Attributes
        ----------
        relays
            Relay of each LED by the LED's name, counted from 0, for example
            `{"450 nm": 1, "525 nm": 2}`; or with the LED's light
            `{"450 nm": {relay: 1, centre: 450, fwhm: 20, settling: 0.5 s}}`.
        """

        relays: dict[Name, Led] = Field(min_length=1)

        @model_validator(mode="after")
        def _a_relay_each(self) -> Self:
            require_a_relay_each((led.relay for led in self.relays.values()), "LED", "relays")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        relays = {name: led.relay for name, led in settings.relays.items()}
        super().__init__(address, relays, settings.relays, connections)

    @classmethod
    def declared_leds(cls, settings: Settings) -> Mapping[str, LedLight]:
        """Return what the rig file says of the LEDs' light by their names, for plans."""
        return settings.relays
