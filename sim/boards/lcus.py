"""An LCUS relay board: four bytes a command, no acknowledgement, and perhaps an answer to FF."""

from collections.abc import Callable
from typing import Literal

#: Answer of a board to the query FF: nothing, lines of text, or a byte for each relay.
Answers = Literal["nothing", "text", "bytes"]

START, QUERY = 0xA0, 0xFF
COMMAND_BYTES = 4


class LcusBoard:
    """Board that obeys `A0 relay op sum`, relays counted from 1, and the query FF.

    Parameters
    ----------
    relays
        Number of relays.
    on_change
        Function that is called with (relay, on) whenever a contact moves; the first relay is 1.
    answers
        Form of the answer to the query. The first answer after a change has the states before it.
    """

    def __init__(
        self, relays: int, on_change: Callable[[int, bool], None], answers: Answers = "nothing"
    ) -> None:
        self.states = [False] * relays
        self._on_change = on_change
        self._answers = answers
        self._command = b""
        self._reported = tuple(self.states)

    def receive(self, data: bytes) -> bytes:
        """Return the board's answers to these bytes, in order."""
        answer = b""
        for byte in data:
            if self._command or byte == START:
                self._command += bytes((byte,))
                if len(self._command) == COMMAND_BYTES:
                    self._obey(self._command)
                    self._command = b""
            elif byte == QUERY:
                answer += self._answer()
        return answer

    def _obey(self, command: bytes) -> None:
        relay, operation, checksum = command[1:]
        is_valid = 1 <= relay <= len(self.states) and operation in (0, 1)
        if is_valid and sum(command[:3]) & 0xFF == checksum:
            on = operation == 1
            if self.states[relay - 1] != on:
                self.states[relay - 1] = on
                self._on_change(relay, on)

    def _answer(self) -> bytes:
        states, self._reported = self._reported, tuple(self.states)
        match self._answers:
            case "nothing":
                return b""
            case "bytes":
                return bytes(states)
            case "text":
                return "".join(
                    f"CH{relay}: {'ON ' if on else 'OFF'}\r\n"
                    for relay, on in enumerate(states, start=1)
                ).encode("ascii")
