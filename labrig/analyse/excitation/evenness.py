"""Evenness of a patch: how bright each place looks after the same light, by lens and sample."""

from dataclasses import replace

import numpy as np

from labrig.errors import DataError
from labrig.results import ChargingSeries, FittedExcitation, FloatArray, PatchCharging

#: Change of the evenness that matters: a tenth of what is left of it by noise.
SMALL = 1e-4


def evenness(values: FloatArray, sigma: FloatArray, course: FloatArray) -> FloatArray:
    """Return the brightness of every place after the same light, 1 on average, shape (P,).

    Parameters
    ----------
    values, sigma
        Photographs after charges by the lamp itself, shape (n, P, C).
    course
        Glow expected of every place over its mean in the photograph, which broadcasts with them.

    Raises
    ------
    DataError
        Some place does not glow, or is clipped.
    """
    weight = np.where(np.isfinite(values) & (sigma > 0), 1 / np.square(sigma), 0.0)
    is_known = weight.min(axis=1, keepdims=True) > 0
    frame_mean = np.where(
        is_known, np.nanmean(np.where(is_known, values, 0.0), axis=1, keepdims=True), 0.0
    )
    expected = np.where(is_known, course, 1.0) * frame_mean
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
    """Divide by the evenness anew, with what earlier charges have left at every place.

    After the first charges by the lamp itself places still glow by what charged them through the
    filter, which a kinetic order above 1 keeps for long.

    Parameters
    ----------
    charging
        Charging of a patch.
    fit
        Fit of it, of which the glow of every place is expected.
    """
    direct = charging.direct
    expected = direct.values - fit.residuals[1] * direct.sigma
    course = expected / expected.mean(axis=1, keepdims=True)
    undone = charging.evenness[:, None]
    found = evenness(direct.values * undone, direct.sigma * undone, course)
    if np.abs(found / charging.evenness - 1).max() < SMALL:
        return charging
    factor = undone / found[:, None]

    def divided(series: ChargingSeries) -> ChargingSeries:
        return replace(series, values=series.values * factor, sigma=series.sigma * factor)

    through, veils = divided(charging.through), charging.through.frame_light
    return replace(
        charging,
        through=through if veils is None else replace(through, frame_light=veils * factor),
        direct=divided(direct),
        evenness=found,
    )
