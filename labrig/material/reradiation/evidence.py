"""Decision whether a measured surface re-radiates at all."""

import numpy as np

from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.material.reradiation.noise import near_diagonal, required_sigma

#: Significance of an entry, and of those beside it: noise has stripes along the output, since one
#: dark reading serves a whole column, but never three columns side by side.
CLEAR_SIGMAS, BESIDE_SIGMAS = 5.0, 3.0


def reradiates(matrix: ReradiationMatrix) -> bool:
    """Return whether a surface re-radiates more than its noise.

    Parameters
    ----------
    matrix
        A matrix with σ of its re-radiation.

    Returns
    -------
    bool
        Whether some entry is 5 σ above zero, and both entries beside it, of the neighbouring input
        bands, are 3 σ above zero. Where one of these was not measured, as beside the only light
        that excites a sample, the neighbouring output bands stand for it.

    Raises
    ------
    DataError
        The re-radiation has no σ.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, reradiates, with_sigma
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> values = 0.5 * np.eye(31) + 1e-3 * np.random.default_rng(1).standard_normal((31, 31))
    >>> before = with_sigma(ReradiationMatrix.from_bands("", nm, nm, values))
    >>> values[12, 3:8] += 0.02
    >>> reradiates(before), reradiates(with_sigma(ReradiationMatrix.from_bands("", nm, nm, values)))
    (False, True)
    """
    sigma = required_sigma(matrix)
    used = matrix.is_stokes & ~near_diagonal(matrix)
    is_measured = np.isfinite(matrix.reradiation)
    used &= (sigma > 0) & is_measured
    pulls = np.divide(matrix.reradiation, sigma, out=np.zeros_like(sigma), where=used)
    # An entry on the edge has no neighbour that could agree.
    ends = np.pad(pulls, ((1, 1), (0, 0)))
    same_light = np.minimum(ends[:-2], ends[2:])
    beside = np.where(is_measured, pulls, np.nan)
    left, right = (
        np.where(np.isnan(near), same_light[:, 1:-1], near)
        for near in (beside[:, :-2], beside[:, 2:])
    )
    clear = (pulls[:, 1:-1] > CLEAR_SIGMAS) & (np.minimum(left, right) > BESIDE_SIGMAS)
    return bool(clear.any())
