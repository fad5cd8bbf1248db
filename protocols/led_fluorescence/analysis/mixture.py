"""A mixture of normal densities that stands for the measured part of an estimated matrix."""

from dataclasses import replace

import numpy as np

from labrig.fit import fit_mixture
from labrig.foundation.arrays import BoolArray
from labrig.foundation.errors import DataError, UsageError
from labrig.material import ReradiationMatrix
from labrig.results import MixtureOfMatrix

#: Components of a mixture: with more it follows little but noise (Hua et al. 2021).
COMPONENTS = 3
#: Least part of the strongest entry that counts as re-radiation. An estimate is smooth, and errors
#: of its entries have the same sign: σ of each would leave out what belongs to the dye.
LEAST_PART = 0.01


def mixture_of(matrix: ReradiationMatrix, is_extrapolated: BoolArray) -> MixtureOfMatrix | None:
    """Fit a mixture to the input bands that LEDs lit; None where they re-radiate nothing.

    Parameters
    ----------
    matrix
        The estimated matrix.
    is_extrapolated
        Input bands whose numbers are extrapolated and are left out, shape (i,).
    """
    unknown = np.broadcast_to(is_extrapolated, matrix.reradiation.shape)
    lit = replace(matrix, reradiation=np.where(unknown, np.nan, matrix.reradiation))
    per_band = lit.reradiation * lit.output_width_nm[:, np.newaxis]
    threshold = LEAST_PART * float(np.nanmax(np.where(lit.is_stokes, per_band, 0.0)))
    if not threshold > 0:
        return None
    try:
        fit = fit_mixture(lit, COMPONENTS, threshold=threshold)
    except (DataError, UsageError):
        # Too few entries for as many numbers.
        return None
    edges = matrix.input_edges_nm
    bands = np.flatnonzero(~is_extrapolated)
    return MixtureOfMatrix(
        scale=fit.mixture.scale,
        weights=fit.mixture.weights,
        mean_nm=fit.mixture.mean_nm,
        covariance_nm2=fit.mixture.covariance_nm2,
        measured_nm=(float(edges[bands[0]]), float(edges[bands[-1] + 1])),
        threshold=fit.threshold,
        kept_entries=fit.kept_entries,
        entries=fit.entries,
        masked_mse=fit.masked_mse,
        band_nm=fit.band_nm,
    )
