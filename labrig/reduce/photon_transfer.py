"""The photon-transfer model: variance of a pixel by its level, and its fit.

Read noise adds the same variance at all levels, photons one in proportion to the level, and light
that is uneven or flickers unevenly one in proportion to its square (J. R. Janesick, *Photon
Transfer*, 2007; EMVA Standard 1288).
"""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares


@dataclass(frozen=True)
class NoiseModel:
    """Variance in DN² of a pixel, or of a mean over pixels, by its level in DN above black.

    Attributes
    ----------
    read_dn2
        Variance without light in DN², by read noise.
    photon_dn
        Photon noise in DN² per DN of light: the reciprocal of the gain in electrons per DN. A fit
        leaves it 0 where the levels do not determine it.
    uneven
        Variance per DN² of light, by uneven light.
    """

    read_dn2: float
    photon_dn: float
    uneven: float = 0.0

    @classmethod
    def fit(
        cls,
        terms: FloatArray,
        variance_dn2: FloatArray,
        sigma_dn2: FloatArray,
        read_dn2: float | None = None,
    ) -> "NoiseModel":
        """Fit the model, all parts ≥ 0, to measured variances by weighted least squares.

        Parameters
        ----------
        terms
            Terms of the model by `variance_terms`, shape (n, 2) or (n, 3); of a difference of
            frames, the sum of both frames' terms. With two terms there is no uneven part.
        variance_dn2
            Measured variances in DN², shape (n,).
        sigma_dn2
            Their standard uncertainties in DN², known up to a common factor, shape (n,). Without
            better knowledge, the expected variance serves as its uncertainty.
        read_dn2
            Variance measured without light in DN², which is then held; None fits it.
        """
        fixed_read_dn2 = 0.0 if read_dn2 is None else read_dn2
        free_terms = terms if read_dn2 is None else terms[:, 1:]
        target = variance_dn2 - fixed_read_dn2 * terms[:, 0]
        parts = nonnegative_least_squares(free_terms / sigma_dn2[:, np.newaxis], target / sigma_dn2)
        return cls(*([] if read_dn2 is None else [read_dn2]), *parts.tolist())

    def parts_dn2(self, level_dn: FloatArray) -> FloatArray:
        """Return the parts of the variance in DN² at levels (…,), shape (…, 3).

        The parts are those of reading, photons and uneven light.
        """
        return variance_terms(level_dn) * [self.read_dn2, self.photon_dn, self.uneven]

    def variance_dn2(self, level_dn: FloatArray) -> FloatArray:
        """Return the variance at levels (…,) in DN²; below black it is that at black."""
        # Called for every plane of every frame: the sum of `parts_dn2`, in a third of its time.
        level = np.maximum(level_dn, 0.0)
        return np.asarray(self.read_dn2 + self.photon_dn * level + self.uneven * level**2)


def variance_terms(level_dn: FloatArray) -> FloatArray:
    """Return the terms 1, L and L² of the photon-transfer model at levels L.

    Parameters
    ----------
    level_dn
        Levels in DN above black, of any shape; levels below 0 count as 0.

    Returns
    -------
    ndarray
        The three terms along a new last axis, in units of 1, DN and DN², shape (…, 3).

    References
    ----------
    J. R. Janesick, *Photon Transfer*, SPIE Press, 2007. EMVA Standard 1288.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import NoiseModel, variance_terms
    >>> variance_terms(np.array([0.0, 100.0])).tolist()
    [[1.0, 0.0, 0.0], [1.0, 100.0, 10000.0]]
    >>> NoiseModel(read_dn2=4.0, photon_dn=0.5).variance_dn2(np.array([0.0, 100.0])).tolist()
    [4.0, 54.0]
    """
    level = np.maximum(level_dn, 0.0)
    return np.stack([np.ones_like(level), level, level**2], axis=-1)
