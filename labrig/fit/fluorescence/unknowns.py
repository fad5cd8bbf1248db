"""Unknowns of a surface of one kind, reflectance or the excitation of a dye, before the values."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

#: Variance of the excitation, relative to its largest, below which it is 0.
LEAST_VARIANCE = 1e-3
#: Added to prior covariances, relative to their largest variance.
JITTER = 1e-6
#: The same of a covariance of 0.
TINY = 1e-20


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Design (n, p), mean (p,) and root of the precision (p, p) of unknowns, and their place.

    Attributes
    ----------
    design
        Values by the unknowns, shape (n, p).
    mean, precision_root
        Mean (p,), and W with W Wᵀ the inverse of the covariance (p, p).
    used
        Places of the unknowns among all wavelengths, shape (p,).
    """

    design: FloatArray
    mean: FloatArray
    precision_root: FloatArray
    used: NDArray[np.intp]

    @classmethod
    def normal(cls, design: FloatArray, mean: float, covariance: FloatArray) -> Self:
        """Return the unknowns of a design (n, q) that vary enough, of covariance (q, q)."""
        variance = np.diag(covariance)
        used = np.flatnonzero(variance > LEAST_VARIANCE * variance.max())
        root = covariance_root(covariance[np.ix_(used, used)])
        inverse = np.asarray(np.linalg.inv(root).T)
        return cls(design[:, used], np.full(len(used), mean), inverse, used)

    def of_amplitude(self, amplitude: float) -> Self:
        """Return the unknowns with a standard deviation so many times as large."""
        return replace(self, precision_root=self.precision_root / amplitude)


def covariance_root(covariance: FloatArray) -> FloatArray:
    """Return a lower triangle L with L Lᵀ a covariance and a hint of independent variance."""
    jitter = (JITTER * float(np.diag(covariance).max()) + TINY) * np.eye(len(covariance))
    return np.asarray(np.linalg.cholesky(covariance + jitter))
