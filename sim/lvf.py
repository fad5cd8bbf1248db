"""The linear variable filter: place of its strip in the picture, and transmittance along it.

As of a real filter, its pass band is no Gaussian: flatter on top, steeper at its sides, with a
shoulder towards long wavelengths; its wavelength is not quite linear along the strip.
"""

import math
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d

from labrig.foundation.arrays import FloatArray, IntArray
from labrig.foundation.region import Region, region_pixels

from .bench_settings import LvfSettings, StripSettings
from .lamp import WAVELENGTH_NM

#: The strip is made of so many evenly wide pieces: less than 1 nm each, whatever the sensor.
PIECES = 400

#: Order of the pass band's exponential; 2 would be a Gaussian.
ORDER = 2.4
#: Height of the shoulder, its distance and width in widths of the pass band.
SHOULDER, SHOULDER_AWAY, SHOULDER_WIDE = 0.03, 0.8, 1.2
#: Widths at the ends of the strip, of that in its middle.
WIDTHS = (0.92, 1.08)
#: Transmission of the pass band at blue end, in the middle and at the red end.
PEAKS = (0.42, 0.58, 0.52)
#: Fraction of the bend that has one turn more.
WIGGLE = 0.15


class Lvf:
    """The filter itself, and its two places.

    Parameters
    ----------
    settings
        Settings of the filter.
    """

    def __init__(self, settings: LvfSettings) -> None:
        self._settings = settings

    def centre_nm(self, u: FloatArray) -> FloatArray:
        """Return the middle of the pass band from the blue end, u = 0, to the red end, u = 1."""
        blue, red = self._settings.centre
        bend = np.sin(np.pi * u) + WIGGLE * np.sin(2 * np.pi * u)
        centre: FloatArray = blue + (red - blue) * u + self._settings.bend_nm * bend
        return centre

    def transmission(self, u: FloatArray, wavelength_nm: FloatArray = WAVELENGTH_NM) -> FloatArray:
        """Return T(λ) at some places (p,) and wavelengths (n,), shape (p, n)."""
        fwhm_nm = self._settings.fwhm_nm * np.interp(u, [0.0, 1.0], WIDTHS)[:, None]
        x = 2 * (wavelength_nm - self.centre_nm(u)[:, None]) / fwhm_nm
        # The two together are 1 high and, at half of that, `fwhm_nm` wide to within 1 %.
        main = np.exp(-math.log(2) * np.abs(x) ** ORDER)
        shoulder = np.exp(-math.log(2) * ((x - 2 * SHOULDER_AWAY) / SHOULDER_WIDE) ** 2)
        peak = np.interp(u, [0.0, 0.5, 1.0], PEAKS)[:, None]
        band = peak * (main + SHOULDER * shoulder) / (1 + SHOULDER)
        leakage = self._settings.leakage
        passed: FloatArray = leakage + (1 - leakage) * band
        return passed

    def seen(self, strip: StripSettings, turned: bool) -> FloatArray:
        """Return T(λ) of all pieces of a strip from left to right, the holder's before them.

        Returns
        -------
        ndarray, shape (1 + PIECES, wavelengths)
            Transmittance on `WAVELENGTH_NM`.
        """
        rising, falling = self._rising, self._rising[::-1]
        pieces = rising if strip.rising != turned else falling
        return np.concatenate([np.zeros((1, pieces.shape[1])), pieces])

    def below(self, strip: StripSettings, turned: bool) -> FloatArray:
        """Return the light on the sample below all pieces of a strip, shaped as by `seen`."""
        passed = self.seen(strip, turned)
        if self._settings.spread:
            width = self._settings.spread * PIECES
            passed[1:] = gaussian_filter1d(passed[1:], width, axis=0, mode="nearest")
        return passed

    @cached_property
    def _rising(self) -> FloatArray:
        return self.transmission((np.arange(PIECES) + 0.5) / PIECES)


def pieces(strip: StripSettings, width: int, height: int) -> IntArray:
    """Return the piece of a strip before each pixel, as in `Lvf.seen`, shape (height, width).

    Raises
    ------
    UsageError
        The strip leaves the frame.
    """
    region_pixels(strip.region, width, height)
    x, y, wide, high = in_pixels(strip.region, width, height)
    along = math.radians(strip.tilt)
    from_x = np.arange(width) + 0.5 - (x + wide / 2)
    from_y = (np.arange(height) + 0.5 - (y + high / 2))[:, None]
    u = (from_x * math.cos(along) + from_y * math.sin(along)) / wide + 0.5
    v = (from_y * math.cos(along) - from_x * math.sin(along)) / high + 0.5
    inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    piece: IntArray = np.where(inside, 1 + np.floor(u * PIECES).astype(np.intp), 0)
    return piece


def in_pixels(region: Region, width: int, height: int) -> tuple[float, float, float, float]:
    """Return a region in pixels, not rounded."""
    x, y, wide, high = region
    if max(region) > 1:
        return region
    return x * width, y * height, wide * width, high * height
