"""Curves over wavelength, each on the grid on which it was measured."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.optics.piecewise import band_means, edges_from_centres

#: Tolerance of measured fractions below 0 and above 1.
FRACTION_SLACK = 0.02


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Light per nm over wavelength (irradiance, radiance, emission), zero outside of its grid.

    Parameters
    ----------
    name
        Name of the lamp, the dye …
    wavelength_nm
        Rising wavelengths in nm, shape (n,), n ≥ 2.
    value
        Finite values per nm, shape (n,), piecewise linear in between.
    sigma
        One standard deviation of the values, shape (n,), where it is known.

    Raises
    ------
    ValueError
        Shapes disagree, wavelengths do not rise, or values are not finite.
    """

    name: str
    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None = None

    def __post_init__(self) -> None:
        check_curve(self.wavelength_nm, self.value, self.sigma)

    def at(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the value at some wavelengths in nm."""
        return np.interp(
            np.asarray(wavelength_nm, dtype=np.float64),
            self.wavelength_nm,
            self.value,
            left=0.0,
            right=0.0,
        )

    def in_bands(self, edges_nm: ArrayLike) -> FloatArray:
        """Average the spectrum between neighbouring `edges_nm`, shape (edges − 1,)."""
        return band_means(self.wavelength_nm, self.value, edges_nm)

    def resampled(self, wavelength_nm: ArrayLike) -> Self:
        """Average the spectrum about each of some rising wavelengths, half-way to the next.

        The integral is kept. σ is dropped, since the correlation of neighbouring errors is unknown.
        """
        grid = np.asarray(wavelength_nm, dtype=np.float64)
        return type(self)(self.name, grid, self.in_bands(edges_from_centres(grid)))


@dataclass(frozen=True, eq=False)
class Transmittance:
    """Fraction of the light that a filter transmits or a card reflects.

    Beyond its grid the outermost values continue.

    Parameters
    ----------
    name
        Name of the filter or the card.
    wavelength_nm
        Rising wavelengths in nm, shape (n,), n ≥ 2.
    value
        Fractions from 0 to 1, shape (n,), piecewise linear in between.
    sigma
        One standard deviation of the values, shape (n,), where it is known.

    Raises
    ------
    ValueError
        The curve is not valid as a `Spectrum`, or a value is no fraction.
    """

    name: str
    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None = None

    def __post_init__(self) -> None:
        check_curve(self.wavelength_nm, self.value, self.sigma)
        if self.value.min() < -FRACTION_SLACK or self.value.max() > 1 + FRACTION_SLACK:
            raise ValueError(
                f"expected fractions from 0 to 1, got {self.value.min():.4g} to "
                f"{self.value.max():.4g}; divide per cent by 100"
            )

    def at(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the fraction at some wavelengths in nm."""
        return np.interp(
            np.asarray(wavelength_nm, dtype=np.float64), self.wavelength_nm, self.value
        )

    def in_bands(self, edges_nm: ArrayLike) -> FloatArray:
        """Average the fraction between neighbouring `edges_nm`, shape (edges − 1,)."""
        edges = np.asarray(edges_nm, dtype=np.float64)
        knots = self.wavelength_nm
        # The outermost values go on until beyond the outermost edges.
        low, high = min(edges[0], knots[0]) - 1.0, max(edges[-1], knots[-1]) + 1.0
        extended_nm = np.concatenate([[low], knots, [high]])
        return band_means(extended_nm, self.at(extended_nm), edges)


def check_curve(wavelength_nm: FloatArray, value: FloatArray, sigma: FloatArray | None) -> None:
    """Raise ValueError if one curve (n,) or several curves (n, k) are invalid."""
    if wavelength_nm.ndim != 1 or len(wavelength_nm) < 2:
        raise ValueError("expected two or more wavelengths")
    if len(value) != len(wavelength_nm) or (sigma is not None and sigma.shape != value.shape):
        raise ValueError("expected one value for every wavelength")
    if not (np.isfinite(wavelength_nm).all() and np.isfinite(value).all()):
        raise ValueError("some value is infinite or NaN")
    if (np.diff(wavelength_nm) <= 0).any():
        raise ValueError("a wavelength stands twice, or they do not rise")
    if wavelength_nm[0] <= 0:
        raise ValueError("expected wavelengths above 0 nm")
    if sigma is not None and not (np.isfinite(sigma).all() and (sigma >= 0).all()):
        raise ValueError("some σ is negative or not finite")
