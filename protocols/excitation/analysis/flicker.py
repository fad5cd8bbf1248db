"""Flicker of photographs, from what all places of each have in common beyond the fit.

A decay of a dozen photographs tells the flicker to a quarter of itself; the photographs after all
charges are ten times as many.
"""

from collections.abc import Sequence

import numpy as np

from labrig.analyse.series_fit import TYPICAL_FLICKER
from labrig.foundation.arrays import FloatArray
from labrig.results import ChargingSeries, FittedExcitation


def common_flicker(
    fit: FittedExcitation, series: Sequence[ChargingSeries], dark_sigma: Sequence[float]
) -> float:
    """Return the relative flicker of all photographs by the method of moments.

    A photograph is f times as bright as the fit says: f² has the mean of the squared flicker and of
    the variance that noise and dark level give it. Every charge's lamp and the rates follow some of
    the flicker, which so many photographs fewer tell.

    Parameters
    ----------
    fit, series
        A fit, and its series.
    dark_sigma
        Scatter of the dark level in the values' unit, shape (C,).
    """
    parts = [
        _deviations(charging, residuals, np.array(dark_sigma))
        for charging, residuals in zip(series, fit.residuals, strict=True)
    ]
    deviation, variance = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    weight = 1 / (TYPICAL_FLICKER**2 + variance) ** 2
    lamp = sum(sum(len(charge.start_s) > 0 for charge in charging.charges) for charging in series)
    # As many photographs as there are weights of the largest size.
    effective = weight.sum() ** 2 / np.square(weight).sum()
    free = effective - lamp - 3 * len(fit.states)
    if free < 1:
        return TYPICAL_FLICKER
    mean_square = weight @ (deviation**2 * effective / free - variance) / weight.sum()
    return float(np.sqrt(max(mean_square, 0.0)))


def _deviations(
    charging: ChargingSeries, residuals: FloatArray, dark_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the relative deviation of every measured photograph, and its variance by noise."""
    signal = charging.values - residuals * charging.sigma
    is_measured = np.isfinite(residuals)
    scaled = np.where(is_measured, signal / charging.sigma, 0.0)
    power = np.square(scaled).sum(axis=(1, 2))
    along_dark = np.where(is_measured, scaled / charging.sigma, 0.0).sum(axis=1)
    glows = power > 0
    power, along_dark = power[glows], along_dark[glows]
    deviation = (scaled * np.nan_to_num(residuals)).sum(axis=(1, 2))[glows] / power
    variance = 1 / power + np.square(along_dark * dark_sigma).sum(axis=1) / power**2
    return deviation, variance
