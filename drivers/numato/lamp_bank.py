"""Broadband lamps behind relays of a Numato board, one lit at a time; every relay is read back."""

from collections.abc import Mapping
from typing import Self

from pydantic import Field, model_validator

from labrig.acquire import Connections, Illuminant
from labrig.foundation.models import FrozenModel

from ..light_switches import Name
from .relay_bank import Number, RelayBank, require_a_relay_each


class RelayLamp(Illuminant):
    """A lamp on a relay, with what is known of its light.

    Attributes
    ----------
    relay
        Number of the relay that switches the lamp, counted from 0.
    """

    relay: Number


class NumatoLampBank(RelayBank):
    """Several relays of one Numato board, each switching a lamp.

    Parameters
    ----------
    address
        Serial port of the board; its other relays may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    nouns = "lamps"

    class Settings(FrozenModel):
        """Keys of lamps on relays of a Numato board in a rig file.

        Attributes
        ----------
        lamps
            Relay and light of each lamp by the lamp's name, for example
            `{halogen: {relay: 1, spectrum: halogen_3000k, settling: 10 min}}`.
        """

        lamps: dict[Name, RelayLamp] = Field(min_length=1)

        @model_validator(mode="after")
        def _a_relay_each(self) -> Self:
            require_a_relay_each((lamp.relay for lamp in self.lamps.values()), "lamp", "lamps")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        relays = {name: lamp.relay for name, lamp in settings.lamps.items()}
        super().__init__(address, relays, settings.lamps, connections)

    @classmethod
    def declared_lamps(cls, settings: Settings) -> Mapping[str, Illuminant]:
        """Return what the rig file says of the lamps' light by their names, for plans."""
        return settings.lamps
