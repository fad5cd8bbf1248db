"""The shape of what a bandpass filter lets through."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from labrig.optics.piecewise import FloatArray

#: Below this skewness the limit, a Gaussian, is as exact.
_GAUSSIAN = 1e-9
_LN2 = float(np.log(2.0))


def peak_shape(distance_nm: FloatArray, fwhm_nm: ArrayLike, skew: ArrayLike) -> FloatArray:
    """A skewed Gaussian of height 1.

    exp(−ln 2 · [ln(1 + 2 a x / w) / a]²) with a = `skew` and w so that the full width at half
    maximum is `fwhm_nm`; a > 0 reaches further to long wavelengths, a = 0 is a Gaussian (Fraser
    and Suzuki, *Resolution of overlapping absorption bands by least squares procedures*, Anal.
    Chem. 38, 1966).

    Parameters
    ----------
    distance_nm
        λ minus that of the peak.
    fwhm_nm, skew
        Broadcast against `distance_nm`.
    """
    a = np.asarray(skew, dtype=np.float64)
    skewed = np.abs(a) > _GAUSSIAN
    a = np.where(skewed, a, 1.0)
    width = np.asarray(fwhm_nm, dtype=np.float64) * np.where(skewed, a / np.sinh(a), 1.0)
    x = 2 * distance_nm / width
    inside = 1 + a * x > 0
    stretched = np.where(skewed, np.log1p(np.where(inside, a * x, 0.0)) / a, x)
    shape: FloatArray = np.where(~skewed | inside, np.exp(-_LN2 * stretched**2), 0.0)
    return shape


@dataclass(frozen=True, eq=False)
class Bands:
    """Pass bands of a filter at some positions, every array of shape (positions,).

    Attributes
    ----------
    centre_nm
        Wavelength of highest transmission.
    fwhm_nm
        Full width at half maximum, above the leakage.
    skew
        As in `peak_shape`.
    peak
        Transmission at the centre, above the leakage.
    leakage
        Transmission everywhere else.
    """

    centre_nm: FloatArray
    fwhm_nm: FloatArray
    skew: FloatArray
    peak: FloatArray
    leakage: FloatArray

    def transmission(self, wavelength_nm: FloatArray) -> FloatArray:
        """T_p(λ) at (q,) wavelengths, shape (positions, q)."""
        distance = wavelength_nm - self.centre_nm[:, np.newaxis]
        shape = peak_shape(distance, self.fwhm_nm[:, np.newaxis], self.skew[:, np.newaxis])
        return self.leakage[:, np.newaxis] + self.peak[:, np.newaxis] * shape

    def between(self, position: FloatArray, wanted: FloatArray) -> Self:
        """The bands at `wanted` positions, every figure interpolated along `position`."""
        return type(self)(
            *(np.interp(wanted, position, getattr(self, field.name)) for field in fields(self))
        )
