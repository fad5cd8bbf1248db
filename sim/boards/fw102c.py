r"""A Thorlabs FW102C as its serial line shows it, echo, answer and prompt, and its wheel."""

from collections.abc import Callable

from labrig.foundation.clock import VirtualClock

SLOTS = 6
LINE_LENGTH = 64
#: Time of a turn by one slot in seconds: half a turn takes 2.9 s.
SLOT_S = 0.97
PROMPT = "\r> "


class Fw102cBoard:
    r"""Wheel that obeys `pos=` and answers `*idn? pos? pcount?`; a line ends with `\r`.

    Parameters
    ----------
    turned
        Called with the slot, from 1 on, as soon as the wheel has it in the light.
    clock
        The room's clock.
    """

    def __init__(self, turned: Callable[[int], None], clock: VirtualClock) -> None:
        self._turned = turned
        self._clock = clock
        self._slot, self._there_s = 1, 0.0
        self._last = 1
        self._line = b""

    @property
    def slot(self) -> int:
        """Slot that is in the light; the last one until the wheel has turned."""
        return self._slot if self._clock.now() >= self._there_s else self._last

    def receive(self, data: bytes) -> bytes:
        """Return the wheel's answers to these bytes, in order."""
        answer = ""
        for byte in data:
            if byte == ord("\r"):
                line, self._line = self._line.decode("ascii", "replace"), b""
                answer += line + self._answer(line.strip().lower()) + PROMPT
            elif len(self._line) < LINE_LENGTH:
                self._line += bytes((byte,))
        return answer.encode("ascii", "replace")

    def _answer(self, line: str) -> str:
        if line == "*idn?":
            return "\rTHORLABS FW102C/FW212C Filter Wheel version 1.07"
        if line == "pcount?":
            return f"\r{SLOTS}"
        if line == "pos?":
            return f"\r{self.slot}"
        if line.startswith("pos="):
            return self._turn(line.removeprefix("pos="))
        return "\rCommand error CMD_NOT_DEFINED"

    def _turn(self, number: str) -> str:
        if not (number.isascii() and number.isdecimal() and 1 <= int(number) <= SLOTS):
            return "\rCommand error CMD_ARG_INVALID"
        self._last = self.slot
        self._slot = int(number)
        away = abs(self._slot - self._last)
        self._there_s = self._clock.now() + SLOT_S * min(away, SLOTS - away)
        self._turned(self._slot)
        return ""
