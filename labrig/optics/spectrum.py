"""Curves over wavelength, each on the grid it was measured on."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from labrig.optics.piecewise import FloatArray, band_means, edges_about

#: Measured fractions stray this far below 0 and above 1.
FRACTION_SLACK = 0.02


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Light per nm over wavelength: irradiance, radiance, emission; zero outside of its grid.

    Parameters
    ----------
    name
        Of the lamp, the dye …
    wavelength_nm
        Shape (n,), n ≥ 2, rising.
    value
        Shape (n,), finite; straight lines in between.
    sigma
        Shape (n,), one standard deviation, where it is known.

    Raises
    ------
    ValueError
        Shapes that disagree, wavelengths that do not rise, values that are not finite.
    """

    name: str
    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None = None

    def __post_init__(self) -> None:
        check_curve(self.wavelength_nm, self.value, self.sigma)

    def at(self, wavelength_nm: ArrayLike) -> FloatArray:
        """The value at some wavelengths."""
        return np.interp(
            np.asarray(wavelength_nm, dtype=np.float64),
            self.wavelength_nm,
            self.value,
            left=0.0,
            right=0.0,
        )

    def in_bands(self, edges_nm: ArrayLike) -> FloatArray:
        """Mean over each band between neighbouring `edges_nm`, shape (edges − 1,)."""
        return band_means(self.wavelength_nm, self.value, edges_nm)

    def resampled(self, wavelength_nm: ArrayLike) -> Self:
        """Means about each of some rising wavelengths, half-way to its neighbours.

        What lies between the new wavelengths is kept: the integral stays. σ is not carried over;
        how the errors of neighbours hang together is not known.
        """
        grid = np.asarray(wavelength_nm, dtype=np.float64)
        return type(self)(self.name, grid, self.in_bands(edges_about(grid)))


@dataclass(frozen=True, eq=False)
class Transmittance:
    """Fraction of the light that a filter lets through, or a card throws back.

    Beyond its grid the outermost values go on: a filter does not end where its table does.

    Parameters
    ----------
    name
        Of the filter or the card.
    wavelength_nm
        Shape (n,), n ≥ 2, rising.
    value
        Shape (n,), 0 to 1; straight lines in between.
    sigma
        Shape (n,), one standard deviation, where it is known.

    Raises
    ------
    ValueError
        As for `Spectrum`, or a value that is no fraction.
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
        """The fraction at some wavelengths."""
        return np.interp(
            np.asarray(wavelength_nm, dtype=np.float64), self.wavelength_nm, self.value
        )

    def in_bands(self, edges_nm: ArrayLike) -> FloatArray:
        """Mean over each band between neighbouring `edges_nm`, shape (edges − 1,)."""
        edges = np.asarray(edges_nm, dtype=np.float64)
        knots = self.wavelength_nm
        # The outermost values go on until beyond the outermost edges.
        low, high = min(edges[0], knots[0]) - 1.0, max(edges[-1], knots[-1]) + 1.0
        wider = np.concatenate([[low], knots, [high]])
        return band_means(wider, self.at(wider), edges)


def check_curve(wavelength_nm: FloatArray, value: FloatArray, sigma: FloatArray | None) -> None:
    """Raise ValueError with what is wrong with a curve (n,) or several (n, k)."""
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
