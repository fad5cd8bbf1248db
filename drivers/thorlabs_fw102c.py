r"""Thorlabs FW102C and FW212C filter wheels: lines of text that the wheel echoes.

`pos?\r` is answered by the echo, `3\r` and the prompt `> `; a command by its echo and the prompt;
one that it does not understand by `Command error CMD_NOT_DEFINED`. Sources: Thorlabs' manual of the
FW102C and public drivers, those of Micro-Manager and of matusm (Bev.Instruments.Thorlabs.FW), where
half a turn took 2.9 s. Whether the prompt waits for the wheel they do not say, so that the position
is read until it is the one that was asked for.
"""

from typing import Annotated

from pydantic import Field

from labrig.acquire import Board, Connections, Positions
from labrig.foundation.errors import DeviceError, UnclearAnswerError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from .serial_line import SerialLine

BAUDRATE = 115_200
PROMPT = b"> "
MODELS = ("FW102C", "FW212C")
MAX_SLOTS = 12
#: Pause between two readings of the position.
LOOK_AGAIN_S = 0.1


class Fw102cSlots(Positions):
    """The slots of a wheel, as printed on it."""

    class Settings(FrozenModel):
        """Keys of a Thorlabs filter wheel.

        Attributes
        ----------
        travel
            Time within which the wheel must have turned, for example `10 s`.
        """

        travel: Annotated[DurationS, Field(gt=0, le=60)] = 10.0

    Position = Annotated[int, Field(ge=1, le=MAX_SLOTS)]
    empty = 1
    noun = "slot"
    board: "ThorlabsFw102c"
    settings: Settings

    def place(self) -> str:
        """Return nothing: a wheel has a port of its own."""
        return ""

    def require_possible(self, position: int) -> None:
        """Refuse a slot that this wheel does not have.

        Raises
        ------
        DeviceError
            It has not.
        """
        if position > self.board.slots:
            raise DeviceError(
                f"{self.board.name} has {self.board.slots} slots, the rig file names slot "
                f"{position}; correct it"
            )

    def bring(self, position: int) -> None:
        """Turn to a slot; return when the wheel says that it is there.

        Raises
        ------
        UnclearAnswerError
            The wheel does not get there, or gives another answer.
        """
        board, slot = self.board, position
        if board.number("pos?") == slot:
            return
        if answer := board.ask(f"pos={slot}"):
            raise UnclearAnswerError(
                f"{board.name} was sent to slot {slot}: expected no answer, got '{answer}'"
            )
        deadline_s = board.clock.now() + self.settings.travel
        while (reached := board.number("pos?")) != slot:
            if board.clock.now() >= deadline_s:
                raise UnclearAnswerError(
                    f"{board.name} was sent to slot {slot} and says that it is at {reached}; look "
                    "whether it turns freely"
                )
            board.clock.sleep(LOOK_AGAIN_S)

    def make_safe(self, position: int) -> None:
        """End a half-written line and discard old answers; a turning wheel ends its turn."""
        self.board.resynchronise()
        self.board.number("pos?")


class ThorlabsFw102c(Board):
    """A filter wheel of Thorlabs on its USB serial port.

    Parameters
    ----------
    address
        Serial port of the wheel.
    settings
        Keys of the rig file, those of its slots among them.
    connections
        Connections that open the port.

    Raises
    ------
    DeviceError
        Another device is at the address.
    """

    channels = (Fw102cSlots,)

    def __init__(
        self, address: str, settings: Fw102cSlots.Settings, connections: Connections
    ) -> None:
        self._answers_within_s = settings.travel
        self.clock = connections.clock
        self.name = f"the filter wheel at {address}"
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, self.clock, self.name)
        self.resynchronise()
        self._model = self.ask("*idn?")
        if not any(model in self._model for model in MODELS):
            raise DeviceError(
                f"{self.name} was asked for its name: expected {' or '.join(MODELS)}, got "
                f"'{self._model}'; check the address"
            )
        self.slots = self.number("pcount?")

    def identity(self) -> str:
        """Return model and firmware of the wheel."""
        return " ".join(self._model.split())

    def resynchronise(self) -> None:
        """End a half-written line and discard old answers."""
        self._line.write(b"\r")
        self._line.drain()

    def ask(self, command: str) -> str:
        """Send a command and return what stands between its echo and the prompt.

        Raises
        ------
        UnclearAnswerError
            The wheel does not understand, echoes something else or does not answer.
        """
        self._line.discard()
        self._line.write(command.encode() + b"\r")
        received = self._line.read_until(PROMPT, self._answers_within_s)
        echo, *answer = received.removesuffix(PROMPT).decode("ascii", "replace").split("\r")
        text = " ".join(" ".join(answer).split())
        if echo.strip() != command or "error" in text.lower():
            raise UnclearAnswerError(
                f"{self.name} was sent '{command}': expected its echo and an answer, got "
                f"{received!r}"
            )
        return text

    def number(self, query: str) -> int:
        """Send a query and return the number that the wheel answers."""
        answer = self.ask(query)
        if not answer.isdecimal():
            raise UnclearAnswerError(
                f"{self.name} was asked '{query}': expected a number, got '{answer}'"
            )
        return int(answer)
