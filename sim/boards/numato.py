"""A Numato relay board as its serial line shows it: echo, value, prompt."""

from collections.abc import Callable

CHANNELS = "0123456789ABCDEFGHIJKLMNOPQRSTUV"


class NumatoBoard:
    """Understands `relay on|off|read N`, `relay readall|writeall`, `ver` and `id get`.

    Parameters
    ----------
    relays
        Number of relays.
    on_change
        Called with (relay, on) whenever a contact moves.
    """

    def __init__(self, relays: int, on_change: Callable[[int, bool], None]) -> None:
        self.states = [False] * relays
        self._on_change = on_change
        self._typed = ""

    def receive(self, data: bytes) -> bytes:
        """What the board sends back, in order, for these bytes."""
        answer = ""
        for character in data.decode("ascii", errors="replace"):
            if character == "\r":
                said = self._obey(self._typed)
                answer += "\n\r" + (f"{said}\n\r" if said else "") + ">"
                self._typed = ""
            else:
                self._typed += character
                answer += character
        return answer.encode("ascii", errors="replace")

    def _obey(self, command: str) -> str:
        match command.split():
            case ["ver"]:
                return "00000008"
            case ["id", "get"]:
                return "00000000"
            case ["relay", "readall"]:
                mask = sum(1 << relay for relay, on in enumerate(self.states) if on)
                return f"{mask:0{max(len(self.states) // 4, 2)}X}"
            case ["relay", "read", channel] if (relay := self._relay(channel)) is not None:
                return "on" if self.states[relay] else "off"
            case ["relay", ("on" | "off") as state, channel] if (
                relay := self._relay(channel)
            ) is not None:
                self._set(relay, state == "on")
        return ""

    def _relay(self, channel: str) -> int | None:
        relay = CHANNELS.find(channel) if len(channel) == 1 else -1
        return relay if 0 <= relay < len(self.states) else None

    def _set(self, relay: int, on: bool) -> None:
        if self.states[relay] != on:
            self.states[relay] = on
            self._on_change(relay, on)
