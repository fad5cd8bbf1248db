"""How much of the measured re-radiation a mixture keeps."""

import math

import numpy as np

from labrig.fit.mixture.entries import StokesEntries
from labrig.fit.mixture.result import LightKept
from labrig.fit.mixture.scaling import modelled
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix, ReradiationMixture

#: Least part of the light, and least number of its σ, with which a column is compared.
LEAST_PART, LEAST_SIGMAS = 0.01, 5.0


def light_sigma(matrix: ReradiationMatrix, entries: StokesEntries) -> float | None:
    """Return σ of the light in all entries; None if they are not weighted by σ."""
    sigma = None if entries.sigma is None else _column_sigma(matrix, entries)
    return None if sigma is None else float(np.sqrt(sigma @ sigma))


def light_kept(
    matrix: ReradiationMatrix, entries: StokesEntries, mixture: ReradiationMixture
) -> LightKept:
    """Compare the light of a mixture with that in the entries as they were measured.

    Parameters
    ----------
    matrix
        The matrix, of whose columns errors may correlate.
    entries
        Its entries on the Stokes side.
    mixture
        The mixture.
    """
    measured = _by_column(matrix, entries, entries.measured)
    kept = _by_column(matrix, entries, modelled(entries, mixture))
    sigma = _column_sigma(matrix, entries)
    total = float(measured.sum())
    bright = measured >= LEAST_PART * abs(total)
    off = np.abs(kept - measured)
    if sigma is not None:
        bright &= measured >= LEAST_SIGMAS * sigma
        off = off / np.where(sigma > 0, sigma, 1.0)
    else:
        off = off / np.where(bright, measured, 1.0)
    parts = np.where(bright, kept / np.where(bright, measured, 1.0), 1.0)
    worst = int(np.argmax(np.where(bright, off, 0.0)))
    part = float(kept.sum()) / total if total > 0 else math.nan
    return LightKept(
        total=part,
        total_sigma=None if sigma is None else part * float(np.sqrt(sigma @ sigma)) / abs(total),
        worst_input_nm=float(matrix.input_nm[worst]),
        worst=float(parts[worst]),
        worst_sigma=None
        if sigma is None or not bright[worst]
        else float(parts[worst] * sigma[worst] / measured[worst]),
    )


def _by_column(matrix: ReradiationMatrix, entries: StokesEntries, values: FloatArray) -> FloatArray:
    """Return the sums over each input band, shape (m,)."""
    column = np.searchsorted(matrix.input_nm, entries.input_nm)
    return np.bincount(column, values, len(matrix.input_nm)) * matrix.input_width_nm


def _column_sigma(matrix: ReradiationMatrix, entries: StokesEntries) -> FloatArray | None:
    """Return σ of the light in each input band, shape (m,); None if that of entries is unknown."""
    if matrix.reradiation_sigma is None:
        return None
    row = np.searchsorted(matrix.output_nm, entries.output_nm)
    column = np.searchsorted(matrix.input_nm, entries.input_nm)
    sigma = np.nan_to_num(matrix.reradiation_sigma[row, column]) * entries.output_width_nm
    independent = _by_column(matrix, entries, sigma**2) * matrix.input_width_nm
    together = _by_column(matrix, entries, sigma) ** 2
    common = matrix.column_correlation if matrix.column_correlation is not None else 0.0
    return np.asarray(np.sqrt((1 - common) * independent + common * together))
