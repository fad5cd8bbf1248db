"""One axis of a mixture's components: a normal variate of the wavelength, skewed or not.

Emission and excitation are steep on one side and have a tail on the other. The sinh-arcsinh
transformation of Jones and Pewsey (*Sinh-arcsinh distributions*, Biometrika 96, 2009), with tails
as light as normal ones, makes a normal density so, and keeps conditionals, distribution functions
and samples in closed form. Here it is shifted and scaled so that the median stays where it is, and
the density near it as wide as it was.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Margin:
    """A standard normal variate u of a wavelength, for each of K components.

    Attributes
    ----------
    median_nm
        Wavelength at which u is 0, shape (K,).
    sd_nm
        Standard deviation in nm without skew; with it 1 / (du/dλ) at the median, shape (K,).
    skew
        Half the logarithm of the far widths' ratio, long over short wavelengths: above 0 the tail
        is at long wavelengths, 0 is a normal density, shape (K,).
    """

    median_nm: FloatArray
    sd_nm: FloatArray
    skew: FloatArray

    def variate(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return u of wavelengths (…, 1) or (…, K), shape (…, K)."""
        y = self._stretched(wavelength_nm)
        return np.asarray(y * self._cosh - np.sqrt(1 + y * y) * self._sinh)

    def log_rate(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return log of du/dλ in 1/nm, shape (…, K)."""
        y = self._stretched(wavelength_nm)
        slope = self._cosh * (self._cosh - self._sinh * y / np.sqrt(1 + y * y))
        return np.asarray(np.log(slope / self.sd_nm))

    def variate_rise(self, start_nm: FloatArray, rise_nm: FloatArray) -> FloatArray:
        """Return u(start + rise) − u(start), exact however small the rise."""
        first, step = self._stretched(start_nm), rise_nm / self.sd_nm * self._cosh
        return np.asarray(step * (self._cosh - self._sinh * _mean_slope(first, first + step)))

    def wavelength_rise(self, start_nm: FloatArray, rise: FloatArray) -> FloatArray:
        """Return how far above `start_nm` the variate is higher by `rise`, in nm."""
        first = self.variate(start_nm)
        step = rise * (self._cosh + self._sinh * _mean_slope(first, first + rise))
        return np.asarray(step / self._cosh * self.sd_nm)

    def chosen(self, component: NDArray[np.intp]) -> "Margin":
        """Return the margins of some components, in the shape of their indices."""
        return Margin(self.median_nm[component], self.sd_nm[component], self.skew[component])

    @property
    def _cosh(self) -> FloatArray:
        return np.asarray(np.cosh(self.skew))

    @property
    def _sinh(self) -> FloatArray:
        return np.asarray(np.sinh(self.skew))

    def _stretched(self, wavelength_nm: FloatArray) -> FloatArray:
        return (wavelength_nm - self.median_nm) / self.sd_nm * self._cosh + self._sinh


def _mean_slope(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the mean slope of √(1 + y²) between two places."""
    both = np.sqrt(1 + first * first) + np.sqrt(1 + second * second)
    return np.asarray((first + second) / both)
