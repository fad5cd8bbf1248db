"""A Pololu Maestro servo controller: binary commands in, pulses out, errors that send it home.

The board obeys the commands of the compact and of Pololu's protocol that set and read one channel.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from labrig.foundation.clock import VirtualClock

CHANNELS = 24
DEVICE_NUMBER = 12
QUARTER_US = 0.25e-6
#: Pulses to which every channel can be set; 0 for no pulses.
RANGE_S = (500e-6, 2500e-6)
#: Units of the limits: 0.25 µs per 10 ms, and that per 80 ms.
SPEED_S = 0.01
ACCELERATION_S2 = 0.01 * 0.08

#: Data bytes of each command.
DATA_BYTES = {0x84: 3, 0x87: 3, 0x89: 3, 0x90: 1, 0x93: 0, 0xA1: 0, 0xA2: 0}
PROTOCOL_ERROR, TIME_OUT_ERROR = 1 << 4, 1 << 5


class Pulse(NamedTuple):
    """Change of a channel to pulses of `width_s`, 0 for none, evenly in `ramp_s` from `at_s` on."""

    at_s: float
    width_s: float
    ramp_s: float


class MaestroBoard:
    """Board with twenty-four channels.

    Parameters
    ----------
    clock
        The room's clock.
    homes
        Pulse in seconds by channel, at which the channel starts and to which any error sends it;
        all others send none.
    time_out_s
        Time without a command after which there is an error, too, in seconds; None: never.
    """

    def __init__(
        self, clock: VirtualClock, homes: Mapping[int, float], time_out_s: float | None = None
    ) -> None:
        self._clock = clock
        self._homes = dict(homes)
        self._time_out_s = math.inf if time_out_s is None else time_out_s
        self._heard_s = 0.0
        self._errors = 0
        self._command: list[int] = []
        self._limits: dict[tuple[int, int], int] = {}
        self._pulses = {
            channel: [Pulse(0.0, self._homes.get(channel, 0.0), 0.0)] for channel in range(CHANNELS)
        }

    def start_at(self, channel: int, width_s: float) -> None:
        """Set the pulse of a channel when the room is opened, instead of its home."""
        self._pulses[channel] = [Pulse(0.0, width_s, 0.0)]

    def pulses(self, channel: int) -> Sequence[Pulse]:
        """Return all changes of a channel's pulse up to now."""
        self._check_time_out()
        return self._pulses[channel]

    def receive(self, data: bytes) -> bytes:
        """Return the board's answers to these bytes, in order."""
        self._check_time_out()
        answer = b""
        for byte in data:
            begins = byte >= 0x80
            if begins == bool(self._command):  # too early, or without a beginning
                self._err(PROTOCOL_ERROR, self._clock.now())
                self._command = []
            if begins or self._command:
                self._command.append(byte)
                answer += self._completed()
        return answer

    def _completed(self) -> bytes:
        """Obey the command if it is complete."""
        is_addressed = self._command[0] == 0xAA
        if is_addressed and len(self._command) < 3:
            return b""
        code, *data = (
            [self._command[2] | 0x80, *self._command[3:]] if is_addressed else self._command
        )
        if code == 0xAA or len(data) < DATA_BYTES.get(code, 0):
            return b""
        is_own = not is_addressed or self._command[1] == DEVICE_NUMBER
        self._command = []
        if not is_own:
            return b""
        if code not in DATA_BYTES or (data and data[0] >= CHANNELS):
            self._err(PROTOCOL_ERROR, self._clock.now())
            return b""
        self._heard_s = self._clock.now()
        return self._obey(code, data)

    def _obey(self, code: int, data: list[int]) -> bytes:
        match code, data:
            case 0x84, [channel, low, high]:
                width_s = (low | high << 7) * QUARTER_US
                self._send(channel, width_s and min(max(width_s, RANGE_S[0]), RANGE_S[1]))
            case ((0x87 | 0x89), [channel, low, high]):
                self._limits[code, channel] = low | high << 7
            case 0x90, [channel]:
                return round(self._width_s(channel) / QUARTER_US).to_bytes(2, "little")
            case 0x93, _:
                return bytes((any(self._is_ramping(channel) for channel in range(CHANNELS)),))
            case 0xA1, _:
                errors, self._errors = self._errors, 0
                return errors.to_bytes(2, "little")
            case 0xA2, _:
                self._go_home(self._clock.now())
        return b""

    def _send(self, channel: int, width_s: float) -> None:
        if width_s == self._pulses[channel][-1].width_s:
            return
        before_s, now_s = self._width_s(channel), self._clock.now()
        ramp_s = self._ramp_s(channel, abs(width_s - before_s)) if width_s and before_s else 0.0
        self._pulses[channel].append(Pulse(now_s, width_s, ramp_s))

    def _ramp_s(self, channel: int, change_s: float) -> float:
        """Return the duration of a change: even, or speeding up and slowing down, or both."""
        quarters = change_s / QUARTER_US
        speed = self._limits.get((0x87, channel), 0) / SPEED_S or math.inf
        acceleration = self._limits.get((0x89, channel), 0) / ACCELERATION_S2 or math.inf
        if math.isinf(acceleration):
            return quarters / speed
        if quarters < speed**2 / acceleration:
            return 2 * math.sqrt(quarters / acceleration)
        return quarters / speed + speed / acceleration

    def _width_s(self, channel: int) -> float:
        *earlier, last = self._pulses[channel]
        if not (earlier and self._is_ramping(channel)):
            return last.width_s
        progress = (self._clock.now() - last.at_s) / last.ramp_s
        return earlier[-1].width_s + progress * (last.width_s - earlier[-1].width_s)

    def _is_ramping(self, channel: int) -> bool:
        last = self._pulses[channel][-1]
        return self._clock.now() < last.at_s + last.ramp_s

    def _check_time_out(self) -> None:
        silent_until_s = self._heard_s + self._time_out_s
        if self._clock.now() > silent_until_s:
            self._err(TIME_OUT_ERROR, silent_until_s)

    def _err(self, error: int, at_s: float) -> None:
        self._errors |= error
        self._go_home(at_s)

    def _go_home(self, at_s: float) -> None:
        for channel, pulses in self._pulses.items():
            home_s = self._homes.get(channel, 0.0)
            if pulses[-1].width_s != home_s:
                pulses.append(Pulse(at_s, home_s, 0.0))
