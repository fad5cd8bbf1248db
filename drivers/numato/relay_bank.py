"""Lights behind relays of a Numato board, one lit at a time; every relay is read back."""

from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from labrig.acquire import Connections, LedLight

from ..light_switches import LightSwitches
from .board import CHANNELS, Board, BoardRelay

Number = Annotated[int, Field(ge=0, lt=len(CHANNELS))]


class RelayBank(LightSwitches):
    """Several relays of one Numato board, each switching a light.

    Parameters
    ----------
    address
        Serial port of the board; its other relays may be used by other devices.
    relays
        Number of each light's relay by the light's name.
    lights
        What the rig file says of each light, by its name.
    connections
        Connections that open the port.
    """

    #: What the lights are called.
    nouns: ClassVar[str]

    def __init__(
        self,
        address: str,
        relays: Mapping[str, int],
        lights: Mapping[str, LedLight],
        connections: Connections,
    ) -> None:
        self._relays = dict(relays)
        self._board = Board(address, connections)
        switches = {name: BoardRelay(self._board, relay) for name, relay in relays.items()}
        super().__init__(self._board.name, switches, lights, self._board.resynchronise)

    def reads_back(self) -> bool:
        """Return True: every Numato board reports the states of its relays."""
        return True

    def identity(self) -> str:
        """Return maker, firmware version and id of the board, and the names of the lights."""
        lights = ", ".join(f"{name} on relay {relay}" for name, relay in self._relays.items())
        return f"Numato relay board, {self._board.identity()}, {self.nouns} {lights}"


def require_a_relay_each(relays: Iterable[int], noun: str, key: str) -> None:
    """Refuse lights of which two share a relay; `key` of the rig file lists them.

    Raises
    ------
    ValueError
        Two lights are on one relay.
    """
    relays = list(relays)
    if len(set(relays)) < len(relays):
        raise ValueError(f"expected a relay of its own for each {noun} in '{key}'")
