"""From the place along a variable filter to a wavelength."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from labrig.optics.piecewise import FloatArray

#: Points at which a map is tested, and between which it is inverted.
_SAMPLES = 2049


@dataclass(frozen=True, eq=False)
class WavelengthMap:
    """λ(u) = Σ_k c_k ((u − u_0)/s)^k along a strip.

    Parameters
    ----------
    coefficients
        c, shape (k,), in nm, the constant first.
    span
        First and last position where the map holds: u_0 is their middle, s half their distance.
    covariance
        Of the coefficients, shape (k, k), in nm².

    Raises
    ------
    ValueError
        A map that does not rise or fall all the way within `span`.
    """

    coefficients: FloatArray
    span: tuple[float, float]
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        steps = np.diff(self.wavelength_nm(np.linspace(*self.span, _SAMPLES)))
        if not ((steps > 0).all() or (steps < 0).all()):
            raise ValueError(
                "the wavelength does not rise or fall all the way along the strip; check which "
                "lines were taken for which"
            )

    @property
    def rising(self) -> bool:
        """Whether the wavelength grows with the position."""
        first, last = self.wavelength_nm(np.array(self.span))
        return bool(last > first)

    def wavelength_nm(self, position: ArrayLike) -> FloatArray:
        """Centre wavelengths at some positions."""
        return self._powers(position) @ self.coefficients

    def sigma_nm(self, position: ArrayLike) -> FloatArray:
        """One standard deviation of `wavelength_nm`, 0 where no covariance is known."""
        powers = self._powers(position)
        if self.covariance is None:
            return np.zeros(len(powers))
        variance: FloatArray = np.einsum("pk,kl,pl->p", powers, self.covariance, powers)
        return np.sqrt(np.maximum(variance, 0.0))

    def position(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Where some wavelengths are, by Newton's method from a table.

        Raises
        ------
        ValueError
            A wavelength that is not on the strip.
        """
        wanted = np.atleast_1d(np.asarray(wavelength_nm, dtype=np.float64))
        places = np.linspace(*self.span, _SAMPLES)
        known = self.wavelength_nm(places)
        if wanted.min() < known.min() or wanted.max() > known.max():
            raise ValueError(
                f"expected wavelengths from {known.min():.1f} to {known.max():.1f} nm, which the "
                f"strip shows, got {wanted.min():.1f} to {wanted.max():.1f}"
            )
        order = slice(None) if self.rising else slice(None, None, -1)
        position = np.interp(wanted, known[order], places[order])
        for _ in range(2):
            position = position - (self.wavelength_nm(position) - wanted) / self._slope(position)
        return position

    def _scaled(self, position: ArrayLike) -> FloatArray:
        low, high = self.span
        u = np.atleast_1d(np.asarray(position, dtype=np.float64))
        return (u - (low + high) / 2) / ((high - low) / 2)

    def _powers(self, position: ArrayLike) -> FloatArray:
        return np.vander(self._scaled(position), len(self.coefficients), increasing=True)

    def _slope(self, position: FloatArray) -> FloatArray:
        low, high = self.span
        orders = np.arange(1, len(self.coefficients))
        lower = self._powers(position)[:, :-1]
        slope: FloatArray = lower @ (orders * self.coefficients[1:]) / ((high - low) / 2)
        return slope
