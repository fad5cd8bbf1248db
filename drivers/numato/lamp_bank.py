"""Broadband lamps behind relays of a Numato board, one lit at a time; every relay is read back."""

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig.acquire import Connections, Illuminant

from ..light_switches import LampSwitches
from .board import CHANNELS, Board, BoardRelay

Name = Annotated[str, Field(min_length=1)]


class RelayLamp(Illuminant):
    """A lamp on a relay, with what is known of its light.

    Attributes
    ----------
    relay
        Number of the relay that switches the lamp, counted from 0.
    """

    relay: Annotated[int, Field(ge=0, lt=len(CHANNELS))]


class NumatoLampBank(LampSwitches):
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

    class Settings(BaseModel):
        """Keys of lamps on relays of a Numato board in a rig file.

        Attributes
        ----------
        lamps
            Relay and light of each lamp by the lamp's name, for example
            `{halogen: {relay: 1, spectrum: halogen_3000k, settling: 10 min}}`.
        """

        model_config = ConfigDict(frozen=True, extra="forbid")

        lamps: dict[Name, RelayLamp] = Field(min_length=1)

        @model_validator(mode="after")
        def _a_relay_each(self) -> Self:
            if len({lamp.relay for lamp in self.lamps.values()}) < len(self.lamps):
                raise ValueError("expected a relay of its own for each lamp in 'lamps'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relays = {name: lamp.relay for name, lamp in settings.lamps.items()}
        self._board = Board(address, connections)
        relays = {name: BoardRelay(self._board, relay) for name, relay in self._relays.items()}
        super().__init__(self._board.name, relays, settings.lamps, self._board.resynchronise)

    @classmethod
    def declared_lamps(cls, settings: Settings) -> Mapping[str, Illuminant]:
        """Return what the rig file says of the lamps' light by their names, for plans."""
        return settings.lamps

    def reads_back(self) -> bool:
        """Return True: every Numato board reports the states of its relays."""
        return True

    def identity(self) -> str:
        """Return maker, firmware version and id of the board, and the names of the lamps."""
        lamps = ", ".join(f"{name} on relay {relay}" for name, relay in self._relays.items())
        return f"Numato relay board, {self._board.identity()}, lamps {lamps}"
