"""A relay board that understands `relay on N` and `relay off N`, one line a command."""

from pydantic import BaseModel, ConfigDict, Field

from labrig.acquire import Connections
from labrig.drivers import SerialLine
from labrig.errors import UnclearAnswerError

BAUDRATE = 19200
ANSWER_S = 1.0


class PlainRelay:
    """One relay of the board, switching a lamp."""

    class Settings(BaseModel):
        """Keys of the rig file."""

        model_config = ConfigDict(frozen=True, extra="forbid")

        relay: int = Field(ge=0, le=9)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relay = settings.relay
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, connections.clock, f"the plain relay at {address}")
        self._line.write(b"\r")
        self._line.drain()

    def identity(self) -> str:
        """What the board is."""
        return f"plain relay {self._relay}"

    def reads_back(self) -> bool:
        """It does."""
        return True

    def on(self) -> None:
        """Switch on, read back."""
        self._switch("on")

    def off(self) -> None:
        """Switch off, read back."""
        self._switch("off")

    def is_on(self) -> bool:
        """What the board says."""
        return "on" in self._ask(f"relay read {self._relay}").splitlines()

    def make_safe(self) -> None:
        """Off."""
        self._line.write(b"\r")
        self._line.drain()
        self.off()

    def disconnect(self) -> None:
        """The port belongs to the connections."""

    def _switch(self, state: str) -> None:
        self._ask(f"relay {state} {self._relay}")
        if self.is_on() != (state == "on"):
            raise UnclearAnswerError(f"relay {self._relay} was switched {state} and is not")

    def _ask(self, command: str) -> str:
        self._line.write(command.encode() + b"\r")
        return self._line.read_until(b">", ANSWER_S).decode().replace("\r", "\n")
