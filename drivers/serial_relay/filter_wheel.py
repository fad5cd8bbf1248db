"""A filter wheel on any board on a serial line, by commands that are in the rig file."""

from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field, field_validator

from labrig.acquire import Connections
from labrig.quantity import DurationS

from .board import Board
from .settings import BoardSettings, Command, Exchange


class SerialFilterWheel:
    """A filter wheel of a board whose commands are in the rig file.

    Parameters
    ----------
    address
        Serial port of the board.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(BoardSettings):
        """Keys of a filter wheel of any board on a serial line in a rig file.

        Attributes
        ----------
        filters
            Command that turns to each filter, with the answer that confirms that it is in place, by
            the filter's name: `{bandpass-450: {send: turn 2, answer: done}}`.
        open
            The same for the place without a filter.
        turn
            Time of a turn, for example `3 s`. It is waited for where a command has no answer.
        """

        filters: Mapping[str, Command] = Field(min_length=1)
        open: Command
        turn: Annotated[DurationS, Field(ge=0, le=60)] = 3.0

        @field_validator("filters")
        @classmethod
        def _different(cls, filters: Mapping[str, Exchange]) -> Mapping[str, Exchange]:
            if len({exchange.send for exchange in filters.values()}) < len(filters):
                raise ValueError("expected a command of its own for every filter")
            return filters

    @classmethod
    def declared_filters(cls, settings: Settings) -> Sequence[str]:
        """Return the filters that the rig file names."""
        return tuple(settings.filters)

    @classmethod
    def declared_turn_s(cls, settings: Settings) -> float:
        """Return the time of a turn in seconds, from the rig file."""
        return settings.turn

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._clock = connections.clock
        self._board = Board(address, settings, connections)

    def identity(self) -> str:
        """Return the board's answer to its identity query, or its address."""
        return f"filter wheel, {self._board.identity()}"

    def filters(self) -> tuple[str, ...]:
        """Return the names of the filters in the wheel."""
        return tuple(self._settings.filters)

    def put(self, name: str | None) -> None:
        """Turn to a filter or to the open place.

        Return when the board confirms it, or when the time of a turn is over.

        Raises
        ------
        UnclearAnswerError
            The board gives another answer, or none.
        """
        exchange = self._settings.open if name is None else self._settings.filters[name]
        self._board.do(exchange)
        if exchange.answer is None:
            self._clock.sleep(self._settings.turn)

    def heartbeat(self) -> None:
        """Restart the board's watchdog, if the rig file says how."""
        self._board.keep_alive()

    def make_safe(self) -> None:
        """Resynchronise the line, then turn to the open place."""
        self._board.resynchronise([self._settings.open])
        self.put(None)

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
