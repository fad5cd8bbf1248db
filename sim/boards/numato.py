"""A Numato relay board as its serial line shows it: echo, value, prompt."""

from collections.abc import Callable, Mapping

CHANNELS = "0123456789ABCDEFGHIJKLMNOPQRSTUV"
#: The converter's largest number, and its voltage: the supply from the USB port.
FULL, SUPPLY_V = 1023, 5.0
#: Analogue inputs; one with nothing on it floats up.
INPUTS = 4


class NumatoBoard:
    """Board with `relay on|off|read N`, `relay readall|writeall`, `adc read N`, `ver`, `id get`.

    Parameters
    ----------
    relays
        Number of relays.
    on_change
        Function that is called with (relay, on) whenever a contact moves.
    volts
        Function that returns the present voltage, by analogue input; all others are open.
    """

    def __init__(
        self,
        relays: int,
        on_change: Callable[[int, bool], None],
        volts: Mapping[int, Callable[[], float]] | None = None,
    ) -> None:
        self.states = [False] * relays
        self._on_change = on_change
        self._volts = dict(volts or {})
        self._typed = ""

    def receive(self, data: bytes) -> bytes:
        """Return the board's answers to these bytes, in order."""
        answer = ""
        for character in data.decode("ascii", errors="replace"):
            if character == "\r":
                result = self._obey(self._typed)
                answer += "\n\r" + (f"{result}\n\r" if result else "") + ">"
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
            case ["adc", "read", channel] if len(channel) == 1 and channel in CHANNELS[:INPUTS]:
                return f"{self._converted(CHANNELS.index(channel)):04d}"
        return ""

    def _converted(self, number: int) -> int:
        volts = self._volts[number]() if number in self._volts else SUPPLY_V
        return min(max(round(volts / SUPPLY_V * FULL), 0), FULL)

    def _relay(self, channel: str) -> int | None:
        relay = CHANNELS.find(channel) if len(channel) == 1 else -1
        return relay if 0 <= relay < len(self.states) else None

    def _set(self, relay: int, on: bool) -> None:
        if self.states[relay] != on:
            self.states[relay] = on
            self._on_change(relay, on)
