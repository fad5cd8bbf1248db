"""A temperature sensor on an analogue input of a Numato board.

Boards with GPIOs have such inputs: `adc read N` answers 0 for 0 V to 1023 for the board's supply
of 5 V (3.3 V on some). An LM35 gives 10 mV/°C, a TMP36 as much above 0.5 V at 0 °C, so that one
step is half a degree; the mean of many conversions is finer, since their noise is about a step.
Sources: Numato's user guides of their relay modules; data sheets of LM35 and TMP36.
"""

from contextlib import suppress
from typing import Annotated

from pydantic import Field

from labrig.acquire import Connections
from labrig.foundation.errors import DeviceError, DeviceLostError
from labrig.foundation.models import FrozenModel

from .board import CHANNELS, Board

CONVERSIONS = 32
#: Time after which a slow board gives fewer conversions.
CONVERTING_S = 1.0
#: Plausible temperatures of a dark room; a sensor of another kind, or wired wrongly, is out.
PLAUSIBLE_C = (0.0, 60.0)

Volts = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class NumatoThermometer:
    """An LM35, a TMP36 or the like on an analogue input of a Numato board.

    Parameters
    ----------
    address
        Serial port of the board; its relays may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(FrozenModel):
        """Keys of a thermometer on a Numato board in a rig file; by default a TMP36 at 5 V.

        Attributes
        ----------
        input
            Analogue input of the board to which the sensor is connected, as in `adc read`, counted
            from 0.
        volts_per_degree
            Sensitivity of the sensor in volts per degree Celsius: 0.01 for a TMP36 or an LM35.
        volts_at_zero
            Voltage of the sensor at 0 °C, in volts: 0.5 for a TMP36, 0 for an LM35.
        reference_volts
            Voltage at which the converter reads its largest number, in volts: the board's supply.
        bits
            Resolution of the board's converter in bits.
        """

        input: int = Field(0, ge=0, lt=len(CHANNELS))
        volts_per_degree: Volts = 0.01
        volts_at_zero: Annotated[float, Field(allow_inf_nan=False)] = 0.5
        reference_volts: Volts = 5.0
        bits: int = Field(10, ge=8, le=16)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._largest = 2**settings.bits - 1
        self._clock = connections.clock
        self._board = Board(address, connections)
        self._name = f"input {settings.input} of {self._board.name}"

    def identity(self) -> str:
        """Return maker, firmware version and id of the board, and the number of the input."""
        return f"Numato board, {self._board.identity()}, analogue input {self._settings.input}"

    def celsius(self) -> float:
        """Return the mean of some conversions, in degrees Celsius.

        Raises
        ------
        DeviceError
            The answer is no number, no sensor is connected, or the temperature is implausible. The
            line is resynchronised: a lamp's relay may be on it.
        """
        try:
            return self._celsius(self._steps())
        except DeviceError:
            with suppress(DeviceError):
                self._board.resynchronise()
            raise

    def make_safe(self) -> None:
        """Resynchronise the line; no thermometer is unsafe, not even one that is gone."""
        with suppress(DeviceLostError):
            self._board.resynchronise()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""

    def _steps(self) -> float:
        deadline_s = self._clock.now() + CONVERTING_S
        steps = [self._convert()]
        while len(steps) < CONVERSIONS and self._clock.now() < deadline_s:
            steps.append(self._convert())
        return sum(steps) / len(steps)

    def _convert(self) -> int:
        answer = self._board.ask(f"adc read {CHANNELS[self._settings.input]}")
        if not (answer.isascii() and answer.isdecimal() and int(answer) <= self._largest):
            raise DeviceError(
                f"{self._name}: expected a number from 0 to {self._largest}, got '{answer}'; has "
                "this board that analogue input, and as many 'bits'?"
            )
        step = int(answer)
        if step in (0, self._largest):
            raise DeviceError(
                f"{self._name} reads {step}, the {'end' if step else 'beginning'} of its range; is "
                "the sensor connected, the right way round, and fed?"
            )
        return step

    def _celsius(self, steps: float) -> float:
        settings = self._settings
        volts = steps / self._largest * settings.reference_volts
        celsius: float = (volts - settings.volts_at_zero) / settings.volts_per_degree
        low, high = PLAUSIBLE_C
        if not low <= celsius <= high:
            raise DeviceError(
                f"{self._name} reads {volts:.3f} V, which would be {celsius:.1f} °C: expected "
                f"{low:g} to {high:g} °C; check the sensor and its wires, and 'volts_per_degree', "
                "'volts_at_zero' and 'reference_volts' of the rig file"
            )
        return celsius
