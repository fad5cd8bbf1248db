"""Values in units of their errors, and the prior of a smooth spectrum that explains them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from labrig.fit.spectrum.system import SpectralSystem
from labrig.foundation.arrays import FloatArray

#: Grid of weights of the prior, for a spectrum of about 1.
WEIGHTS = np.geomspace(1e-4, 1e8, 73)
#: Added to the curvature of the fit, for a spectrum of about 1.
MIN_CURVATURE = 1e-6
#: Distance in nm (1 σ) over which a spectrum is about as rough, rounds in which its roughness is
#: found, and second differences that the roughness of the whole counts as among those near by.
ROUGHNESS_NM = 8.0
ROUGHNESS_ROUNDS = 8
ROUGHNESS_OF_ALL = 0.1
#: Gain of log evidence from which a spectrum is rougher in one place than in another.
UNEVEN = 10.0


@dataclass(frozen=True, eq=False)
class Whitened:
    """Values in units of their errors, for a spectrum of about 1.

    Attributes
    ----------
    target, design
        Values (m,) and design (m, n) in units of the total error.
    knots_nm
        Knots in nm, shape (n,).
    lower
        Cholesky factor of the covariance, shape (m, m).
    """

    target: FloatArray
    design: FloatArray
    knots_nm: FloatArray
    lower: FloatArray

    @classmethod
    def of(
        cls,
        system: SpectralSystem,
        y: FloatArray,
        s: FloatArray,
        spectrum: FloatArray,
        scale: float,
    ) -> "Whitened":
        """Whiten values y with noise s and the design's errors for a spectrum, over a scale."""
        covariance = np.diag((s / scale) ** 2) + system.covariance(spectrum)
        lower = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        columns = np.column_stack([system.design, y / scale])
        solution = np.asarray(np.linalg.solve(lower, columns), dtype=np.float64)
        return cls(solution[:, -1], solution[:, :-1], system.knots_nm, lower)


@dataclass(frozen=True, eq=False)
class Prior:
    """Smoothness prior: its roughness matrix (n − 2, n)."""

    roughness: FloatArray

    @classmethod
    def on(cls, knots: int) -> "Prior":
        """Return the prior on evenly spaced knots."""
        return cls(np.diff(np.eye(knots), n=2, axis=0))

    def local(self, values: Whitened, weight: float, stiffest: float) -> "Prior":
        """Return the prior that is as rough in each place as the values have it there.

        The variance of second differences near by is the sum of their squares over the number of
        them that the values determine (MacKay, *Bayesian interpolation*, Neural Comput. 4, 1992).
        The least rough place has the roughness of this prior, others have more. So many variances
        fit noise, too: without decisive evidence for them all places stay alike.

        Parameters
        ----------
        values
            Values in units of their errors.
        weight
            Weight that suits all places together.
        stiffest
            Largest weight of a place.
        """
        knots = values.knots_nm[1:-1]
        near = np.exp(-(((knots - knots[:, np.newaxis]) / ROUGHNESS_NM) ** 2) / 2)
        information, linear = values.design.T @ values.design, values.design.T @ values.target
        variance = np.full(len(knots), 1 / weight)
        for _ in range(ROUGHNESS_ROUNDS):
            rows = self.roughness / np.sqrt(variance)[:, np.newaxis]
            covariance = np.linalg.inv(information + Prior(rows).precision(1.0))
            bend = self.roughness @ (covariance @ linear)
            left = np.einsum("ij,jk,ik->i", self.roughness, covariance, self.roughness)
            determined = np.clip(1 - left / variance, 0.0, 1.0)
            squares = near @ bend**2 + ROUGHNESS_OF_ALL / weight
            variance = squares / (near @ determined + ROUGHNESS_OF_ALL)
            variance = np.maximum(variance, 1 / stiffest)
        varied = self.roughness / np.sqrt(variance)[:, np.newaxis]
        even = self.roughness * np.sqrt(weight)
        gained = _evidence(information, linear, Prior(varied)) - _evidence(
            information, linear, Prior(even)
        )
        gained -= (np.log(variance).sum() + len(variance) * np.log(weight)) / 2
        if gained < UNEVEN:
            return self
        return Prior(self.roughness * np.sqrt(variance.min() / variance)[:, np.newaxis])

    def precision(self, weight: float) -> FloatArray:
        """Return the precision (n, n), with a ridge for what nothing else constrains."""
        matrix = weight * self.roughness.T @ self.roughness
        matrix.flat[:: len(matrix) + 1] += MIN_CURVATURE
        return matrix

    def log_determinant(self, weight: ArrayLike) -> FloatArray:
        """Return the logarithm of the precision's determinant, up to a constant."""
        result: FloatArray = len(self.roughness) * np.log(np.asarray(weight, dtype=np.float64))
        return result

    def log_evidence(self, values: Whitened) -> FloatArray:
        """Return the log evidence of each of `WEIGHTS` without lines, ignoring x ≥ 0."""
        information, linear = values.design.T @ values.design, values.design.T @ values.target
        log_evidence = np.empty(len(WEIGHTS))
        for number, weight in enumerate(WEIGHTS):
            lower = np.linalg.cholesky(information + self.precision(weight))
            along = solve_triangular(lower, linear, lower=True)
            log_determinant = 2 * float(np.log(np.diag(lower)).sum())
            log_evidence[number] = (along @ along - log_determinant) / 2
        return log_evidence + self.log_determinant(WEIGHTS) / 2


def _evidence(information: FloatArray, linear: FloatArray, prior: Prior) -> float:
    """Return the log evidence of a prior but for its own determinant."""
    lower = np.linalg.cholesky(information + prior.precision(1.0))
    along = solve_triangular(lower, linear, lower=True)
    return float(along @ along) / 2 - float(np.log(np.diag(lower)).sum())


def normalised(log_probability: FloatArray) -> FloatArray:
    """Return probabilities that add up to 1."""
    probability = np.exp(log_probability - log_probability.max())
    result: FloatArray = probability / probability.sum()
    return result
