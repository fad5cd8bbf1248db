"""The sensor: from photo-electrons to a mosaic of 14-bit numbers with all its defects.

Values are chosen: typical of a full-format DSLR of the EOS 5D Mark II's generation, whose read
noise falls steeply up to ISO 1600. They are not a measurement of a specimen.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, FloatArray

Mosaic = NDArray[np.uint16]
#: Function of the time in seconds since 1970.
Course = Callable[[float], float]
#: Function of begin and length of an exposure.
ExposureCourse = Callable[[float, float], float]

#: Colour channel (0 R, 1 G, 2 B) of the four places of a Bayer cell, row by row.
BAYER_RGGB = (0, 1, 1, 2)

BLACK_DN = 1024
#: What the file calls white: a bit below where the signal really stops, as Canon's does.
WHITE_DN = 15_600
SATURATION_DN = 15_760
MAX_DN = 16_383


class Levels(NamedTuple):
    """Black and white as the file has them, and the highest number in it."""

    black_dn: int
    white_dn: int
    highest_dn: int


RECORDED = Levels(BLACK_DN, WHITE_DN, MAX_DN)
#: Of a camera that subtracts its black level before it writes the file.
SUBTRACTED = Levels(0, WHITE_DN - BLACK_DN, MAX_DN - BLACK_DN)

#: Electrons a DN at ISO 100.
GAIN_ISO_100 = 4.2
READ_NOISE_ISO = (100, 200, 400, 800, 1600, 3200, 6400)
READ_NOISE_ELECTRONS = (27.8, 15.0, 8.1, 5.0, 3.1, 2.5, 2.4)

#: Pixel response non-uniformity, offset noise of pixels and of columns (1 σ).
PRNU = 0.006
PIXEL_OFFSET_DN = 0.6
COLUMN_OFFSET_DN = 0.4

#: Dark current of an ordinary pixel at the ambient temperature, and its growth.
DARK_ELECTRONS_PER_S = 0.08
AMBIENT_C = 21.0
DOUBLING_C = 6.0
#: A warm pixel has this many times the ordinary dark current (log-normal: median, σ of ln).
HOT_FRACTION = 1e-4
HOT_MEDIAN = 3000.0
HOT_SIGMA = 1.2

#: The camera warms by itself, from being switched on at the epoch, and by exposing.
SELF_HEATING_C = 7.0
SELF_HEATING_S = 600.0
HEATING_C_PER_EXPOSED_S = 0.01

#: From here on a normal variate bent to Poisson's skewness will do: the steps of single electrons
#: vanish in the read noise.
MANY_ELECTRONS = 4.0
#: Probability of a number of electrons that no pixel will show, near the steps of float32 at 1.
NEVER = 2.0**-25


def gain_electrons_per_dn(iso: float) -> float:
    """Return the conversion at an ISO setting; amplification is exactly proportional to ISO."""
    return GAIN_ISO_100 * 100.0 / iso


def read_noise_electrons(iso: float) -> float:
    """Return 1 σ of reading a pixel, in electrons."""
    logarithm = np.interp(math.log(iso), np.log(READ_NOISE_ISO), np.log(READ_NOISE_ELECTRONS))
    return math.exp(logarithm)


class SensorTemperature:
    """Temperature of the silicon, which every exposure raises a little."""

    def __init__(self) -> None:
        self._exposures_s: dict[float, float] = {}

    def expose(self, start_s: float, exposure_s: float) -> float:
        """Return the temperature in degrees Celsius at the middle of an exposure."""
        self._exposures_s[start_s] = exposure_s
        middle_s = start_s + exposure_s / 2
        itself_c = SELF_HEATING_C * -math.expm1(-middle_s / SELF_HEATING_S)
        exposing_c = sum(
            HEATING_C_PER_EXPOSED_S * exposed_s * math.exp((began_s - middle_s) / SELF_HEATING_S)
            for began_s, exposed_s in self._exposures_s.items()
            if began_s <= start_s
        )
        return AMBIENT_C + itself_c + exposing_c


class Sensor:
    """One specimen of a sensor, with fixed random defects.

    Parameters
    ----------
    rng
        Random generator of the fixed maps.
    falloff : ndarray, shape (height, width)
        Vignetting of the lens.
    flicker
        Standard deviation of all light between frames: shutter, aperture, lamp.
    crosstalk
        Fraction of a pixel's charge that appears in each of its four neighbours instead:
        capacitance between pixels, which blurs the noise with the picture (A. C. Moore, Z. Ninkov,
        W. J. Forrest, Optical Engineering 45, 2006).
    row_noise
        Standard deviation of the offset that all pixels of a row share, in multiples of a pixel's
        read noise.
    nonlinearity
        Fraction of the signal that is missing near saturation, of a smaller one in proportion less.
    flicker_course
        Function of a frame's time that returns its flicker, in multiples of `flicker`; None: every
        frame has one of its own.
    ripple
        Function of an exposure's begin and length that returns the relative change of its light by
        a periodic gain; None: none.
    black_course_dn
        Function of a frame's time that returns the wander of its black level in DN.
    subtracts_black
        Whether the camera subtracts its black level before it writes the file, and cuts off at 0
        what noise has below it, as a Nikon D700.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        falloff: FloatArray,
        flicker: float,
        *,
        crosstalk: float = 0.0,
        row_noise: float = 0.0,
        nonlinearity: float = 0.0,
        flicker_course: Course | None = None,
        ripple: ExposureCourse | None = None,
        black_course_dn: Course | None = None,
        subtracts_black: bool = False,
    ) -> None:
        height, width = falloff.shape
        response = falloff * (1 + PRNU * rng.standard_normal((height, width)))
        self._response: Float32Array = response.astype(np.float32)
        offset = PIXEL_OFFSET_DN * rng.standard_normal((height, width))
        offset += COLUMN_OFFSET_DN * rng.standard_normal(width)
        self.levels = SUBTRACTED if subtracts_black else RECORDED
        self._zero_dn: Float32Array = (self.levels.black_dn + offset).astype(np.float32)
        count = round(HOT_FRACTION * height * width)
        self.hot_pixels: NDArray[np.intp] = rng.choice(height * width, count, replace=False)
        self._hot = HOT_MEDIAN * np.exp(HOT_SIGMA * rng.standard_normal(count))
        self._flicker = flicker
        self._crosstalk = crosstalk
        self._row_noise = row_noise
        self._nonlinearity = nonlinearity
        self._flicker_course = flicker_course
        self._ripple = ripple
        self._black_course_dn = black_course_dn

    def expose(
        self,
        light_electrons: Float32Array,
        exposure_s: float,
        iso: float,
        temperature_c: float,
        rng: np.random.Generator,
        at_s: float = 0.0,
    ) -> Mosaic:
        """Return one exposure, read out.

        Parameters
        ----------
        light_electrons : ndarray, shape (height, width)
            Expected photo-electrons in the middle of the lens, per pixel.
        exposure_s, iso
            Shutter time in seconds and sensitivity.
        temperature_c
            Temperature of the sensor in degrees Celsius.
        rng
            Random generator of this frame alone.
        at_s
            Time of the exposure in seconds since 1970, for what wanders.

        Returns
        -------
        ndarray of uint16, shape (height, width)
            Mosaic of the frame in DN.
        """
        gain = gain_electrons_per_dn(iso)
        flicker = rng.standard_normal()
        if self._flicker_course is not None:
            flicker = self._flicker_course(at_s)
        ripple = self._ripple(at_s, exposure_s) if self._ripple is not None else 0.0
        common = max(1 + self._flicker * flicker + ripple, 0.0)
        dark_e = DARK_ELECTRONS_PER_S * exposure_s * 2 ** ((temperature_c - AMBIENT_C) / DOUBLING_C)
        electrons = light_electrons * self._response
        electrons *= np.float32(common)
        electrons += np.float32(dark_e)
        electrons.reshape(-1)[self.hot_pixels] += (dark_e * self._hot).astype(np.float32)
        full_well = np.float32((SATURATION_DN - BLACK_DN) * gain)
        # More would be cut off below anyway; it only has to stay a finite number on the way.
        np.minimum(electrons, 4 * full_well, out=electrons)
        electrons = _shot_noise(electrons, rng)
        if self._nonlinearity:
            electrons *= 1 - np.float32(self._nonlinearity) / full_well * electrons
        np.minimum(electrons, full_well, out=electrons)
        if self._crosstalk:
            electrons = _shared_with_neighbours(electrons, self._crosstalk)
        electrons *= np.float32(1 / gain)
        noise = _standard_normal(electrons.shape, rng)
        if self._row_noise:
            rows = rng.standard_normal((len(noise), 1), dtype=np.float32)
            noise += np.float32(self._row_noise) * rows
        noise *= np.float32(read_noise_electrons(iso) / gain)
        electrons += noise
        electrons += self._zero_dn
        if self._black_course_dn is not None:
            electrons += np.float32(self._black_course_dn(at_s))
        electrons += np.float32(0.5)
        return np.clip(electrons, 0, self.levels.highest_dn).astype(np.uint16)


def _shared_with_neighbours(electrons: Float32Array, fraction: float) -> Float32Array:
    """Return each pixel less `fraction` for each of its four neighbours; the border repeats."""
    bordered = np.pad(electrons, 1, mode="edge")
    around = bordered[:-2, 1:-1] + bordered[2:, 1:-1] + bordered[1:-1, :-2] + bordered[1:-1, 2:]
    shared: Float32Array = electrons * np.float32(1 - 4 * fraction) + np.float32(fraction) * around
    return shared


def _shot_noise(expected: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Return random numbers of electrons with expectation `expected`: Poisson's distribution.

    For many electrons by Cornish and Fisher's expansion, λ + √(λ − 1/18) z + (z² − 1)/6, which has
    the mean, the variance and the third moment of the Poisson distribution.
    """
    is_bright = expected >= MANY_ELECTRONS
    if is_bright.all():
        return _many(expected, rng)
    if not is_bright.any():
        return _few(expected.reshape(-1), rng).reshape(expected.shape)
    arrived: Float32Array = np.empty_like(expected)
    arrived[is_bright] = _many(expected[is_bright], rng)
    arrived[~is_bright] = _few(expected[~is_bright], rng)
    return arrived


def _many(expected: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Return numbers of electrons that are expected to be many."""
    z = _standard_normal(expected.shape, rng)
    arrived: Float32Array = np.sqrt(expected - np.float32(1 / 18))
    arrived *= z
    arrived += expected
    z *= z
    z -= np.float32(1)
    z *= np.float32(1 / 6)
    arrived += z
    return arrived


def _standard_normal(shape: tuple[int, ...], rng: np.random.Generator) -> Float32Array:
    """Return standard normal random numbers, which OpenCV draws in a quarter of NumPy's time."""
    numbers: Float32Array = np.empty(shape, dtype=np.float32)
    cv2.setRNGSeed(int(rng.integers(2**31)))
    cv2.randn(numbers, np.zeros(1), np.ones(1))
    return numbers


def _few(expected: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Return numbers of electrons that are expected to be few, shape (n,).

    Inversion by sequential search (L. Devroye, Non-Uniform Random Variate Generation, 1986, X.3.3),
    in all pixels at once that have more electrons than were counted so far.
    """
    arrived: Float32Array = np.zeros_like(expected)
    probability: Float32Array = -expected
    np.exp(probability, out=probability)
    beyond: Float32Array = rng.random(expected.shape, dtype=np.float32)
    beyond -= probability
    more = pixels = np.flatnonzero(beyond >= 0)
    electrons = 0
    while more.size and probability.max() > NEVER:
        electrons += 1
        arrived[pixels] = electrons
        expected, probability, beyond = expected[more], probability[more], beyond[more]
        probability *= expected / np.float32(electrons)
        beyond -= probability
        more = np.flatnonzero(beyond >= 0)
        pixels = pixels[more]
    return arrived
