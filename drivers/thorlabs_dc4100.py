"""Thorlabs DC4100 and DC4104 LED drivers: four LED heads each, several units in one bank.

ASCII lines over the unit's own serial port: queries such as `o? 0` are answered by a line, commands
such as `o 0 1` by none, or by a line `ERROR 12:…`. The manual does not document them; source: the
adapter of Micro-Manager, written at Thorlabs. Every setting is therefore read back.
"""

import re
from collections.abc import Collection, Hashable, Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Self

from pydantic import Field, model_validator

from labrig.acquire import Board, Connections, Switch
from labrig.foundation.errors import DeviceError, UnclearAnswerError, UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import Fraction

from .serial_line import SerialLine

BAUDRATE = 115200
LINE_END = b"\r\n"
ANSWER_TIMEOUT_S = 1.0
MODELS = ("DC4100", "DC4104")
OUTPUTS = 4
#: Operation mode `m 1`: each output has its brightness in per cent of its current limit.
BRIGHTNESS_MODE = 1
#: Selection mode `sm 1`: the unit itself lets one of its outputs be on.
SINGLE = 1
#: Bits of the status word `r?` that concern the whole unit, with remedies.
UNIT_FAULTS = {
    0x2: "its supply voltage is out of range: use its own power supply",
    0x8: "it is too hot and has switched its LEDs off: let it cool down, and free its vents",
}
#: Bits of the status word for output 1, with remedies; each further output's are two bits higher.
OUTPUT_FAULTS = {
    0x20: "no LED head is connected: plug it in",
    0x2000: "its LED is open, with the largest voltage and no current: check the head's plug",
}
#: Bit of the status word for output 1 at its current limit, where 100 % is meant to be.
AT_LIMIT = 0x200000
_ERROR_NUMBER = re.compile(r"\D*(\d+)")


class Dc4100Output(Switch):
    """An output with its brightness; it is off when its unit has been opened."""

    class Settings(FrozenModel):
        """Keys of an LED head on an output of a DC4100.

        Attributes
        ----------
        output
            Number of the output, as printed on the unit: the first one is 1.
        brightness
            Brightness in per cent of the output's current limit, which is set at the unit, for
            example `60 %`; whole per cent.
        """

        output: Annotated[int, Field(ge=1, le=OUTPUTS)]
        brightness: Annotated[Fraction, Field(ge=0.01, le=1)] = 1.0

        @model_validator(mode="after")
        def _whole_per_cent(self) -> Self:
            per_cent = 100 * self.brightness
            if abs(per_cent - round(per_cent)) > 1e-6:
                raise ValueError(f"expected 'brightness' in whole per cent, got {per_cent:g} %")
            return self

    noun = "output"
    board: "ThorlabsDc4100"
    settings: Settings

    def __init__(self, board: "ThorlabsDc4100", settings: Settings) -> None:
        super().__init__(board, settings)
        self.state = False

    @classmethod
    def distinct(cls, settings: Settings) -> Hashable:
        """Return the number of the output."""
        return settings.output

    def place(self) -> str:
        """Return the number of the output."""
        return f"output {self.settings.output}"

    def identity(self) -> str:
        """Return the number of the output and its brightness."""
        return f"{self.place()} at {self._per_cent} %"

    def head_nm(self) -> float | None:
        """Return the wavelength in nm that the head on the output names; None if it names none."""
        return self.board.number(f"wl? {self._index}") or None

    def command(self, *, on: bool) -> None:
        """Switch; before an output is lit its brightness is set.

        Raises
        ------
        DeviceError
            The unit reports a fault of itself or the output, which then gives no light as set.
        UnclearAnswerError
            The unit refuses, or the brightness does not read as it was set.
        """
        if on:
            self._set_brightness()
        self.board.command(f"o {self._index} {int(on)}")
        if on:
            self._raise_faults()

    def is_on(self) -> bool:
        """Return whether the unit reports that the output is on."""
        answer = self.board.ask(f"o? {self._index}")
        if answer not in ("0", "1"):
            raise UnclearAnswerError(
                f"{self.board.name} was asked for output {self.settings.output}: expected 0 or 1, "
                f"got '{answer}'"
            )
        return answer == "1"

    @property
    def _index(self) -> int:
        return self.settings.output - 1

    @property
    def _per_cent(self) -> int:
        return round(100 * self.settings.brightness)

    def _set_brightness(self) -> None:
        self.board.command(f"bp {self._index} {self._per_cent}")
        read = self.board.number(f"bp? {self._index}")
        if round(read) != self._per_cent:
            raise UnclearAnswerError(
                f"{self.name} was set to {self._per_cent} % and reads {read:g} %; leave its knobs "
                "and its port to labrig"
            )

    def _raise_faults(self) -> None:
        answer = self.board.ask("r?")
        try:
            status = int(answer, 16 if answer.lower().startswith("0x") else 10)
        except ValueError:
            raise UnclearAnswerError(
                f"{self.board.name} was asked for its status: expected a number, got '{answer}'"
            ) from None
        for bit, fault in UNIT_FAULTS.items():
            if status & bit:
                raise DeviceError(f"{self.board.name} reports a fault: {fault}")
        for bit, fault in OUTPUT_FAULTS.items():
            if status & bit << 2 * self._index:
                raise DeviceError(f"{self.name} reports a fault: {fault}")
        if self._per_cent < 100 and status & AT_LIMIT << 2 * self._index:
            raise DeviceError(
                f"{self.name} reports that it has reached its current limit at {self._per_cent} %, "
                "and so gives less light: set the limit at the unit to the head's"
            )


class ThorlabsDc4100(Board):
    """One unit; all its outputs are switched off when it is opened, also those without a name.

    Parameters
    ----------
    address
        Serial port of the unit.
    settings
        Keys of the rig file.
    connections
        Connections that open the port.

    Raises
    ------
    DeviceError
        Another device is at the address.
    """

    class Settings(FrozenModel):
        """Keys of Thorlabs DC4100 or DC4104 units.

        Attributes
        ----------
        serial_numbers
            Serial number of the unit by its address, for units that must not be exchanged.
            Default: any unit.
        """

        serial_numbers: dict[Annotated[str, Field(min_length=1)], str] = Field(default_factory=dict)

    channels = (Dc4100Output,)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self.name = f"the DC4100 at {address}"
        self._line = SerialLine(connections.serial(address, BAUDRATE), connections.clock, self.name)
        self.resynchronise()
        self._model = self.ask("n?")
        if not any(model in self._model for model in MODELS):
            raise DeviceError(
                f"{self.name} was asked for its name: expected {' or '.join(MODELS)}, got "
                f"'{self._model}'; check the address"
            )
        serial_number = settings.serial_numbers.get(address)
        self._serial_number = self.ask("s?")
        if serial_number is not None and self._serial_number != serial_number:
            raise DeviceError(
                f"{self.name} has the serial number {self._serial_number}, the rig file says "
                f"{serial_number}; exchange the addresses, or correct 'serial_numbers'"
            )
        # At once, since the next unit may be missing.
        self._darken({})
        self._set("m", str(BRIGHTNESS_MODE), "is it under external control?")
        self._set("sm", str(SINGLE), "set its selection mode to 'single' by hand")

    @classmethod
    def check_addresses(cls, settings: Settings, addresses: Collection[str]) -> None:
        """Refuse a serial number for an address without a unit.

        Raises
        ------
        UsageError
            There is one.
        """
        for unknown in settings.serial_numbers.keys() - set(addresses):
            raise UsageError(
                f"no unit is at {unknown}, for which the rig file has one of 'serial_numbers'; "
                f"expected {' or '.join(addresses)}"
            )

    def identity(self) -> str:
        """Return model, serial number and firmware of the unit."""
        return f"Thorlabs {self._model}, serial {self._serial_number}, firmware {self.ask('v?')}"

    def resynchronise(self) -> None:
        """End a half-typed command, discard the answer, and forget an error of before."""
        self._line.write(LINE_END)
        self._line.drain()
        self.ask("e?")

    def make_safe(self, switches: Sequence[Switch]) -> None:
        """Switch all outputs off, also those without a name in the rig file.

        Raises
        ------
        DeviceError
            An output could not be confirmed as off.
        """
        self.resynchronise()
        self._darken({switch.settings.output: switch for switch in switches})

    def _darken(self, named: Mapping[int, Switch]) -> None:
        self.switch_off(
            named.get(output) or Dc4100Output(self, Dc4100Output.Settings(output=output))
            for output in range(1, OUTPUTS + 1)
        )

    def _set(self, what: str, value: str, hint: str) -> None:
        self.command(f"{what} {value}")
        if (read := self.ask(f"{what}?")) != value:
            raise UnclearAnswerError(
                f"{self.name} was sent '{what} {value}' and reads back '{read}'; {hint}"
            )

    def command(self, command: str) -> None:
        """Send a command, and read the unit's last error.

        Raises
        ------
        UnclearAnswerError
            The unit reports an error, or does not answer.
        """
        self._send(command)
        answer = self.ask("e?")
        number = _ERROR_NUMBER.match(answer)
        if number is None or int(number[1]) != 0:
            raise self._refused(command, answer)

    def number(self, query: str) -> float:
        """Send a query and return the number that the unit answers."""
        answer = self.ask(query)
        try:
            return float(answer)
        except ValueError:
            raise UnclearAnswerError(
                f"{self.name} was asked '{query}': expected a number, got '{answer}'"
            ) from None

    def ask(self, query: str) -> str:
        """Send a query and return its answer."""
        self._send(query)
        answer = self._line.read_until(b"\n", ANSWER_TIMEOUT_S).decode("ascii", "backslashreplace")
        answer = " ".join(answer.split())
        if answer.startswith("ERROR") and query != "e?":
            raise self._refused(query, answer)
        return answer

    def _send(self, text: str) -> None:
        self._line.discard()
        self._line.write(text.encode("ascii") + LINE_END)

    def _refused(self, sent: str, answer: str) -> UnclearAnswerError:
        with suppress(DeviceError):  # so that the next command is understood
            self._line.drain()
        return UnclearAnswerError(
            f"{self.name} was sent '{sent}' and reports '{answer}'; is it a DC4100 with that "
            "output, and not locked at its front?"
        )
