"""Pololu Maestro servo controllers: pulses out, errors and pulses read back.

The read-back is the pulse that the Maestro sends, not the angle of a servo. A servo takes a new
pulse with its next frame, so a door starts 0 to 20 ms after the command, differently each time.

Set to "USB Dual Port" in the Maestro Control Center, its command port is usually the lower of the
two that it shows. Any error sends every channel to its home position there: give the door's
channel the closed pulse as home and the serial time-out becomes a watchdog.
Source: Pololu's Maestro User's Guide, sections 4.e and 5.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from labrig.acquire import Board, Connections, Servo
from labrig.foundation.errors import UnclearAnswerError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from .serial_line import SerialLine

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


class MaestroServo(Servo):
    """A servo on a channel; several share a Maestro and its port."""

    class Settings(FrozenModel):
        """Keys of a servo on a Pololu Maestro.

        Attributes
        ----------
        channel
            Channel of the Maestro to which the servo is connected, counted from 0.
        travel
            Time from the command until what it moves has stopped ringing, the servo's frame of up
            to 20 ms included, for example `300 ms`.
        speed
            Speed limit of the servo in 0.25 µs per 10 ms, as in the Maestro Control Center; 0: no
            limit.
        acceleration
            Acceleration limit of the servo in 0.25 µs per 10 ms per 80 ms; 0: no limit.
        """

        channel: int = Field(ge=0, le=23)
        travel: Annotated[DurationS, Field(gt=0)]
        speed: int = Field(0, ge=0, le=0x3FFF)
        acceleration: int = Field(0, ge=0, le=0xFF)

    Position = PulseS
    noun = "pulse"
    board: "Maestro"
    settings: Settings

    @classmethod
    def distinct(cls, position: float) -> Hashable:
        """Return the pulse as it is sent."""
        return quarters(position)

    @classmethod
    def outlet(cls, settings: Any) -> Hashable:
        """Return the number of the Maestro, and of its channel."""
        return settings.device_number, settings.channel

    def place(self) -> str:
        """Return the number of the Maestro's channel."""
        return f"channel {self.settings.channel}"

    def identity(self) -> str:
        """Return the channel and the pulse that is sent."""
        return f"{self.place()}, pulse {self.pulse_s * 1e6:.2f} µs"

    @property
    def pulse_s(self) -> float:
        """Length of the pulse that is being sent, 0 for none: the command, not an angle."""
        answer = self.board.ask(GET_POSITION, 2, self.settings.channel)
        return int.from_bytes(answer, "little") * QUARTER_US

    def go(self, position: float) -> None:
        """Begin to turn; errors and the pulse are read back.

        Raises
        ------
        UnclearAnswerError
            The Maestro reports an error, or sends another pulse and does not ramp to this one.
        """
        self._tell(SET_TARGET, *seven_bits(quarters(position)))
        self.board.heartbeat()
        deadline_s = self.board.clock.now() + READ_BACK_S
        while not (self._sends(position) or (self._is_limited and self._is_moving())):
            if self.board.clock.now() >= deadline_s:
                raise self._refused(position)
            self.board.clock.sleep(LOOK_AGAIN_S)

    def bring(self, position: float) -> None:
        """Turn, whatever was interrupted, and return when the servo has had the time to stop.

        Raises
        ------
        UnclearAnswerError
            The Maestro reports an error, or sends another pulse and does not ramp to this one.
        """
        self.board.resynchronise()
        self._tell(SET_SPEED, *seven_bits(self.settings.speed))
        self._tell(SET_ACCELERATION, *seven_bits(self.settings.acceleration))
        was_there = self._sends(position)
        self.go(position)
        if was_there:
            return
        deadline_s = self.board.clock.now() + self.settings.travel + SLACK_S
        self.board.clock.sleep(self.settings.travel)
        while not self._sends(position):
            if self.board.clock.now() >= deadline_s:
                raise self._refused(position)
            self.board.clock.sleep(LOOK_AGAIN_S)

    @property
    def _is_limited(self) -> bool:
        return self.settings.speed > 0 or self.settings.acceleration > 0

    def _sends(self, pulse_s: float) -> bool:
        return quarters(self.pulse_s) == quarters(pulse_s)

    def _is_moving(self) -> bool:
        return self.board.ask(GET_MOVING, 1) != b"\0"

    def _refused(self, pulse_s: float) -> UnclearAnswerError:
        sent_s = self.pulse_s
        return UnclearAnswerError(
            f"{self.name} was set to send {pulse_s * 1e6:.2f} µs and sends {sent_s * 1e6:.2f} µs; "
            f"in {CONTROL_CENTER} look whether it is a servo channel and its range (Min, Max) wide "
            "enough"
        )

    def make_safe(self, position: float) -> None:
        """Turn to the safe position; the line is resynchronised by every turn."""
        self.bring(position)

    def _tell(self, code: int, *data: int) -> None:
        self.board.tell(code, self.settings.channel, *data)


class Maestro(Board):
    """A Maestro.

    Parameters
    ----------
    address
        The Maestro's command port.
    settings
        Keys of the rig file.
    connections
        Connections that open the port.
    """

    class Settings(FrozenModel):
        """Keys of a Pololu Maestro.

        Attributes
        ----------
        device_number
            Device number of the Maestro if several share the line, which are then addressed by
            Pololu's protocol; null: the only one, addressed by the compact protocol.
        """

        device_number: int | None = Field(None, ge=0, le=0x7F)

    channels = (MaestroServo,)

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._wire = Wire(settings.device_number)
        self.name = f"the Maestro at {address}"
        self.clock = connections.clock
        port = connections.serial(address, BAUDRATE)
        self._line = SerialLine(port, self.clock, self.name)
        self.resynchronise()

    def identity(self) -> str:
        """Return the kind of board; a Maestro reports no model or serial number."""
        return "Pololu Maestro servo controller"

    def heartbeat(self) -> None:
        """Restart the serial time-out: read the error bits, which clears them.

        Raises
        ------
        UnclearAnswerError
            Errors have happened since the bits were read last; the message names each.
        """
        if bits := self._errors():
            raise UnclearAnswerError(
                f"{self.name} reports that {error_text(bits)}; it has sent all its channels home"
            )

    def resynchronise(self) -> None:
        """Discard old errors and a half-read answer; a half-written command is an error itself."""
        self._line.drain()
        for _ in range(2):
            self._errors()

    def tell(self, code: int, *data: int) -> None:
        """Send a command."""
        self._line.write(self._wire.command(code, *data))

    def ask(self, code: int, count: int, *data: int) -> bytes:
        """Send a command and return its answer of so many bytes."""
        self.tell(code, *data)
        return self._line.read_exactly(count, ANSWER_TIMEOUT_S)

    def _errors(self) -> int:
        return int.from_bytes(self.ask(GET_ERRORS, 2), "little")


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


def quarters(pulse_s: float) -> int:
    """Return a pulse in quarter microseconds, the Maestro's unit."""
    return round(pulse_s / QUARTER_US)
