"""A relay of a Numato board; it is read back after every write."""

from pydantic import BaseModel, ConfigDict, Field

from labrig.acquire.connections import Connections
from labrig.errors import UnclearAnswerError

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
        Opens the port.
    """

    class Settings(BaseModel):
        """Keys of the rig file."""

        model_config = ConfigDict(frozen=True, extra="forbid")

        relay: int = Field(ge=0, lt=len(CHANNELS))

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._channel = CHANNELS[settings.relay]
        self._relay = settings.relay
        self._board = Board(address, connections)

    def reads_back(self) -> bool:
        """Every Numato board tells the states of its relays."""
        return True

    def identity(self) -> str:
        """Maker, firmware version and id, as the board says."""
        return f"Numato relay board, {self._board.identity()}, relay {self._relay}"

    def on(self) -> None:
        """Switch on, read back."""
        self._switch("on")

    def off(self) -> None:
        """Switch off, read back."""
        self._switch("off")

    def is_on(self) -> bool:
        """State as the board reads it."""
        return self._read() == "on"

    def make_safe(self) -> None:
        """Bring the line back into step, then off."""
        self._board.resynchronise()
        self.off()

    def disconnect(self) -> None:
        """The port belongs to the connections, which close it."""

    def _switch(self, state: str) -> None:
        said = self._board.ask(f"relay {state} {self._channel}")
        if said:
            raise UnclearAnswerError(
                f"{self._board.name} refused 'relay {state} {self._channel}': expected a bare "
                f"prompt, got '{said}'; is relay {self._relay} on this board?"
            )
        read = self._read()
        if read != state:
            raise UnclearAnswerError(
                f"relay {self._relay} of {self._board.name} was switched {state} but reads {read}; "
                "switch off by hand and check the board"
            )

    def _read(self) -> str:
        state = self._board.ask(f"relay read {self._channel}")
        if state not in ("on", "off"):
            raise UnclearAnswerError(
                f"{self._board.name} was asked for relay {self._relay}: expected 'on' or 'off', "
                f"got '{state}'"
            )
        return state
