"""Things that a board on a serial line brings into place, by commands that are in the rig file."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from labrig.acquire import Connections
from labrig.foundation.quantity import DurationS

from ..named_places import FilterPlaces, NamedPlaces, SamplePlaces
from .board import Board
from .settings import BoardSettings, Exchange


class PlacesSettings(BoardSettings):
    """Keys that a filter wheel and a sample changer have in common.

    Attributes
    ----------
    turn
        Time of a turn, for example `3 s`. It is waited for where a command has no answer.
    """

    turn: Annotated[DurationS, Field(ge=0, le=60)] = 3.0


class BoardPlaces(NamedPlaces[Exchange]):
    """Common part of a filter wheel and a sample changer of any board."""

    #: Name of the device in messages.
    what: ClassVar[str]

    def __init__(
        self,
        address: str,
        settings: PlacesSettings,
        connections: Connections,
        commands: Mapping[str, Exchange],
        empty: Exchange,
    ) -> None:
        super().__init__(commands, empty)
        self._turn_s = settings.turn
        self._clock = connections.clock
        self._board = Board(address, settings, connections)

    @classmethod
    def declared_turn_s(cls, settings: PlacesSettings) -> float:
        """Return the time of a turn in seconds, from the rig file."""
        return settings.turn

    def identity(self) -> str:
        """Return the board's answer to its identity query, or its address."""
        return f"{self.what}, {self._board.identity()}"

    def _move(self, position: Exchange) -> None:
        """Return when the board confirms it, or when the time of a turn is over."""
        self._board.do(position)
        if position.answer is None:
            self._clock.sleep(self._turn_s)

    def heartbeat(self) -> None:
        """Restart the board's watchdog, if the rig file says how."""
        self._board.keep_alive()

    def make_safe(self) -> None:
        """Resynchronise the line, then turn to the empty place."""
        self._board.resynchronise([self._empty])
        self.put(None)

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""


def different(commands: Mapping[str, Exchange], what: str) -> Mapping[str, Exchange]:
    """Return the commands of all places.

    Raises
    ------
    ValueError
        Two places have one command.
    """
    if len({exchange.send for exchange in commands.values()}) < len(commands):
        raise ValueError(f"expected a command of its own for every {what}")
    return commands


class BoardFilters(BoardPlaces, FilterPlaces[Exchange]):
    """Filters that a board brings before lamp or camera."""

    what = "filter wheel"


class BoardSamples(BoardPlaces, SamplePlaces[Exchange]):
    """Samples that a board brings into the light."""

    what = "sample changer"
