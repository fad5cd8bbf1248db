"""A USB2000+ behind its endpoints: commands of one byte and their answers.

It integrates all the time: a spectrum that is asked for is that of the integration under way, which
may have begun before. Source: Ocean Optics' USB2000+ Data Sheet, section "USB Commands".
"""

import math
import struct
from collections.abc import Callable

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.clock import Clock

from .detector import FULL, NONLINEARITY_TEXTS, PIXELS, WAVELENGTH_TEXTS, Detector

#: Endpoints: commands, answers, spectra.
COMMANDS, ANSWERS, SPECTRA = 0x01, 0x81, 0x82
SLOT_BYTES = 15
SYNCHRONISATION = b"\x69"
#: Firmware 2.05.0 in the bits of register 4.
FIRMWARE_REGISTER, FIRMWARE = 0x04, 0x2050
FIRST_INTEGRATION_S = 0.1
HIGH_SPEED = 0x80
#: Time after the end of an integration until the spectrum can be read.
READOUT_S = 1e-3


class UsbSpectrometer:
    """The instrument's state and its answers.

    Parameters
    ----------
    clock
        The room's clock.
    exposure
        Function that returns ∫ irradiance dt of the light between two times of that clock, on the
        room's grid, as a white reference has it.
    detector
        Its detector.
    serial_number
        Serial number in its EEPROM.
    seed
        Seed of the noise.
    """

    def __init__(
        self,
        clock: Clock,
        exposure: Callable[[float, float], FloatArray],
        detector: Detector,
        serial_number: str,
        seed: tuple[int, ...],
    ) -> None:
        self._clock = clock
        self._exposure = exposure
        self._detector = detector
        self._seed = seed
        polynomial = dict(enumerate(NONLINEARITY_TEXTS, start=6))
        self._slots = {
            0: serial_number,
            **dict(enumerate(WAVELENGTH_TEXTS, start=1)),
            5: "0.0",
            **polynomial,
            14: str(len(polynomial) - 1),
            15: "25",
        }
        self.reset()

    def reset(self) -> None:
        """Restore the state after plugging in."""
        self._integration_s = FIRST_INTEGRATION_S
        self._since_s = self._clock.now()
        self._answers: list[bytes] = []
        self._asked_s: list[float] = []

    def write(self, command: bytes) -> None:
        """Obey a command, and keep its answer for the endpoint; unknown ones have none."""
        match command[:1]:
            case b"\x01":
                self.reset()
            case b"\x02" if len(command) == 5:
                self._integration_s = int.from_bytes(command[1:], "little") * 1e-6
                self._since_s = self._clock.now()
            case b"\x05" if len(command) == 2:
                self._answers.append(command + self._slot(command[1]))
            case b"\x09":
                self._asked_s.append(self._clock.now())
            case b"\x6b" if len(command) == 2:
                value = FIRMWARE if command[1] == FIRMWARE_REGISTER else 0
                self._answers.append(struct.pack("<BH", command[1], value))
            case b"\xfe":
                microseconds = round(self._integration_s * 1e6)
                status = struct.pack("<HLBBBB", PIXELS, microseconds, 0, 0, 0, 15)
                self._answers.append(status + bytes((1, 0, 0, 0, HIGH_SPEED, 0)))

    def due_s(self, endpoint: int) -> float:
        """Return the time from which an endpoint has something to read; infinity if it has not."""
        if endpoint == ANSWERS:
            return self._clock.now() if self._answers else math.inf
        if endpoint == SPECTRA and self._asked_s:
            return self._integration_of(self._asked_s[0])[1] + READOUT_S
        return math.inf

    def read(self, endpoint: int) -> bytes:
        """Return what an endpoint has, once it is due."""
        if endpoint == ANSWERS:
            return self._answers.pop(0)
        begin_s, end_s = self._integration_of(self._asked_s.pop(0))
        rng = np.random.default_rng([*self._seed, round(self._clock.wall(begin_s) * 1e6)])
        exposure = self._exposure(begin_s, end_s)
        counts = self._detector.counts(exposure, self._integration_s, rng)
        return counts.astype("<u2").tobytes() + SYNCHRONISATION

    def _integration_of(self, asked_s: float) -> tuple[float, float]:
        """Return begin and end of the integration that is under way at a time."""
        number = math.floor((asked_s - self._since_s) / self._integration_s)
        begin_s = self._since_s + number * self._integration_s
        return begin_s, begin_s + self._integration_s

    def _slot(self, number: int) -> bytes:
        if number == 17:  # binary: the counts at which it is saturated
            return struct.pack("<4xH9x", FULL)
        return self._slots.get(number, "").encode().ljust(SLOT_BYTES, b"\0")
