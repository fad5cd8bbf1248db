"""A relay that switches a lamp, on a board that answers every line with an echo and `>`.

Replace what the board is told and what it answers. A board that only reads and answers lines needs
no Python: see the driver `serial_relay` in labrig's guide "Use boards of your own".
"""

from pydantic import Field

from labrig.acquire import Connections
from labrig.drivers import SerialLine
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.models import FrozenModel

BAUDRATE = 19200
ANSWER_S = 1.0


class MyRelay:
    """One relay, switching a lamp: the methods are those of the role `Lamp` in `labrig.acquire`.

    Other roles are LedBank, Door, Shield, Camera, Thermometer and Changer.
    """

    class Settings(FrozenModel):
        """Keys of the device in a rig file; editors show what stands here.

        Attributes
        ----------
        relay
            Number of the relay on the board, 0 to 9.
        """

        relay: int = Field(ge=0, le=9)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._relay = settings.relay
        # The port is opened through `connections`, so that it may be a simulated one. Time comes
        # from `connections.clock`, never from Python's `time`.
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, connections.clock, f"the board at {address}")

    def identity(self) -> str:
        """Return one line for journal and report: maker, model, serial number, firmware."""
        return f"my_relay, relay {self._relay}"

    def reads_back(self) -> bool:
        """Return whether `is_on` asks the board; else it returns what was commanded last."""
        return True

    def on(self) -> None:
        """Switch the lamp on; return when the board confirms it."""
        self._switch("on")

    def off(self) -> None:
        """Switch the lamp off; return when the board confirms it."""
        self._switch("off")

    def is_on(self) -> bool:
        """Return the state that the board reports."""
        return self._ask(f"relay read {self._relay}") == "on"

    def make_safe(self) -> None:
        """Switch the lamp off, whatever was interrupted on the line before.

        It is called after every error, at the end, and by the guard if labrig was killed. A command
        may have been cut off anywhere: end it, and discard what is still on its way.
        """
        self._line.write(b"\r")
        self._line.drain()
        self.off()

    def disconnect(self) -> None:
        """Do nothing: `connections` closes the port."""

    def _switch(self, state: str) -> None:
        self._ask(f"relay {state} {self._relay}")
        if self.is_on() != (state == "on"):
            # An error that a second try may cure. `DeviceError` is one that it cannot.
            raise UnclearAnswerError(
                f"relay {self._relay} was switched {state} and does not read so; check the board"
            )

    def _ask(self, command: str) -> str:
        """Return the board's answer to a command, without the echo of the command."""
        self._line.write(command.encode("ascii") + b"\r")
        received = self._line.read_until(b">", ANSWER_S)
        echo, *lines = received.decode("ascii", errors="replace").removesuffix(">").split()
        del echo
        return lines[-1] if lines else ""
