r"""An Oriel Cornerstone 260 as its serial line shows it, with its echo, and its turning grating."""

from collections.abc import Callable

from labrig.foundation.clock import VirtualClock

LINE_LENGTH = 64
#: Speed of its wavelength, and limits of its grating, in nm.
NM_PER_S, LOWEST_NM, HIGHEST_NM = 175.0, 0.0, 1400.0
#: Step of the grating in nm.
STEP_NM = 0.16


class CornerstoneBoard:
    r"""Instrument that obeys `GOWAVE`, `SHUTTER O`, `SHUTTER C` and answers `WAVE? SHUTTER? INFO?`.

    Lines end with `\n` or `\r\n`. It echoes every line. What it does not understand has no answer.

    Parameters
    ----------
    tuned
        Called with the wavelength in nm and whether the shutter is open, after each change.
    clock
        The room's clock.
    """

    def __init__(self, tuned: Callable[[float, bool], None], clock: VirtualClock) -> None:
        self._tuned = tuned
        self._clock = clock
        self._from_nm, self._to_nm, self._since_s = 0.0, 0.0, 0.0
        self._is_open = False
        self._line = b""

    def receive(self, data: bytes) -> bytes:
        """Return the instrument's answers to these bytes, in order."""
        answer = ""
        for byte in data:
            if byte == ord("\n"):
                line, self._line = self._line.decode("ascii", "replace").strip(), b""
                if line:
                    answer += f"{line}\r\n{self._answer(line.upper())}"
            elif len(self._line) < LINE_LENGTH:
                self._line += bytes((byte,))
        return answer.encode("ascii", "replace")

    @property
    def wavelength_nm(self) -> float:
        """Wavelength at which the grating is now."""
        gone_nm = NM_PER_S * (self._clock.now() - self._since_s)
        way_nm = self._to_nm - self._from_nm
        if gone_nm >= abs(way_nm):
            return self._to_nm
        return self._from_nm + (gone_nm if way_nm > 0 else -gone_nm)

    def _answer(self, line: str) -> str:
        command, _, number = line.partition(" ")
        if command == "GOWAVE":
            self._go(number)
            return ""
        if line in ("SHUTTER O", "SHUTTER C"):
            self._is_open = line.endswith("O")
            self._tuned(self._to_nm, self._is_open)
            return ""
        answers = {
            "WAVE?": f"{self.wavelength_nm:.3f}",
            "SHUTTER?": "O" if self._is_open else "C",
            "INFO?": "Oriel Instruments,Cornerstone 260,Serial 0123,Version 01.50",
        }
        return f"{answers[line]}\r\n" if line in answers else ""

    def _go(self, number: str) -> None:
        try:
            nm = float(number)
        except ValueError:
            return
        if LOWEST_NM <= nm <= HIGHEST_NM:
            self._from_nm, self._since_s = self.wavelength_nm, self._clock.now()
            self._to_nm = STEP_NM * round(nm / STEP_NM)
            self._tuned(self._to_nm, self._is_open)
