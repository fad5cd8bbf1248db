"""The line to a Numato board: ASCII over USB CDC, every command echoed, ended by a `>` prompt.

Echo and prompt prove that the board understood. Source: Numato's documentation of the 16-channel
board and their public sample code.
"""

import re
from dataclasses import dataclass

from labrig.acquire import Connections
from labrig.foundation.errors import UnclearAnswerError

from ..serial_line import SerialLine

#: USB CDC ignores it; Numato's own samples use this one.
BAUDRATE = 19200
ANSWER_TIMEOUT_S = 1.0
#: Characters of relays and inputs in commands.
CHANNELS = "0123456789ABCDEFGHIJKLMNOPQRSTUV"


class Board:
    """A Numato board; its devices may share the port.

    Parameters
    ----------
    address
        Serial port of the board.
    connections
        Connections that open the port.
    """

    def __init__(self, address: str, connections: Connections) -> None:
        self.name = f"the Numato board at {address}"
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, connections.clock, self.name)
        self.resynchronise()

    def identity(self) -> str:
        """Return firmware version and id of the board."""
        version, board_id = self.ask("ver"), self.ask("id get")
        return f"firmware {version}, id {board_id}"

    def ask(self, command: str) -> str:
        """Return the board's answer to `command` between echo and prompt; mostly empty.

        Raises
        ------
        UnclearAnswerError
            The board does not answer in time, or does not echo.
        """
        self._line.write(command.encode("ascii") + b"\r")
        answer = self._line.read_until(b">", ANSWER_TIMEOUT_S)
        lines = re.split(r"[\r\n]+", answer.decode("ascii", errors="replace").removesuffix(">"))
        if lines[0] != command:
            raise UnclearAnswerError(
                f"{self.name} did not echo '{command}': got {answer!r}; is it a Numato board, and "
                "its cable well?"
            )
        return " ".join(line for line in lines[1:] if line)

    def switch(self, relay: int, *, on: bool) -> None:
        """Switch a relay, and read it back.

        Raises
        ------
        UnclearAnswerError
            The board refuses, or the relay does not read as it was switched.
        """
        state, channel = "on" if on else "off", CHANNELS[relay]
        answer = self.ask(f"relay {state} {channel}")
        if answer:
            raise UnclearAnswerError(
                f"{self.name} refused 'relay {state} {channel}': expected a bare prompt, got "
                f"'{answer}'; is relay {relay} on this board?"
            )
        if self.is_on(relay) != on:
            opposite = "off" if on else "on"
            raise UnclearAnswerError(
                f"relay {relay} of {self.name} was switched {state} but reads {opposite}; switch "
                "off by hand and check the board"
            )

    def is_on(self, relay: int) -> bool:
        """Return the state of a relay in the board's register."""
        state = self.ask(f"relay read {CHANNELS[relay]}")
        if state not in ("on", "off"):
            raise UnclearAnswerError(
                f"{self.name} was asked for relay {relay}: expected 'on' or 'off', got '{state}'"
            )
        return state == "on"

    def resynchronise(self) -> None:
        """End a half-typed command by a bare return, and discard the answer."""
        self._line.write(b"\r")
        self._line.drain()


@dataclass(frozen=True)
class BoardRelay:
    """One relay of a board.

    Attributes
    ----------
    board
        The board.
    number
        Number of the relay, counted from 0.
    """

    board: Board
    number: int

    def switch(self, *, on: bool) -> None:
        """Switch the relay, and read it back."""
        self.board.switch(self.number, on=on)

    def is_on(self) -> bool:
        """Return the state of the relay in the board's register."""
        return self.board.is_on(self.number)
