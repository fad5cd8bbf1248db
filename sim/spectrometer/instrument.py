"""A USB2000+ behind its endpoints: commands of one byte and their answers.

It integrates all the time: a spectrum that is asked for is that of the integration under way, which
may have begun before. Light on the detector's pixels becomes counts of 16 bits. Sources: Ocean
Optics' USB2000+ Data Sheet, section "USB Commands"; for the sizes, the same (signal to noise 250:1
at full signal, dark noise 50 counts, 2048 pixels) and users' spectra of its ILX511B.
"""

import math
import struct
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.clock import Clock

from ..lamp import WAVELENGTH_NM

PIXELS, FULL = 2048, 65535
#: Coefficients of the wavelength over the pixel's place, as its EEPROM has them.
WAVELENGTH_TEXTS = ("2.700000e+02", "3.800000e-01", "-1.30000e-05", "-2.5000e-10")
#: Coefficients of the relative response over the counts above the electric dark.
NONLINEARITY_TEXTS = ("9.000000e-01", "4.000000e-06", "-4.00000e-11")
#: Pixels in front of the first lit one, which are electrically connected and have no well.
FIRST_LIT = 21
#: Offset in counts, its change from one spectrum to the next, and the noise of a reading (1 σ).
OFFSET, OFFSET_DRIFT, READ_NOISE = 1500.0, 12.0, 45.0
#: Scatter of the offset from pixel to pixel, in counts, and that of the response.
FIXED_PATTERN, RESPONSE_SCATTER = 15.0, 0.01
#: Dark current in counts per second.
DARK_PER_S = 40.0
#: Variance per count of light: of 62 500 electrons in a full well.
SHOT_NOISE = FULL / 62_500
#: Counts per second and unit of the room's irradiance where the response is highest.
COUNTS_PER_S = 150_000.0
#: Irradiance in W m⁻² nm⁻¹ of the room's unit, which is that of the warm lamp at 560 nm.
UNIT_IRRADIANCE = 0.05
#: Peak and widths below and above it, in nm, of the response.
PEAK_NM, BELOW_NM, ABOVE_NM = 520.0, 170.0, 260.0


def wavelengths_nm() -> FloatArray:
    """Return the true wavelength of each pixel in nm, shape (2048,), as its EEPROM has it."""
    powers = [float(text) for text in WAVELENGTH_TEXTS]
    return np.asarray(np.polynomial.polynomial.polyval(np.arange(PIXELS), powers), np.float64)


class Detector:
    """Pixels with their scatter.

    Parameters
    ----------
    rng
        Random generator of what differs from pixel to pixel.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.wavelength_nm = wavelengths_nm()
        lit = np.arange(PIXELS) >= FIRST_LIT
        width_nm = np.where(self.wavelength_nm < PEAK_NM, BELOW_NM, ABOVE_NM)
        shape = 1 / (1 + ((self.wavelength_nm - PEAK_NM) / width_nm) ** 4)
        self.response: FloatArray = np.where(
            lit, shape * rng.normal(1.0, RESPONSE_SCATTER, PIXELS), 0.0
        )
        self._offset = np.where(lit, rng.normal(0.0, FIXED_PATTERN, PIXELS), 0.0)
        self._dark_per_s = np.where(lit, DARK_PER_S * rng.gamma(4.0, 0.25, PIXELS), 0.0)

    def irradiance_per_count_rate(self) -> FloatArray:
        """Return the true irradiance in W m⁻² nm⁻¹ for one linear count per second."""
        with np.errstate(divide="ignore"):
            factor: FloatArray = UNIT_IRRADIANCE / (COUNTS_PER_S * self.response)
        return factor

    def linear_counts(self, exposure: FloatArray) -> FloatArray:
        """Return the counts of light alone that a linear detector would have.

        Parameters
        ----------
        exposure : ndarray, shape (grid,)
            ∫ irradiance dt on the room's grid, in the room's units.
        """
        light = np.interp(self.wavelength_nm, WAVELENGTH_NM, exposure, left=0.0, right=0.0)
        counts: FloatArray = COUNTS_PER_S * self.response * light
        return counts

    def counts(
        self, exposure: FloatArray, integration_s: float, rng: np.random.Generator
    ) -> NDArray[np.uint16]:
        """Return one spectrum as it leaves the converter, shape (2048,)."""
        linear = self.linear_counts(exposure) + self._dark_per_s * integration_s
        noisy = linear + rng.normal(0.0, np.sqrt(SHOT_NOISE * linear))
        offset = OFFSET + rng.normal(0.0, OFFSET_DRIFT) + self._offset
        read = _response(noisy) + offset + rng.normal(0.0, READ_NOISE, PIXELS)
        return np.clip(np.rint(read), 0, FULL).astype(np.uint16)


def _response(linear: FloatArray) -> FloatArray:
    """Return counts that, over their relative response, are the linear ones."""
    powers = [float(text) for text in NONLINEARITY_TEXTS]
    counts = linear.copy()
    for _ in range(60):
        before = counts
        counts = linear * np.polynomial.polynomial.polyval(np.clip(counts, 0, FULL), powers)
        if np.array_equal(counts, before):
            break
    return counts


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
