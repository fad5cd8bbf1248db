"""A relay of any board on a serial line that switches a lamp."""

from collections.abc import Sequence

from labrig.acquire import Connections, Finding

from .board import Board, Relay, findings
from .settings import BoardSettings, SwitchCommands


class SerialRelay:
    """One relay of a board whose commands are in the rig file, switching a lamp.

    Parameters
    ----------
    address
        Serial port of the board; several relays may share it.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(SwitchCommands, BoardSettings):
        """Keys of a relay of any board on a serial line in a rig file."""

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._board = Board(address, settings, connections)
        self._relay = Relay(self._board, settings, "the lamp's relay")

    def reads_back(self) -> bool:
        """Return whether the rig file has a query for the relay's state."""
        return self._relay.reads_back

    def identity(self) -> str:
        """Return the board's answer to its identity query, or its address."""
        return f"serial relay, {self._board.identity()}"

    def findings(self) -> Sequence[Finding]:
        """Return whether anything but the camera can verify that the lamp was switched."""
        return findings([self._relay])

    def on(self) -> None:
        """Switch the relay on, and read it back where the board can."""
        self._relay.switch(on=True)

    def off(self) -> None:
        """Switch the relay off, and read it back where the board can."""
        self._relay.switch(on=False)

    def is_on(self) -> bool:
        """Return the state that the board reports, else the one commanded last."""
        return self._relay.is_on()

    def heartbeat(self) -> None:
        """Restart the board's watchdog, if the rig file says how."""
        self._board.keep_alive()

    def make_safe(self) -> None:
        """Resynchronise the line, then switch off."""
        self._board.resynchronise([self._relay.off])
        self._relay.switch(on=False)

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
