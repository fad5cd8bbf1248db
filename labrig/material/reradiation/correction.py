"""Corrections of a measured matrix: offsets of columns, and spill beside the diagonal.

While light of one wavelength falls on the sample, the dark reading of all output bands is wrong
together. On 196 measurements of tiles with a Labsphere BFC-450, the mean of a column's anti-Stokes
side is found again on the other side, 0.9 times as large (both in units of the entries' σ).
Without it, sums over columns from 430 to 600 nm are 0.016 from the truth and not 0.042.

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
from labrig.material.reradiation.noise import (
    SIGMA_OF_MEDIAN,
    InstrumentNoise,
    clear_anti_stokes,
    required_sigma,
    with_sigma,
)

#: Anti-Stokes entries from which an offset is known well enough.
MIN_ENTRIES = 3
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
    offset = np.where(counts < MIN_ENTRIES, 0.0, pulls.sum(axis=0) / (counts + DOUBT_ENTRIES))
    left = np.where(counts < MIN_ENTRIES, 1.0, LEFT_SIGMA)
    before = matrix.column_correlation
    correlation = np.where(
        counts < MIN_ENTRIES, 0.0 if before is None else before, LEFT_CORRELATION
    )
    return replace(
        matrix,
        reradiation=matrix.reradiation - offset * sigma,
        reradiation_sigma=sigma * left,
        column_correlation=correlation,
    )


#: Both parts above the diagonal over those below, on a BFC-450: -0.52 and -0.60 on 196 measurements
#: of tiles, -0.48 and -0.66 at wavelengths without re-radiation of 97 other samples.
ABOVE_TO_BELOW = np.array([-0.5, -0.63])
#: Part of the correction that is uncertain: one wavelength's spill differs from the next one's.
CORRECTION_SCATTER = 0.2
#: The same at the last output band, where the instrument's scan ends: 780 nm has 1.8 times as much.
END_SCATTER = 0.8
#: Bands beside one another for which two numbers are fitted.
MIN_PAIRS = 8
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
    if known.sum() < MIN_PAIRS:
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


def corrected(matrix: ReradiationMatrix, noise: InstrumentNoise | None = None) -> ReradiationMatrix:
    """Return a measured matrix with σ, without offsets of columns and without bandpass spill.

    Parameters
    ----------
    matrix
        A matrix as measured, with its anti-Stokes side.
    noise
        Noise of its instrument from `instrument_noise`; without it the matrix tells its own.

    Returns
    -------
    ReradiationMatrix
        What `with_sigma`, `without_offset` and `without_spill` make of it, one after the other.

    Raises
    ------
    DataError
        The matrix has too few anti-Stokes entries, or none with noise.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, corrected
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> noise = 0.001 * np.random.default_rng(1).standard_normal((31, 31))
    >>> tile = ReradiationMatrix.from_bands("tile", nm, nm, 0.5 * np.eye(31) + noise)
    >>> bool(corrected(tile).reradiated_fraction_sigma.max() > 0.001)
    True
    """
    return without_spill(without_offset(with_sigma(matrix, noise)))
