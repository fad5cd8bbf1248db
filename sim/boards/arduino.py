"""An Arduino with relays, programmed with the sketch of the guide "Use boards of your own"."""

import math
from collections.abc import Callable

from labrig.foundation.clock import Clock

VERSION = "labrig relays 1"
#: Characters of a line that are kept; a longer one is no command.
LINE_LENGTH = 31


class ArduinoBoard:
    r"""Board that obeys `on N`, `off N`, `state N`, `version` and `alive`, one command a line.

    Answers end with `\r\n`. After some silence all relays go off; this is noticed when the next
    byte comes, and until a relay is switched off `alive` is answered `expired`.

    Parameters
    ----------
    relays
        Number of relays.
    on_change
        Function that is called with (relay, on) whenever a contact moves.
    clock
        Clock of the watchdog.
    silence_s
        Silence of the PC in seconds after which all relays go off; None: never.
    """

    def __init__(
        self,
        relays: int,
        on_change: Callable[[int, bool], None],
        clock: Clock,
        silence_s: float | None = 180.0,
    ) -> None:
        self.states = [False] * relays
        self._on_change = on_change
        self._clock = clock
        self._silence_s = math.inf if silence_s is None else silence_s
        self._received_s = clock.now()
        self._has_expired = False
        self._line = b""

    def receive(self, data: bytes) -> bytes:
        """Return the board's answers to these bytes, in order."""
        if data:
            self._watch()
        answers = []
        for byte in data:
            if byte == ord("\n"):
                line, self._line = self._line, b""
                if line:
                    answers.append(self._obey(line))
            elif byte >= ord(" ") and len(self._line) <= LINE_LENGTH:
                self._line += bytes((byte,))
        return "".join(f"{answer}\r\n" for answer in answers).encode("ascii")

    def _watch(self) -> None:
        now_s = self._clock.now()
        if now_s - self._received_s > self._silence_s:
            self._has_expired = self._has_expired or any(self.states)
            for relay in range(len(self.states)):
                self._switch(relay, on=False)
        self._received_s = now_s

    def _obey(self, line: bytes) -> str:
        if len(line) > LINE_LENGTH:
            return "error"
        if line == b"version":
            return VERSION
        if line == b"alive":
            return "expired" if self._has_expired else "ok"
        command, space, number = line.partition(b" ")
        relay = number[0] - ord("0") if space and len(number) == 1 else -1
        if not 0 <= relay < len(self.states):
            return "error"
        match command:
            case b"on" | b"off":
                self._has_expired = self._has_expired and command == b"on"
                self._switch(relay, on=command == b"on")
                return "ok"
            case b"state":
                return "on" if self.states[relay] else "off"
        return "error"

    def _switch(self, relay: int, *, on: bool) -> None:
        if self.states[relay] != on:
            self.states[relay] = on
            self._on_change(relay, on)
