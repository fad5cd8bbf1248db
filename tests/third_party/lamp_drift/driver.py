"""Driver of a relay board that understands `relay on N` and `relay off N`, one line a command."""

from pydantic import Field

from labrig.acquire import Connections
from labrig.drivers import SerialLine
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.models import FrozenModel

BAUDRATE = 19200
ANSWER_S = 1.0


class PlainRelay:
    """One relay of the board, switching a lamp."""

    class Settings(FrozenModel):
        """Keys of the device in a rig file.

        Attributes
        ----------
        relay
            Number of the relay on the board, 0 to 9.
        """

        relay: int = Field(ge=0, le=9)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relay = settings.relay
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, connections.clock, f"the plain relay at {address}")
        self._line.write(b"\r")
        self._line.drain()

    def identity(self) -> str:
        """Return the name of the board for journal and report."""
        return f"plain relay {self._relay}"

    def reads_back(self) -> bool:
        """Return whether the board can be asked for the state of its relay."""
        return True

    def on(self) -> None:
        """Switch the lamp on; returns when the board confirms it."""
        self._switch("on")

    def off(self) -> None:
        """Switch the lamp off; returns when the board confirms it."""
        self._switch("off")

    def is_on(self) -> bool:
        """Return the state of the relay that the board reports."""
        return "on" in self._ask(f"relay read {self._relay}").splitlines()

    def make_safe(self) -> None:
        """Switch the lamp off, whatever was interrupted on the line before."""
        self._line.write(b"\r")
        self._line.drain()
        self.off()

    def disconnect(self) -> None:
        """Do nothing: `connections` closes the port."""

    def _switch(self, state: str) -> None:
        self._ask(f"relay {state} {self._relay}")
        if self.is_on() != (state == "on"):
            raise UnclearAnswerError(f"relay {self._relay} was switched {state} and is not")

    def _ask(self, command: str) -> str:
        self._line.write(command.encode() + b"\r")
        return self._line.read_until(b">", ANSWER_S).decode().replace("\r", "\n")
