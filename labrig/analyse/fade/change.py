"""A change of the lamp as it was found: shapes, how likely each is, and what they say of bands."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.fade.shapes import Shape, share_of

FloatArray = NDArray[np.float64]

#: Of σ, for derivatives.
STEP = 0.01


@dataclass(frozen=True, eq=False)
class Fit:
    """One shape's.

    Attributes
    ----------
    shape, parameters, covariance
        See `labrig.analyse.fade.shapes`.
    jitter_s
        Of the photographs' begins.
    chi2, dof, log_determinant
        Of the photographs, degrees of freedom, and of their covariance.
    """

    shape: Shape
    parameters: FloatArray
    covariance: FloatArray
    jitter_s: float
    chi2: float
    dof: int
    log_determinant: float

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom."""
        return self.chi2 / self.dof

    def in_bands(
        self, weights: FloatArray, nm: FloatArray, t_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """As `Change.in_bands`, of this shape alone."""
        share = share_of(self.shape, self.parameters, nm, t_s) @ weights.T
        slopes = []
        for number, step in enumerate(STEP * np.sqrt(np.diag(self.covariance))):
            moved = self.parameters.copy()
            moved[number] += step
            slopes.append((share_of(self.shape, moved, nm, t_s) @ weights.T - share) / step)
        slope = np.array(slopes)
        variance = np.einsum("ktb,kl,ltb->tb", slope, self.covariance, slope)
        return share, np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True, eq=False)
class Change:
    """A change of the lamp.

    Attributes
    ----------
    fits, likely
        Shapes that explain it, and how likely each is (Burnham and Anderson, *Model selection and
        multimodel inference*, 2002); sums to 1.
    """

    fits: tuple[Fit, ...]
    likely: FloatArray

    @property
    def best(self) -> Fit:
        """The likeliest."""
        return self.fits[int(np.argmax(self.likely))]

    @property
    def exponent(self) -> tuple[float, float]:
        """The power p and its σ."""
        return self._mean(-2)

    @property
    def lag_s(self) -> tuple[float, float]:
        """By which shutters open later than recorded, and its σ."""
        return self._mean(-1)

    def in_bands(
        self, weights: FloatArray, nm: FloatArray, t_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Share of the steady lamp's light after the switch, and σ, each (times, bands).

        Parameters
        ----------
        weights
            (bands, wavelengths) of the light at `nm` in every band; sums to 1.
        """
        shares, sigmas = zip(*(fit.in_bands(weights, nm, t_s) for fit in self.fits), strict=True)
        return self._averaged(np.array(shares), np.array(sigmas))

    def _mean(self, parameter: int) -> tuple[float, float]:
        values = np.array([fit.parameters[parameter] for fit in self.fits])
        sigmas = [np.sqrt(fit.covariance[parameter, parameter]) for fit in self.fits]
        mean, sigma = self._averaged(values, np.array(sigmas))
        return float(mean), float(sigma)

    def _averaged(self, values: FloatArray, sigmas: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Over the fits, first axis; σ holds what they disagree by."""
        mean = np.tensordot(self.likely, values, axes=1)
        variance = np.square(sigmas) + np.square(values - mean)
        return mean, np.sqrt(np.tensordot(self.likely, variance, axes=1))
