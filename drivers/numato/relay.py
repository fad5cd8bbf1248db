"""A relay of a Numato board that switches a lamp."""

from pydantic import Field

from labrig.acquire import Connections
from labrig.foundation.models import FrozenModel

from .board import CHANNELS, Board


class NumatoRelay:
    """One relay of a Numato board, switching a lamp.

    Parameters
    ----------
    address
        Serial port of the board; several relays may share it.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(FrozenModel):
        """Keys of a relay of a Numato board in a rig file.

        Attributes
        ----------
        relay
            Number of the relay that switches the lamp, counted from 0.
        """

        relay: int = Field(ge=0, lt=len(CHANNELS))

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relay = settings.relay
        self._board = Board(address, connections)

    def reads_back(self) -> bool:
        """Return True: every Numato board reports the states of its relays."""
        return True

    def identity(self) -> str:
        """Return maker, firmware version and id of the board, and the relay."""
        return f"Numato relay board, {self._board.identity()}, relay {self._relay}"

    def on(self) -> None:
        """Switch the relay on and read it back."""
        self._board.switch(self._relay, on=True)

    def off(self) -> None:
        """Switch the relay off and read it back."""
        self._board.switch(self._relay, on=False)

    def is_on(self) -> bool:
        """Return the relay's state in the board's register."""
        return self._board.is_on(self._relay)

    def make_safe(self) -> None:
        """Resynchronise the line, then switch off."""
        self._board.resynchronise()
        self.off()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
