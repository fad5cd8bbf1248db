"""Noise of a frame: independent per value, plus flicker that all channels of the frame share.

Lamp, shutter and aperture make a whole frame brighter or darker by a relative ρ, so that the values
of one frame scatter together: Cov = diag(σ²) + ρ² s sᵀ with s the frame's signal. Residuals and
models are multiplied by Cov^(−1/2), frame by frame, after which they are independent with unit
variance.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.series import DecaySeries
from labrig.fit.least_squares import FloatArray


@dataclass(frozen=True)
class WhitenedSeries:
    """A series multiplied by its noise's Cov^(−1/2).

    Attributes
    ----------
    series
        What was whitened.
    matrices
        (n, C, C) one W per frame, with Wᵀ W = Cov⁻¹.
    values, ones
        (n, C) the values, and a signal of 1 in every channel, whitened.
    variance
        (n, C) of each value alone, flicker included; inf where not measured.
    """

    series: DecaySeries
    matrices: FloatArray
    values: FloatArray
    ones: FloatArray
    variance: FloatArray

    def unit_signal(self, weights: FloatArray) -> FloatArray:
        """(n, C) what a signal of 1 in the brightest channel becomes; `weights` (C,)."""
        unit: FloatArray = self.matrices @ weights
        return unit

    def independent_data(self, weights: FloatArray) -> float:
        """Values' worth of independent information on the common signal, between n and n C.

        The ratio of the information in all channels to that in the best one: flicker, which the
        channels share, makes a second channel say little new.
        """
        unit = self.unit_signal(weights)
        together = np.einsum("fc,fc->f", unit, unit)
        best = (weights**2 / self.variance).max(axis=1)
        seen = best > 0
        return float((together[seen] / best[seen]).sum())


def whitened(series: DecaySeries, signal: FloatArray, flicker: float) -> WhitenedSeries:
    """The series in units of its noise.

    Parameters
    ----------
    series
        n frames, C channels.
    signal
        (n, C) model of the signal without offset, for the flicker's covariance.
    flicker
        Relative ρ ≥ 0.
    """
    n_channels = len(series.channels)
    measured = series.inverse_sigma > 0
    matrices = series.inverse_sigma[:, :, None] * np.eye(n_channels)
    if flicker > 0:
        u = flicker * signal * series.inverse_sigma
        root = np.sqrt(1 + np.einsum("fc,fc->f", u, u))
        # (1 + u uᵀ)^(−1/2) = 1 − u uᵀ / (root (1 + root)), without dividing by |u|.
        shrink = u / (root * (1 + root))[:, None]
        matrices = matrices - shrink[:, :, None] * (u * series.inverse_sigma)[:, None, :]
    alone = 1 / np.where(measured, series.inverse_sigma, 1.0) ** 2
    return WhitenedSeries(
        series=series,
        matrices=matrices,
        values=np.einsum("fcd,fd->fc", matrices, series.values),
        ones=matrices.sum(axis=2),
        variance=np.where(measured, alone + (flicker * signal) ** 2, np.inf),
    )
