"""A relay board that answers every line with an echo and `>`.

Replace what the board is told and what it answers. A board that only reads and answers lines needs
no Python: see the driver `serial_relay` in labrig's guide "Use boards of your own".
"""

from pydantic import Field

from labrig.acquire import Board, Connections, Switch
from labrig.drivers import SerialLine
from labrig.foundation.models import FrozenModel

BAUDRATE = 19200
ANSWER_S = 1.0


class Relay(Switch):
    """One relay. `Switch` switches it by `command` and reads it back by `is_on`.

    Other kinds of channels are `Servo`, `Positions` and `TemperatureSensor` in `labrig.acquire`.
    """

    class Settings(FrozenModel):
        """Keys of a relay in a rig file; editors show what stands here.

        Attributes
        ----------
        relay
            Number of the relay on the board, 0 to 9.
        """

        relay: int = Field(ge=0, le=9)

    noun = "relay"
    board: "MyRelay"
    settings: Settings

    def place(self) -> str:
        """Return the number of the relay, for messages, journal and report."""
        return f"relay {self.settings.relay}"

    def command(self, *, on: bool) -> None:
        """Switch; return when the board confirms it."""
        self.board.ask(f"relay {'on' if on else 'off'} {self.settings.relay}")

    def is_on(self) -> bool:
        """Return the state that the board reports. A board that cannot needs `reads_back`, too."""
        return self.board.ask(f"relay read {self.settings.relay}") == "on"


class MyRelay(Board):
    """The board. Roles of a rig file take its channels: a lamp one switch, `leds` several."""

    channels = (Relay,)

    def __init__(self, address: str, settings: Board.Settings, connections: Connections) -> None:
        self.name = f"the board at {address}"
        # The port is opened through `connections`, so that it may be a simulated one. Time comes
        # from `connections.clock`, never from Python's `time`.
        self._line = SerialLine(connections.serial(address, BAUDRATE), connections.clock, self.name)

    def identity(self) -> str:
        """Return one line for journal and report: maker, model, serial number, firmware."""
        return "my_relay"

    def resynchronise(self) -> None:
        """End a command that was cut off anywhere, and discard what is still on its way.

        It is called before channels are made safe: after every error, at the end, and by the guard
        if labrig was killed.
        """
        self._line.write(b"\r")
        self._line.drain()

    def ask(self, command: str) -> str:
        """Return the board's answer to a command, without the echo of the command."""
        self._line.write(command.encode("ascii") + b"\r")
        received = self._line.read_until(b">", ANSWER_S)
        echo, *lines = received.decode("ascii", errors="replace").removesuffix(">").split()
        del echo
        return lines[-1] if lines else ""
