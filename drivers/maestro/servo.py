"""One channel of a Pololu Maestro: pulses out, errors and pulses read back.

Set to "USB Dual Port" in the Maestro Control Center, its command port is usually the lower of the
two that it shows. Any error sends every channel to its home position there: give the door's
channel the closed pulse as home and the serial time-out becomes a watchdog.
Source: Pololu's Maestro User's Guide, sections 4.e and 5.
"""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from labrig.acquire import Connections
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from ..serial_line import SerialLine

CONTROL_CENTER = "the Maestro Control Center"

#: Meaning and remedy of each bit, from bit 0 on.
ERRORS = (
    ("a byte came damaged", "check its wiring and baud rate, or use its USB port"),
    ("bytes came faster than it took them", "end whatever else writes to this port"),
    ("its receive buffer overflowed", "end whatever else writes to this port"),
    ("a check sum was missing or wrong", f"switch 'Enable CRC' off in {CONTROL_CENTER}"),
    (
        "it did not understand a command",
        f"check 'device_number', end whatever else writes to this port, and set the serial mode to "
        f"USB Dual Port in {CONTROL_CENTER}",
    ),
    (
        "its serial time-out, the watchdog, has run out: it had heard nothing for too long",
        f"if no plug was pulled, raise the time-out in {CONTROL_CENTER} to 3 min",
    ),
    ("its script overflowed the stack", f"correct the script in {CONTROL_CENTER}"),
    ("its script called too deeply", f"correct the script in {CONTROL_CENTER}"),
    ("its script ran past its end", f"end the script with QUIT in {CONTROL_CENTER}"),
)


def error_text(bits: int) -> str:
    """Return all errors in the 16 bits that the command A1 reads, with remedies; empty for none."""
    errors = [error for bit, error in enumerate(ERRORS) if bits >> bit & 1]
    unknown_bits = [bit for bit in range(len(ERRORS), 16) if bits >> bit & 1]
    remedies = dict.fromkeys(remedy for _, remedy in errors)
    names = [name for name, _ in errors] + [
        f"error bit {bit}, unknown to labrig" for bit in unknown_bits
    ]
    return ", and ".join(names) + (f" ({'; '.join(remedies)})" if remedies else "")


#: The USB port ignores it; a Maestro's own default where it is wired to a UART adapter.
BAUDRATE = 9600
ANSWER_TIMEOUT_S = 0.5
#: Time within which a new pulse is sent: five servo frames.
READ_BACK_S = 0.1
LOOK_AGAIN_S = 0.005
#: Time added to that of the whole way.
SLACK_S = 1.0

SET_TARGET, SET_SPEED, SET_ACCELERATION = 0x84, 0x87, 0x89
GET_POSITION, GET_MOVING, GET_ERRORS = 0x90, 0x93, 0xA1
POLOLU_PROTOCOL = 0xAA
QUARTER_US = 0.25e-6

#: Length of a Maestro's pulse: 64 µs to 4080 µs.
PulseS = Annotated[DurationS, Field(ge=64e-6, le=4080e-6)]


class ServoSettings(FrozenModel):
    """Keys of a servo on a Pololu Maestro in a rig file.

    Attributes
    ----------
    channel
        Channel of the Maestro to which the servo is connected, counted from 0.
    travel
        Time from the command until the door has stopped ringing, the servo's frame of up to 20 ms
        included, for example `300 ms`.
    speed
        Speed limit of the servo in 0.25 µs per 10 ms, as in the Maestro Control Center; 0: no
        limit.
    acceleration
        Acceleration limit of the servo in 0.25 µs per 10 ms per 80 ms; 0: no limit.
    device_number
        Device number of the Maestro if several share the line, which are then addressed by Pololu's
        protocol; null: the only one, addressed by the compact protocol.
    """

    channel: int = Field(ge=0, le=23)
    travel: Annotated[DurationS, Field(gt=0)]
    speed: int = Field(0, ge=0, le=0x3FFF)
    acceleration: int = Field(0, ge=0, le=0xFF)
    device_number: int | None = Field(None, ge=0, le=0x7F)


@dataclass(frozen=True)
class Wire:
    """Encoding of commands: by the compact protocol, or with a device number by Pololu's."""

    device_number: int | None = None

    def command(self, code: int, *data: int) -> bytes:
        """Return the bytes of a command; data bytes have 7 bits."""
        if self.device_number is None:
            return bytes((code, *data))
        return bytes((POLOLU_PROTOCOL, self.device_number, code & 0x7F, *data))


def seven_bits(value: int) -> tuple[int, int]:
    """Return a number below 2¹⁴ in the Maestro's form: low seven bits first."""
    return value & 0x7F, value >> 7


class Servo:
    """A servo on a channel; several may share a Maestro and its port.

    Parameters
    ----------
    address
        Serial port of the Maestro.
    settings
        The servo's part of the rig file.
    connections
        Connections that open the port.
    """

    def __init__(self, address: str, settings: ServoSettings, connections: Connections) -> None:
        self._settings = settings
        self._wire = Wire(settings.device_number)
        self.name = f"the Maestro at {address}"
        self._clock = connections.clock
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, self._clock, self.name)
        self._resynchronise()

    @property
    def pulse_s(self) -> float:
        """Length of the pulse that is being sent, 0 for none: the command, not an angle."""
        answer = self._ask(GET_POSITION, 2, self._settings.channel)
        return int.from_bytes(answer, "little") * QUARTER_US

    def go(self, pulse_s: float) -> None:
        """Begin to turn; errors and the pulse are read back.

        Raises
        ------
        UnclearAnswerError
            The Maestro reports an error, or sends another pulse and does not ramp to this one.
        """
        self._tell(SET_TARGET, *seven_bits(quarters(pulse_s)))
        self.raise_errors()
        deadline_s = self._clock.now() + READ_BACK_S
        while not (self._sends(pulse_s) or (self._is_limited and self._is_moving())):
            if self._clock.now() >= deadline_s:
                raise self._refused(pulse_s)
            self._clock.sleep(LOOK_AGAIN_S)

    def bring(self, pulse_s: float) -> None:
        """Turn, whatever was interrupted, and return when the servo has had the time to stop.

        Raises
        ------
        UnclearAnswerError
            The Maestro reports an error, or sends another pulse and does not ramp to this one.
        """
        self._resynchronise()
        self._tell(SET_SPEED, *seven_bits(self._settings.speed))
        self._tell(SET_ACCELERATION, *seven_bits(self._settings.acceleration))
        was_there = self._sends(pulse_s)
        self.go(pulse_s)
        if was_there:
            return
        deadline_s = self._clock.now() + self._settings.travel + SLACK_S
        self._clock.sleep(self._settings.travel)
        while not self._sends(pulse_s):
            if self._clock.now() >= deadline_s:
                raise self._refused(pulse_s)
            self._clock.sleep(LOOK_AGAIN_S)

    def raise_errors(self) -> None:
        """Read the error bits, which clears them.

        Raises
        ------
        UnclearAnswerError
            Errors have happened since the bits were read last; the message names each.
        """
        if bits := self._errors():
            raise UnclearAnswerError(
                f"{self.name} reports that {error_text(bits)}; it has sent all its channels home"
            )

    @property
    def _is_limited(self) -> bool:
        return self._settings.speed > 0 or self._settings.acceleration > 0

    def _sends(self, pulse_s: float) -> bool:
        return quarters(self.pulse_s) == quarters(pulse_s)

    def _is_moving(self) -> bool:
        return self._ask(GET_MOVING, 1) != b"\0"

    def _refused(self, pulse_s: float) -> UnclearAnswerError:
        channel, sent_s = self._settings.channel, self.pulse_s
        return UnclearAnswerError(
            f"channel {channel} of {self.name} was set to send {pulse_s * 1e6:.2f} µs and sends "
            f"{sent_s * 1e6:.2f} µs; in the Maestro Control Center look whether it is a servo "
            "channel and its range (Min, Max) wide enough"
        )

    def _errors(self) -> int:
        return int.from_bytes(self._ask(GET_ERRORS, 2), "little")

    def _tell(self, code: int, *data: int) -> None:
        self._line.write(self._wire.command(code, self._settings.channel, *data))

    def _ask(self, code: int, count: int, *data: int) -> bytes:
        self._line.write(self._wire.command(code, *data))
        return self._line.read_exactly(count, ANSWER_TIMEOUT_S)

    def _resynchronise(self) -> None:
        """Discard old errors and a half-read answer; a half-written command is an error itself."""
        self._line.drain()
        for _ in range(2):
            self._errors()


def quarters(pulse_s: float) -> int:
    """Return a pulse in quarter microseconds, the Maestro's unit."""
    return round(pulse_s / QUARTER_US)
