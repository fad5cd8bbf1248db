"""A Thorlabs DC4100 as its serial line shows it: an answer to each query, none to a command."""

from collections.abc import Mapping
from typing import Protocol

OUTPUTS = 4
LINE_LENGTH = 64
#: Bits of the status word: no head on the first output, two bits on for each further one.
NO_HEAD = 0x20
#: Current of a head at full brightness, in mA.
LIMIT_MA = 1000


class Outputs(Protocol):
    """LEDs that the unit's outputs feed."""

    def switch(self, output: int, on: bool) -> None:
        """Let an output, counted from 0, have current or none."""

    def dim(self, output: int, fraction: float) -> None:
        """Change the light of an output, counted from 0, to a fraction of the full one."""


class Dc4100Board:
    r"""Unit that obeys `o`, `bp`, `m`, `sm`, `l` and answers `n? s? v? h? r? e? wl? o? bp? m? sm?`.

    Lines end with `\r\n`. A query that it does not understand is answered by an error; after a
    command, which has no answer, the error waits for `e?`. In the selection mode for single
    outputs, switching one on switches the others off.

    Parameters
    ----------
    outputs
        What the outputs feed.
    heads_nm
        Wavelength in nm of the LED heads by their output, counted from 0; no others are connected.
    serial_number
        Serial number of the unit.
    """

    def __init__(
        self, outputs: Outputs, heads_nm: Mapping[int, float], serial_number: str = "M00100001"
    ) -> None:
        self.states = [False] * OUTPUTS
        self.per_cent = [100.0] * OUTPUTS
        #: Further bits of the status word: faults of the unit and of its heads.
        self.faults = 0
        self._outputs = outputs
        self._heads_nm = dict(heads_nm)
        self._serial_number = serial_number
        self._mode, self._selection = 0, 0
        self._error = "0:No error"
        self._line = b""

    def receive(self, data: bytes) -> bytes:
        """Return the unit's answers to these bytes, in order."""
        answer = ""
        for byte in data:
            if byte == ord("\n"):
                line, self._line = self._line.strip(), b""
                if line:
                    answer += self._answer(line.decode("ascii", "replace").lower())
            elif len(self._line) < LINE_LENGTH:
                self._line += bytes((byte,))
        return answer.encode("ascii")

    @property
    def _status(self) -> int:
        missing = [number for number in range(OUTPUTS) if number not in self._heads_nm]
        return self.faults | sum(NO_HEAD << 2 * number for number in missing)

    def _answer(self, line: str) -> str:
        try:
            answer = self._obey(line.split())
        except (ValueError, IndexError):
            if "?" in line:
                return "ERROR 12:Invalid command\r\n"
            self._error = "12:Invalid command"
            return ""
        return "" if answer is None else f"{answer}\r\n"

    def _obey(self, words: list[str]) -> str | None:
        """Obey a command, or return the answer to a query.

        Raises
        ------
        ValueError, IndexError
            There is no such command, or no such output.
        """
        match words:
            case ["n?"]:
                return "DC4100"
            case ["s?"]:
                return self._serial_number
            case ["v?"]:
                return "1.5.0"
            case ["h?"]:
                return "Thorlabs GmbH"
            case ["r?"]:
                return str(self._status)
            case ["e?"]:
                error, self._error = self._error, "0:No error"
                return f"ERROR {error}"
            case ["m?"]:
                return str(self._mode)
            case ["sm?"]:
                return str(self._selection)
            case ["wl?", number]:
                return f"{self._heads_nm.get(_output(number), 0.0):.0f}"
            case ["o?", number]:
                return str(int(self.states[_output(number)]))
            case ["bp?", number]:
                return f"{self.per_cent[_output(number)]:.0f}"
            case ["ml?", number]:
                _output(number)
                return str(LIMIT_MA)
            case ["m", ("0" | "1" | "2") as mode]:
                self._mode = int(mode)
            case ["sm", ("0" | "1") as selection]:
                self._selection = int(selection)
            case ["o", number, ("0" | "1") as state]:
                self._switch(_output(number), state == "1")
            case ["bp", number, per_cent] if 0 <= float(per_cent) <= 100:
                self.per_cent[_output(number)] = float(per_cent)
                self._outputs.dim(_output(number), float(per_cent) / 100)
            case _:
                raise ValueError(words)
        return None

    def _switch(self, number: int, on: bool) -> None:
        if on and self._selection == 1:
            for other in range(OUTPUTS):
                if other != number:
                    self._set(other, False)
        self._set(number, on and number in self._heads_nm)

    def _set(self, number: int, on: bool) -> None:
        if self.states[number] != on:
            self.states[number] = on
            self._outputs.switch(number, on)


def _output(text: str) -> int:
    number = int(text)
    if not 0 <= number < OUTPUTS:
        raise ValueError(text)
    return number
