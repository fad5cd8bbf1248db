"""Offsets of whole columns, which are most of an instrument's noise.

While light of one wavelength falls on the sample, the dark reading of all output bands is wrong
together. On 196 measurements of tiles with a Labsphere BFC-450, the mean of a column's anti-Stokes
side is found again on the other side, 0.9 times as large (both in units of the entries' σ).
Without it, sums over columns from 430 to 600 nm are 0.016 from the truth and not 0.042.
"""

from dataclasses import replace

import numpy as np

from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.material.reradiation.noise import clear_anti_stokes, required_sigma

#: Anti-Stokes entries from which an offset is known well enough.
FEWEST_ENTRIES = 3
#: Entries' worth of doubt about an offset, which draws that of short columns towards 0.
DOUBT_ENTRIES = 1.0
#: σ after over σ before. What is left drifts along the column: 0.7 of σ on the anti-Stokes side
#: itself, 0.75 to 0.82 in blue and red columns, 0.82 to 0.89 at 700 to 780 nm of output.
LEFT_SIGMA = 0.8
#: Correlation of any two entries of a column after that.
LEFT_CORRELATION = 0.23


def without_offset(matrix: ReradiationMatrix) -> ReradiationMatrix:
    """Return a measured matrix without the offset of each column.

    Parameters
    ----------
    matrix
        A matrix as measured, with the σ of `with_sigma`.

    Returns
    -------
    ReradiationMatrix
        From all re-radiation of a column with three or more entries two bands or more on the
        anti-Stokes side, their mean was subtracted, in units of σ, and its σ is 0.8 times as large.
        Other columns and the reflectance are as before. Sums over columns gain most: errors of a
        column are nearly the same in all entries.

    Raises
    ------
    DataError
        The re-radiation has no σ.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, with_sigma, without_offset
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> noise = 0.001 * np.random.default_rng(1).standard_normal((31, 31))
    >>> noise[:, 20] += 0.004
    >>> tile = ReradiationMatrix.from_bands("tile", nm, nm, 0.5 * np.eye(31) + noise)
    >>> clean = without_offset(with_sigma(tile))
    >>> f"{tile.reradiated_fraction[20]:.2f}, {clean.reradiated_fraction[20]:.2f}"
    '0.03, -0.01'
    """
    sigma = required_sigma(matrix)
    used = clear_anti_stokes(matrix) & (sigma > 0)
    counts = used.sum(axis=0)
    pulls = np.divide(matrix.reradiation, sigma, out=np.zeros_like(sigma), where=used)
    offset = np.where(counts < FEWEST_ENTRIES, 0.0, pulls.sum(axis=0) / (counts + DOUBT_ENTRIES))
    left = np.where(counts < FEWEST_ENTRIES, 1.0, LEFT_SIGMA)
    before = matrix.column_correlation
    correlation = np.where(
        counts < FEWEST_ENTRIES, 0.0 if before is None else before, LEFT_CORRELATION
    )
    return replace(
        matrix,
        reradiation=matrix.reradiation - offset * sigma,
        reradiation_sigma=sigma * left,
        column_correlation=correlation,
    )
