"""Driver of a relay board that understands `relay on N` and `relay off N`, one line a command."""

from pydantic import Field

from labrig.acquire import Board, Connections, Switch
from labrig.drivers import SerialLine
from labrig.foundation.models import FrozenModel

BAUDRATE = 19200
ANSWER_S = 1.0


class PlainRelay(Switch):
    """One relay of the board."""

    class Settings(FrozenModel):
        """Keys of a relay in a rig file.

        Attributes
        ----------
        relay
            Number of the relay on the board, 0 to 9.
        """

        relay: int = Field(ge=0, le=9)

    def place(self) -> str:
        """Return the number of the relay."""
        return f"relay {self.settings.relay}"

    def command(self, *, on: bool) -> None:
        """Switch; return when the board confirms it."""
        self.board.ask(f"relay {'on' if on else 'off'} {self.settings.relay}")

    def is_on(self) -> bool:
        """Return the state of the relay that the board reports."""
        return "on" in self.board.ask(f"relay read {self.settings.relay}").splitlines()


class PlainBoard(Board):
    """The board; a lamp, LEDs or any other lights may be on its relays."""

    channels = (PlainRelay,)

    def __init__(self, address: str, settings: Board.Settings, connections: Connections) -> None:
        self.name = f"the plain board at {address}"
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, connections.clock, self.name)

    def identity(self) -> str:
        """Return the name of the board for journal and report."""
        return "plain board"

    def resynchronise(self) -> None:
        """End a command that was cut off, and discard its answer."""
        self._line.write(b"\r")
        self._line.drain()

    def ask(self, command: str) -> str:
        """Send a command and return its answer."""
        self._line.write(command.encode() + b"\r")
        return self._line.read_until(b">", ANSWER_S).decode().replace("\r", "\n")
