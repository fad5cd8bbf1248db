"""A filter wheel on any board on a serial line, by commands that are in the rig file."""

from collections.abc import Mapping

from pydantic import Field, field_validator

from labrig.acquire import Connections

from .places import BoardFilters, PlacesSettings, different
from .settings import Command, Exchange


class SerialFilterWheel(BoardFilters):
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

    class Settings(PlacesSettings):
        """Keys of a filter wheel of any board on a serial line in a rig file.

        Attributes
        ----------
        filters
            Command that turns to each filter, with the answer that confirms that it is in place, by
            the filter's name: `{bandpass-450: {send: turn 2, answer: done}}`.
        open
            The same for the place without a filter.
        """

        filters: Mapping[str, Command] = Field(min_length=1)
        open: Command

        @field_validator("filters")
        @classmethod
        def _different(cls, commands: Mapping[str, Exchange]) -> Mapping[str, Exchange]:
            return different(commands, "filter")

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(address, settings, connections, settings.filters, settings.open)
