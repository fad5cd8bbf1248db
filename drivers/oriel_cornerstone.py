r"""Oriel (Newport) Cornerstone 130 and 260 monochromators on RS-232.

`GOWAVE 450.000\r\n` has no answer, queries such as `WAVE?` one line; with its echo on, the
instrument repeats every command before. Sources: Newport's manual of the Cornerstone 260 and the
public drivers of bicarlsen (oriel-cornerstone-260) and fsc2. The wavelength is read back.
"""

from labrig.acquire import Connections, MonochromatorBand
from labrig.foundation.errors import UnclearAnswerError

from .serial_line import SerialLine

BAUDRATE = 9600
LINE_END = b"\r\n"
ANSWER_TIMEOUT_S = 2.0
#: Difference in nm from the wavelength that was asked for: steps of the grating are finer.
THERE_NM = 0.2
LOOK_AGAIN_S = 0.2


class OrielCornerstone:
    """A Cornerstone monochromator; its filters and gratings are left as they are set.

    Parameters
    ----------
    address
        Serial port of the monochromator.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.

    Raises
    ------
    UnclearAnswerError
        The device does not answer its identity query.
    """

    class Settings(MonochromatorBand):
        """Keys of an Oriel Cornerstone in a rig file."""

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._clock = connections.clock
        self._name = f"the monochromator at {address}"
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, self._clock, self._name)
        self._resynchronise()
        self._model = self._ask("INFO?")

    def identity(self) -> str:
        """Return the instrument's answer to its identity query."""
        return self._model

    def limits_nm(self) -> tuple[float, float]:
        """Return the wavelengths in nm between which it can be tuned, from the rig file."""
        return self._settings.lowest, self._settings.highest

    def tune(self, wavelength_nm: float) -> None:
        """Go to a wavelength, open the shutter, and read both back.

        Raises
        ------
        UnclearAnswerError
            It does not get there, or gives another answer.
        """
        self._tell(f"GOWAVE {wavelength_nm:.3f}")
        deadline_s = self._clock.now() + self._settings.travel
        while abs((reached_nm := self._wavelength_nm()) - wavelength_nm) > THERE_NM:
            if self._clock.now() >= deadline_s:
                raise UnclearAnswerError(
                    f"{self._name} was sent to {wavelength_nm:g} nm and says that it is at "
                    f"{reached_nm:g} nm; check its grating's range, or raise 'travel'"
                )
            self._clock.sleep(LOOK_AGAIN_S)
        self._tell("SHUTTER O")
        if (state := self._ask("SHUTTER?")) != "O":
            raise UnclearAnswerError(
                f"{self._name} was commanded to open its shutter: expected 'O', got '{state}'"
            )

    def make_safe(self) -> None:
        """End a half-written line and discard old answers; it stays at its wavelength."""
        self._resynchronise()
        self._wavelength_nm()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""

    def _resynchronise(self) -> None:
        self._line.write(LINE_END)
        self._line.drain()

    def _tell(self, command: str) -> None:
        self._line.write(command.encode() + LINE_END)

    def _ask(self, query: str) -> str:
        """Send a query and return its answer: the next line that is no echo."""
        self._tell(query)
        while True:
            line = self._line.read_until(b"\n", self._settings.travel + ANSWER_TIMEOUT_S)
            text = line.decode("ascii", "replace").strip()
            if text and text != query and not text.startswith(("GOWAVE", "SHUTTER ")):
                return text

    def _wavelength_nm(self) -> float:
        answer = self._ask("WAVE?")
        try:
            return float(answer)
        except ValueError:
            raise UnclearAnswerError(
                f"{self._name} was asked 'WAVE?': expected a number, got '{answer}'"
            ) from None
