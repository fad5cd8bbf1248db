"""Evenness of a patch: how bright each place looks after the same light, by lens and sample."""

from dataclasses import replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.protocols.excitation.result import PatchCharging
from labrig.results import ChargingSeries, FittedExcitation


def evenness(values: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return about how bright every place is after the same light, 1 on average, shape (P,).

    What earlier charges have left at the places counts as their brightness here; a fit tells the
    two apart.

    Parameters
    ----------
    values, sigma
        Photographs after charges by the lamp itself, shape (n, P, C).

    Raises
    ------
    DataError
        Some place does not glow, or is clipped.
    """
    weight = np.where(np.isfinite(values) & (sigma > 0), 1 / np.square(sigma), 0.0)
    is_known = weight.min(axis=1, keepdims=True) > 0
    expected = np.where(
        is_known, np.nanmean(np.where(is_known, values, 0.0), axis=1, keepdims=True), 0.0
    )
    weight = np.where(is_known, weight, 0.0)
    total = (weight * expected**2).sum(axis=(0, 2))
    if not (total > 0).all():
        raise DataError(
            "expected a glow all along the filter's place after charges by the lamp itself, got "
            "none somewhere, or it is clipped; check where the sample and the filter lie"
        )
    signal = (weight * expected * np.nan_to_num(values)).sum(axis=(0, 2)) / total
    return np.asarray(signal / signal.mean())


def evened(charging: PatchCharging, fit: FittedExcitation) -> PatchCharging:
    """Divide by the evenness that a fit has found beside what earlier charges have left.

    After the first charges by the lamp itself places still glow by what charged them through the
    filter, which slow states and a kinetic order above 1 keep for long.

    Parameters
    ----------
    charging
        Charging of a patch.
    fit
        Fit of it.
    """
    factor = 1 / fit.evenness[:, None]

    def divided(series: ChargingSeries) -> ChargingSeries:
        return replace(series, values=series.values * factor, sigma=series.sigma * factor)

    through, veils = divided(charging.through), charging.through.frame_light
    return replace(
        charging,
        through=through if veils is None else replace(through, frame_light=veils * factor),
        direct=divided(charging.direct),
        evenness=charging.evenness * fit.evenness,
    )
