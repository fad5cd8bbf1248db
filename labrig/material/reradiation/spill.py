"""Spill: light that gets past both monochromators into the bands beside the diagonal.

The bandpasses of neighbouring bands overlap, and the entries beside the diagonal hold reflected
light. One band below it, where no re-radiation can be, this is p (ρ₊ - ρ₋) + e (ρ₊ + ρ₋) / 2 with
the reflectances ρ₋ and ρ₊ of the shorter and the longer wavelength; one band above it, both parts
are there again, negative and smaller. On a Labsphere BFC-450 p = 0.06 and e is 0.007 for ceramic
tiles, but 0 to 0.06 from sample to sample (textiles, a golf ball), so both are fitted to each
matrix.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.matrix import ReradiationMatrix, are_same_bands
from labrig.material.reradiation.noise import SIGMA_OF_MEDIAN

#: Both parts above the diagonal over those below, on a BFC-450: -0.52 and -0.60 on 196 measurements
#: of tiles, -0.48 and -0.66 at wavelengths without re-radiation of 97 other samples.
ABOVE_TO_BELOW = np.array([-0.5, -0.63])
#: Part of the correction that is uncertain: one wavelength's spill differs from the next one's.
CORRECTION_SCATTER = 0.2
#: The same at the last output band, where the instrument's scan ends: 780 nm has 1.8 times as much.
END_SCATTER = 0.8
#: Bands beside one another for which two numbers are fitted.
FEWEST_PAIRS = 8
#: Residuals beyond this many of their σ have less weight in the fit (P. J. Huber, 1964).
HUBER_SIGMAS = 1.345
TINY = np.finfo(float).tiny
ITERATIONS = 20


def without_spill(matrix: ReradiationMatrix) -> ReradiationMatrix:
    """Return a measured matrix without the light that its instrument spills beside the diagonal.

    Parameters
    ----------
    matrix
        A matrix as measured.

    Returns
    -------
    ReradiationMatrix
        Entries one band below the diagonal, where there is no re-radiation, are 0 and keep their σ.
        From those one band above it, the spill was subtracted that follows from what is fitted
        below, and their σ has a fifth of that more, in the last output band four fifths. A matrix
        with fewer than eight pairs of neighbouring bands that input and output have in common comes
        back as it is.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, without_spill
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> values = 0.5 * np.eye(31) + 0.005 * np.eye(31, k=1) - 0.00315 * np.eye(31, k=-1)
    >>> tile = without_spill(ReradiationMatrix.from_bands("tile", nm, nm, values))
    >>> bool(abs(tile.reradiation).max() < 1e-12)
    True
    """
    lower, column = _neighbours(matrix)
    upper = lower + 1
    below = matrix.reradiation[lower, column + 1] * matrix.output_width_nm[lower]
    low, high = matrix.reflectance[lower], matrix.reflectance[upper]
    terms = np.stack([high - low, (high + low) / 2], axis=1)
    known = np.isfinite(terms).all(axis=1) & np.isfinite(below)
    if known.sum() < FEWEST_PAIRS:
        return matrix
    lower, upper, column, terms = lower[known], upper[known], column[known], terms[known]
    spill = terms @ (ABOVE_TO_BELOW * _robust_fit(terms, below[known]))
    spill_per_nm = spill / matrix.output_width_nm[upper]

    reradiation = matrix.reradiation.copy()
    reradiation[lower, column + 1] = 0.0
    reradiation[upper, column] -= spill_per_nm
    sigma = None
    if matrix.reradiation_sigma is not None:
        sigma = matrix.reradiation_sigma.copy()
        is_end = upper == len(matrix.output_nm) - 1
        scatter = np.where(is_end, END_SCATTER, CORRECTION_SCATTER)
        sigma[upper, column] = np.hypot(sigma[upper, column], scatter * spill_per_nm)
    return replace(matrix, reradiation=reradiation, reradiation_sigma=sigma)


def _neighbours(matrix: ReradiationMatrix) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places, in output and in input, of bands whose next ones are the same, too."""
    same = are_same_bands(matrix.output_nm, matrix.input_nm)
    row, column = np.nonzero(same[:-1, :-1] & same[1:, 1:])
    return row, column


def _robust_fit(terms: FloatArray, value: FloatArray) -> FloatArray:
    """Return the factors of the terms by least squares with Huber's weights."""
    weight = np.ones(len(value))
    for _ in range(ITERATIONS):
        root = np.sqrt(weight)
        factors = np.linalg.lstsq(terms * root[:, np.newaxis], value * root, rcond=None)[0]
        residual = np.abs(value - terms @ factors)
        limit = HUBER_SIGMAS * SIGMA_OF_MEDIAN * np.median(residual)
        weight = np.where(residual > limit, limit / np.maximum(residual, TINY), 1.0)
    return np.asarray(factors)
