"""Noise model of a frame: noise of each value with its correlation, plus common-mode flicker.

Lamp, shutter and aperture make a whole frame brighter or darker by a relative ρ, so that the values
of one frame scatter together: Cov = N + ρ² s sᵀ with s the frame's signal and N = (σ_c r_cd σ_d)
the read and photon noise, r the channels' correlation. Residuals and models are multiplied by a
W with Wᵀ W = Cov⁻¹, frame by frame, after which they are independent with unit variance.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.series import DecaySeries
from labrig.fit.least_squares import EPSILON
from labrig.foundation.arrays import FloatArray


@dataclass(frozen=True)
class WhitenedSeries:
    """A series multiplied by the whitening matrices W of its noise.

    Attributes
    ----------
    series
        The original series.
    matrices
        One W per frame, with Wᵀ W = Cov⁻¹, shape (n, C, C).
    values
        Whitened values, shape (n, C).
    target
        Whitened values in one row, then 0 for each of the p offsets with a finite prior σ, shape
        (n C + p,).
    offset_design
        Effect of an offset of 1 in each channel with a fitted offset on the target, its prior
        included, shape (n C + p, m).
    variance
        Variance of each value alone, flicker included, shape (n, C); inf where missing.
    """

    series: DecaySeries
    matrices: FloatArray
    values: FloatArray
    target: FloatArray
    offset_design: FloatArray
    variance: FloatArray

    def constant(self, levels: FloatArray) -> FloatArray:
        """Return the whitened signal (n, C) of the same levels (C,) in all frames."""
        constant: FloatArray = self.matrices @ levels
        return constant

    def offsets_of(self, residual: FloatArray) -> FloatArray:
        """Return the offsets (C,) that best explain whitened residuals (n C + p,)."""
        offsets = np.zeros(len(self.series.channels))
        offsets[self.series.fitted_offsets] = np.linalg.lstsq(self.offset_design, residual)[0]
        return offsets

    def signal_design(self, unit: FloatArray, shapes: FloatArray) -> FloatArray:
        """Return the design (n C + p, q) of shapes (n, q) times a whitened signal `unit` (n, C)."""
        design = np.zeros((len(self.target), shapes.shape[1]))
        design[: unit.size] = (unit[:, :, None] * shapes[:, None, :]).reshape(unit.size, -1)
        return design

    def leverage(self, weights: FloatArray, design: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the degrees of freedom a linear model takes from each frame, by its hat matrix.

        Parameters
        ----------
        weights
            Weights of the channels, shape (C,).
        design
            Columns of the model, shape (n C + p, q).

        Returns
        -------
        along, across
            Degrees of freedom along the signal, at most 1 each, and across it, at most C − 1, both
            (n,).
        """
        unit = self.constant(weights)
        length = np.linalg.norm(unit, axis=1)
        norms = np.linalg.norm(design, axis=0)
        u, s, _ = np.linalg.svd(design / np.where(norms > 0, norms, 1.0), full_matrices=False)
        independent = s > max(design.shape) * EPSILON * s.max(initial=0.0)
        frames = u[: unit.size, independent].reshape(*unit.shape, -1)
        direction = unit / np.where(length > 0, length, 1.0)[:, None]
        along = (np.einsum("fc,fcq->fq", direction, frames) ** 2).sum(axis=1)
        return along, (frames**2).sum(axis=(1, 2)) - along

    def independent_data(self, weights: FloatArray) -> float:
        """Return the effective number of independent values of the common signal, n to n C.

        It is the ratio of the information in all channels to that in the best one: with common-mode
        flicker a second channel adds little.
        """
        unit = self.constant(weights)
        information = np.einsum("fc,fc->f", unit, unit)
        best = (weights**2 / self.variance).max(axis=1)
        informative = best > 0
        return float((information[informative] / best[informative]).sum())


def whitened(series: DecaySeries, signal: FloatArray, flicker: float) -> WhitenedSeries:
    """Return the series in units of its noise.

    Parameters
    ----------
    series
        Series of n frames and C channels.
    signal
        Model of the signal without offset, for the flicker's covariance, shape (n, C).
    flicker
        Relative flicker ρ ≥ 0.
    """
    measured = series.inverse_sigma > 0
    matrices = whitening_matrices(series, signal, flicker)
    own_variance = 1 / np.where(measured, series.inverse_sigma, 1.0) ** 2
    values = np.einsum("fcd,fd->fc", matrices, series.values)
    fitted = series.fitted_offsets
    prior = series.offset_prior
    return WhitenedSeries(
        series=series,
        matrices=matrices,
        values=values,
        target=np.append(values, np.zeros(len(prior))),
        offset_design=np.vstack([matrices[:, :, fitted].reshape(values.size, -1), prior]),
        variance=np.where(measured, own_variance + (flicker * signal) ** 2, np.inf),
    )


def whitening_matrices(series: DecaySeries, signal: FloatArray, flicker: float) -> FloatArray:
    """Return one W per frame with Wᵀ W = Cov⁻¹, shape (n, C, C); the arguments are as above."""
    matrices = series.whiteners
    if flicker > 0:
        u = flicker * np.einsum("fcd,fd->fc", matrices, signal)
        root = np.sqrt(1 + np.einsum("fc,fc->f", u, u))
        # (1 + u uᵀ)^(−1/2) = 1 − u uᵀ / (root (1 + root)), without dividing by |u|.
        shrink = u / (root * (1 + root))[:, None]
        along = np.einsum("fc,fcd->fd", u, matrices)
        matrices = matrices - shrink[:, :, None] * along[:, None, :]
    return matrices
