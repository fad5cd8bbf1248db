"""Numato boards: relays, and analogue inputs that read a temperature.

ASCII over USB CDC, every command echoed, ended by a `>` prompt. Echo and prompt prove that the
board understood. Boards with GPIOs have analogue inputs: `adc read N` answers 0 for 0 V to 1023 for
the board's supply of 5 V (3.3 V on some). An LM35 gives 10 mV/°C, a TMP36 as much above 0.5 V at
0 °C, so that one step is half a degree; the mean of many conversions is finer, since their noise is
about a step. Sources: Numato's documentation of the 16-channel board, user guides of their relay
modules and public sample code; data sheets of LM35 and TMP36.
"""

import re
from typing import Annotated

from pydantic import Field

from labrig.acquire import Board, Connections, Switch, TemperatureSensor
from labrig.foundation.errors import DeviceError, UnclearAnswerError
from labrig.foundation.models import FrozenModel

from .serial_line import SerialLine

#: USB CDC ignores it; Numato's own samples use this one.
BAUDRATE = 19200
ANSWER_TIMEOUT_S = 1.0
#: Characters of relays and inputs in commands.
CHANNELS = "0123456789ABCDEFGHIJKLMNOPQRSTUV"
CONVERSIONS = 32
#: Time after which a slow board gives fewer conversions.
CONVERTING_S = 1.0
#: Plausible temperatures of a dark room; a sensor of another kind, or wired wrongly, is out.
PLAUSIBLE_C = (0.0, 60.0)

Volts = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class NumatoRelay(Switch):
    """One relay; every switching is read back."""

    class Settings(FrozenModel):
        """Keys of a relay of a Numato board.

        Attributes
        ----------
        relay
            Number of the relay, counted from 0.
        """

        relay: int = Field(ge=0, lt=len(CHANNELS))

    noun = "relay"
    board: "Numato"
    settings: Settings

    def place(self) -> str:
        """Return the number of the relay."""
        return f"relay {self.settings.relay}"

    def command(self, *, on: bool) -> None:
        """Switch the relay.

        Raises
        ------
        UnclearAnswerError
            The board refuses.
        """
        command = f"relay {'on' if on else 'off'} {CHANNELS[self.settings.relay]}"
        if answer := self.board.ask(command):
            raise UnclearAnswerError(
                f"{self.board.name} refused '{command}': expected a bare prompt, got '{answer}'; "
                f"is {self.place()} on this board?"
            )

    def is_on(self) -> bool:
        """Return the state of the relay in the board's register."""
        state = self.board.ask(f"relay read {CHANNELS[self.settings.relay]}")
        if state not in ("on", "off"):
            raise UnclearAnswerError(
                f"{self.board.name} was asked for {self.place()}: expected 'on' or 'off', got "
                f"'{state}'"
            )
        return state == "on"


class NumatoThermometer(TemperatureSensor):
    """An LM35, a TMP36 or the like on an analogue input."""

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

    noun = "input"
    board: "Numato"
    settings: Settings

    def place(self) -> str:
        """Return the number of the input."""
        return f"analogue input {self.settings.input}"

    def celsius(self) -> float:
        """Return the mean of some conversions, in degrees Celsius.

        Raises
        ------
        DeviceError
            The answer is no number, no sensor is connected, or the temperature is implausible.
        """
        return self._celsius(self._steps())

    def _steps(self) -> float:
        deadline_s = self.board.clock.now() + CONVERTING_S
        steps = [self._convert()]
        while len(steps) < CONVERSIONS and self.board.clock.now() < deadline_s:
            steps.append(self._convert())
        return sum(steps) / len(steps)

    @property
    def _largest(self) -> int:
        """Largest number of the converter."""
        largest: int = 2**self.settings.bits - 1
        return largest

    def _convert(self) -> int:
        answer = self.board.ask(f"adc read {CHANNELS[self.settings.input]}")
        if not (answer.isascii() and answer.isdecimal() and int(answer) <= self._largest):
            raise DeviceError(
                f"{self.name}: expected a number from 0 to {self._largest}, got '{answer}'; has "
                "this board that analogue input, and as many 'bits'?"
            )
        step = int(answer)
        if step in (0, self._largest):
            raise DeviceError(
                f"{self.name} reads {step}, the {'end' if step else 'beginning'} of its range; is "
                "the sensor connected, the right way round, and fed?"
            )
        return step

    def _celsius(self, steps: float) -> float:
        settings = self.settings
        volts = steps / self._largest * settings.reference_volts
        celsius: float = (volts - settings.volts_at_zero) / settings.volts_per_degree
        low, high = PLAUSIBLE_C
        if not low <= celsius <= high:
            raise DeviceError(
                f"{self.name} reads {volts:.3f} V, which would be {celsius:.1f} °C: expected "
                f"{low:g} to {high:g} °C; check the sensor and its wires, and 'volts_per_degree', "
                "'volts_at_zero' and 'reference_volts' of the rig file"
            )
        return celsius


class Numato(Board):
    """A Numato board.

    Parameters
    ----------
    address
        Serial port of the board.
    settings
        Keys of the rig file.
    connections
        Connections that open the port.
    """

    channels = (NumatoRelay, NumatoThermometer)

    def __init__(self, address: str, settings: Board.Settings, connections: Connections) -> None:
        self.name = f"the Numato board at {address}"
        self.clock = connections.clock
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, self.clock, self.name)
        self.resynchronise()

    def identity(self) -> str:
        """Return firmware version and id of the board."""
        version, board_id = self.ask("ver"), self.ask("id get")
        return f"Numato relay board, firmware {version}, id {board_id}"

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

    def resynchronise(self) -> None:
        """End a half-typed command by a bare return, and discard the answer."""
        self._line.write(b"\r")
        self._line.drain()
