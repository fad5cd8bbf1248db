"""Thorlabs DC4100 and DC4104 LED drivers: four LED heads each, several units in one bank.

ASCII lines over the unit's own serial port: queries such as `o? 0` are answered by a line, commands
such as `o 0 1` by none, or by a line `ERROR 12:…`. The manual does not document them; source: the
adapter of Micro-Manager, written at Thorlabs. Every setting is therefore read back.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import Field, model_validator

from labrig.acquire import Connections, Finding, LedLight
from labrig.foundation.errors import DeviceError, UnclearAnswerError, UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import Fraction

from .light_switches import LightSwitches, Name
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
#: Differences of the head's own wavelength from the rig file's peak, in nm, that are worth a
#: warning, and that mean another head than was meant.
NOTABLE_NM, OTHER_HEAD_NM = 5.0, 20.0
_ERROR_NUMBER = re.compile(r"\D*(\d+)")


class Dc4100Led(LedLight):
    """An LED head on an output of a DC4100, with what is known of its light.

    Attributes
    ----------
    output
        Number of the output, as printed on the unit: the first one is 1.
    brightness
        Brightness in per cent of the output's current limit, which is set at the unit, for example
        `60 %`; whole per cent.
    address
        Serial port of the unit, if it is another one than the device's.
    """

    output: Annotated[int, Field(ge=1, le=OUTPUTS)]
    brightness: Annotated[Fraction, Field(ge=0.01, le=1)] = 1.0
    address: Annotated[str, Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _whole_per_cent(self) -> Self:
        per_cent = 100 * self.brightness
        if abs(per_cent - round(per_cent)) > 1e-6:
            raise ValueError(f"expected 'brightness' in whole per cent, got {per_cent:g} %")
        return self


class ThorlabsDc4100:
    """One unit: its line, its commands and its read-backs.

    Parameters
    ----------
    address
        Serial port of the unit.
    serial_number
        Serial number that it has to have; None for any.
    connections
        Connections that open the port.

    Raises
    ------
    DeviceError
        Another device is at the address.
    """

    def __init__(self, address: str, serial_number: str | None, connections: Connections) -> None:
        self.name = f"the DC4100 at {address}"
        self._line = SerialLine(connections.serial(address, BAUDRATE), connections.clock, self.name)
        self.resynchronise()
        self._model = self._ask("n?")
        if not any(model in self._model for model in MODELS):
            raise DeviceError(
                f"{self.name} was asked for its name: expected {' or '.join(MODELS)}, got "
                f"'{self._model}'; check the address"
            )
        self._serial_number = self._ask("s?")
        if serial_number is not None and self._serial_number != serial_number:
            raise DeviceError(
                f"{self.name} has the serial number {self._serial_number}, the rig file says "
                f"{serial_number}; exchange the addresses, or correct 'serial_numbers'"
            )
        # At once, since the next unit may be missing.
        self.darken_all()

    def identity(self) -> str:
        """Return model, serial number and firmware of the unit."""
        return f"{self._model}, serial {self._serial_number}, firmware {self._ask('v?')}"

    def prepare(self) -> None:
        """Let brightnesses count, and one output at a time be on.

        Raises
        ------
        UnclearAnswerError
            The unit refuses, or reads back another mode.
        """
        self._set("m", str(BRIGHTNESS_MODE), "is it under external control?")
        self._set("sm", str(SINGLE), "set its selection mode to 'single' by hand")

    def light(self, output: int, per_cent: int) -> None:
        """Switch an output on, counted from 1, and read it back with the unit's status.

        Raises
        ------
        DeviceError
            The unit reports a fault of itself or the output, which then gives no light as set.
        UnclearAnswerError
            The unit refuses, or brightness or output do not read as they were set.
        """
        self._set_brightness(output, per_cent)
        self._command(f"o {output - 1} 1")
        self._raise_faults(output, per_cent)
        if not self.is_on(output):
            raise UnclearAnswerError(
                f"output {output} of {self.name} was switched on but reads off; switch it off by "
                "hand and check the unit"
            )

    def darken(self, output: int) -> None:
        """Switch an output off, counted from 1, and read it back.

        Raises
        ------
        UnclearAnswerError
            The unit refuses, or the output reads on.
        """
        self._command(f"o {output - 1} 0")
        if self.is_on(output):
            raise UnclearAnswerError(
                f"output {output} of {self.name} was switched off but reads on; switch it off by "
                "hand and check the unit"
            )

    def darken_all(self) -> None:
        """Switch all outputs off, each even if another one fails.

        Raises
        ------
        DeviceError
            An output could not be confirmed as off.
        """
        failure: DeviceError | None = None
        for output in range(1, OUTPUTS + 1):
            try:
                self.darken(output)
            except DeviceError as error:
                failure = failure or error
                with suppress(DeviceError):  # so that the next one is understood
                    self.resynchronise()
        if failure:
            raise failure

    def is_on(self, output: int) -> bool:
        """Return whether an output, counted from 1, is on."""
        answer = self._ask(f"o? {output - 1}")
        if answer not in ("0", "1"):
            raise UnclearAnswerError(
                f"{self.name} was asked for output {output}: expected 0 or 1, got '{answer}'"
            )
        return answer == "1"

    def head_nm(self, output: int) -> float:
        """Return the wavelength in nm that the head on an output names; 0 if it names none."""
        return self._number(f"wl? {output - 1}")

    def resynchronise(self) -> None:
        """End a half-typed command, discard the answer, and forget an error of before."""
        self._line.write(LINE_END)
        self._line.drain()
        self._ask("e?")

    def _set_brightness(self, output: int, per_cent: int) -> None:
        self._command(f"bp {output - 1} {per_cent}")
        read = self._number(f"bp? {output - 1}")
        if round(read) != per_cent:
            raise UnclearAnswerError(
                f"output {output} of {self.name} was set to {per_cent} % and reads {read:g} %; "
                "leave its knobs and its port to labrig"
            )

    def _raise_faults(self, output: int, per_cent: int) -> None:
        answer = self._ask("r?")
        try:
            status = int(answer, 16 if answer.lower().startswith("0x") else 10)
        except ValueError:
            raise UnclearAnswerError(
                f"{self.name} was asked for its status: expected a number, got '{answer}'"
            ) from None
        for bit, fault in UNIT_FAULTS.items():
            if status & bit:
                raise DeviceError(f"{self.name} reports a fault: {fault}")
        for bit, fault in OUTPUT_FAULTS.items():
            if status & bit << 2 * (output - 1):
                raise DeviceError(f"output {output} of {self.name} reports a fault: {fault}")
        if per_cent < 100 and status & AT_LIMIT << 2 * (output - 1):
            raise DeviceError(
                f"output {output} of {self.name} reports that it has reached its current limit at "
                f"{per_cent} %, and so gives less light: set the limit at the unit to the head's"
            )

    def _set(self, what: str, value: str, hint: str) -> None:
        self._command(f"{what} {value}")
        if (read := self._ask(f"{what}?")) != value:
            raise UnclearAnswerError(
                f"{self.name} was sent '{what} {value}' and reads back '{read}'; {hint}"
            )

    def _command(self, command: str) -> None:
        """Send a command, and read the unit's last error.

        Raises
        ------
        UnclearAnswerError
            The unit reports an error, or does not answer.
        """
        self._send(command)
        answer = self._ask("e?")
        number = _ERROR_NUMBER.match(answer)
        if number is None or int(number[1]) != 0:
            raise self._refused(command, answer)

    def _number(self, query: str) -> float:
        answer = self._ask(query)
        try:
            return float(answer)
        except ValueError:
            raise UnclearAnswerError(
                f"{self.name} was asked '{query}': expected a number, got '{answer}'"
            ) from None

    def _ask(self, query: str) -> str:
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


@dataclass(frozen=True)
class _Output:
    unit: ThorlabsDc4100
    number: int
    per_cent: int = 100

    def switch(self, *, on: bool) -> None:
        if on:
            self.unit.light(self.number, self.per_cent)
        else:
            self.unit.darken(self.number)

    def is_on(self) -> bool:
        return self.unit.is_on(self.number)


class ThorlabsLedBank(LightSwitches):
    """LED heads on the outputs of one or several DC4100 or DC4104, one lit at a time.

    Parameters
    ----------
    address
        Serial port of the unit, or of the first one.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the ports.

    Raises
    ------
    DeviceError
        Another device is at an address, or a head's own wavelength contradicts the rig file.
    UsageError
        A serial number is given for an address without a unit.
    """

    class Settings(FrozenModel):
        """Keys of LED heads on Thorlabs DC4100 or DC4104 units in a rig file.

        Attributes
        ----------
        channels
            Output of each LED by the LED's name, for example
            `{"455 nm": {output: 1, brightness: 60 %, centre: 455, fwhm: 18}}`; an LED on a further
            unit has that one's `address`, too.
        serial_numbers
            Serial number of the unit by its address, for units that must not be exchanged.
            Default: any unit.
        """

        channels: dict[Name, Dc4100Led] = Field(min_length=1)
        serial_numbers: dict[Name, str] = Field(default_factory=dict)

        @model_validator(mode="after")
        def _an_output_each(self) -> Self:
            if len({(led.address, led.output) for led in self.channels.values()}) < len(
                self.channels
            ):
                raise ValueError("expected an output of its own for each LED in 'channels'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._leds = settings.channels
        addresses = dict.fromkeys(
            [address, *(led.address or address for led in self._leds.values())]
        )
        for unknown in settings.serial_numbers.keys() - set(addresses):
            raise UsageError(
                f"no unit is at {unknown}, for which the rig file has one of 'serial_numbers'; "
                f"expected {' or '.join(addresses)}"
            )
        self._units = {
            port: ThorlabsDc4100(port, settings.serial_numbers.get(port), connections)
            for port in addresses
        }
        self._outputs = {
            name: _Output(
                self._units[led.address or address], led.output, round(100 * led.brightness)
            )
            for name, led in self._leds.items()
        }
        name = " and ".join(unit.name for unit in self._units.values())
        super().__init__(name, self._outputs, self._leds, self._resynchronise)
        self._may_be_lit.clear()  # every unit has switched its outputs off
        for unit in self._units.values():
            unit.prepare()
        self._require_heads()

    @classmethod
    def declared_leds(cls, settings: Settings) -> Mapping[str, LedLight]:
        """Return what the rig file says of the LEDs' light by their names, for plans."""
        return settings.channels

    def reads_back(self) -> bool:
        """Return True: every unit reports the states of its outputs."""
        return True

    def identity(self) -> str:
        """Return model, serial number and firmware of every unit, and the LEDs' outputs."""
        units = "; ".join(
            f"{unit.identity()}, LEDs "
            + ", ".join(
                f"{name} on output {output.number} at {output.per_cent} %"
                for name, output in self._outputs.items()
                if output.unit is unit
            )
            for unit in self._units.values()
        )
        return f"Thorlabs {units}"

    def findings(self) -> Sequence[Finding]:
        """Return whether the heads' own wavelengths are those of the rig file."""
        return [
            Finding(
                "warn",
                f"the head of {name} says {head_nm:g} nm, the rig file's peak is {peak_nm:g} nm",
                "measure its spectrum, and name the file as 'spectrum'",
            )
            for name, head_nm, peak_nm in self._wavelengths_nm()
            if abs(head_nm - peak_nm) > NOTABLE_NM
        ] or [Finding("fine", "outputs are read back, and no head contradicts the rig file")]

    def make_safe(self) -> None:
        """Switch off all outputs of all units, also those without a name in the rig file.

        Raises
        ------
        DeviceError
            An output could not be confirmed as off.
        """
        failure: DeviceError | None = None
        for unit in self._units.values():
            try:
                unit.resynchronise()
                unit.darken_all()
            except DeviceError as error:
                failure = failure or error
        if failure:
            raise failure
        self._may_be_lit.clear()

    def _require_heads(self) -> None:
        for name, head_nm, peak_nm in self._wavelengths_nm():
            if abs(head_nm - peak_nm) > OTHER_HEAD_NM:
                output = self._outputs[name]
                raise DeviceError(
                    f"the head on output {output.number} of {output.unit.name} is one of "
                    f"{head_nm:g} nm, the LED '{name}' of the rig file has its peak at "
                    f"{peak_nm:g} nm; plug the heads in as in the rig file, or correct that"
                )

    def _wavelengths_nm(self) -> Iterator[tuple[str, float, float]]:
        """Yield name, head's wavelength and rig file's peak of LEDs of which both are known."""
        for name, output in self._outputs.items():
            peak_nm = self._leds[name].peak_nm()
            head_nm = output.unit.head_nm(output.number)
            if peak_nm is not None and head_nm > 0:
                yield name, head_nm, peak_nm

    def _resynchronise(self) -> None:
        for unit in self._units.values():
            unit.resynchronise()
