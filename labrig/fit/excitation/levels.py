"""How charged every site is at every photograph, with derivatives: exact steps, no integrator.

κ = Σ_j k_e,j E_j is constant within a step: the steady lamp is one, its rise and fade a few dozen.
Steps are affine in r, so that derivatives of the end of a charge are one sum over them.
"""

from typing import NamedTuple

import numpy as np

from labrig.fit.excitation.series import Charge, ChargingSeries
from labrig.fit.least_squares import FloatArray
from labrig.material.rates import phi1, phi2, relaxation, relaxation_slopes


class Levels(NamedTuple):
    """Concentrations of N states at P sites, and their derivatives.

    Attributes
    ----------
    value
        (n, P, N) r, mean over each exposure.
    by_k_r
        (n, P, N) by the state's own k_r.
    by_k_e
        (n, P, N, B) by the state's own k_e in every band.
    """

    value: FloatArray
    by_k_r: FloatArray
    by_k_e: FloatArray

    def decayed(self, k_r_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray) -> "Levels":
        """In the dark: means over exposures (n,) that begin `t_s` (n,) later; of one level each."""
        t, x = t_s[:, None, None], exposure_s[:, None, None] * k_r_per_s
        mean = phi1(x)
        left = np.exp(-k_r_per_s * t) * mean
        slope = exposure_s[:, None, None] * (phi2(x) - mean) / mean - t
        return Levels(
            self.value * left,
            (self.by_k_r + self.value * slope) * left,
            self.by_k_e * left[..., None],
        )


def levels(series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray) -> Levels:
    """Of all photographs of a series.

    Parameters
    ----------
    k_r_per_s, k_e_per_s
        (N,) and (N, B).
    """
    shots = [
        end.decayed(k_r_per_s, charge.start_s - dark_s, charge.exposure_s)
        for charge, dark_s, end in _charged(series, k_r_per_s, k_e_per_s)
    ]
    return Levels(*(np.concatenate(parts) for parts in zip(*shots, strict=True)))


def levels_at_off(series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray) -> Levels:
    """After every charge, traced back in the dark from the end of the fade to lamp-off.

    The fade itself charges a little: this is the r(0) to which the amplitude of a decay belongs.
    """
    back = [
        end.decayed(k_r_per_s, np.array([charge.off_s - dark_s]), np.zeros(1))
        for charge, dark_s, end in _charged(series, k_r_per_s, k_e_per_s)
    ]
    return Levels(*(np.concatenate(parts) for parts in zip(*back, strict=True)))


def _charged(
    series: ChargingSeries, k_r_per_s: FloatArray, k_e_per_s: FloatArray
) -> list[tuple[Charge, float, Levels]]:
    """Every charge, when the lamp is dark after it, and the levels then, n = 1."""
    sites, bands = series.irradiance.shape
    shape = (1, sites, len(k_r_per_s))
    never = Levels(np.zeros(shape), np.zeros(shape), np.zeros((*shape, bands)))
    full = never._replace(value=np.ones(shape))
    fading_s = np.array([series.fade.total_s])
    found: list[tuple[Charge, float, Levels]] = []
    level, since_s = never, series.charges[0].on_s
    for charge in series.charges:
        if charge.saturated:
            level = full.decayed(k_r_per_s, fading_s, np.zeros(1))
        else:
            waited = level.decayed(k_r_per_s, np.array([charge.on_s - since_s]), np.zeros(1))
            begin = never if charge.fresh else waited
            level = _lit(begin, charge, series, k_r_per_s, k_e_per_s)
        since_s = charge.off_s + series.fade.total_s
        found.append((charge, since_s, level))
    return found


def _lit(
    begin: Levels,
    charge: Charge,
    series: ChargingSeries,
    k_r_per_s: FloatArray,
    k_e_per_s: FloatArray,
) -> Levels:
    """From switching on until the lamp is dark."""
    duration_s, share = _steps(charge, series)
    light = charge.brightness * share[:, None, :] * series.irradiance
    kappa = light @ k_e_per_s.T
    tau = duration_s[:, None, None]
    step, slopes = relaxation(kappa, k_r_per_s, tau), relaxation_slopes(kappa, k_r_per_s, tau)
    before = np.empty_like(kappa)
    level = begin.value[0]
    for number in range(len(tau)):
        before[number] = level
        level = step.kept[number] * level + step.gained[number]
    # What is left at the end of a change after each step, and of one before the first.
    after = np.cumprod(step.kept[::-1], axis=0)[::-1]
    whole, later = after[0], np.concatenate([after[1:], np.ones((1, *level.shape))])
    by_kappa = later * (slopes.kept * before + slopes.gained_by_kappa)
    by_k_r = (later * (slopes.kept * before + slopes.gained_by_k_r)).sum(axis=0)
    by_k_e = np.einsum("mpn,mpb->pnb", by_kappa, light)
    return Levels(
        level[None],
        (whole * begin.by_k_r[0] + by_k_r)[None],
        (whole[..., None] * begin.by_k_e[0] + by_k_e)[None],
    )


def _steps(charge: Charge, series: ChargingSeries) -> tuple[FloatArray, FloatArray]:
    """(m,) durations of the steps, (m, B) irradiance of the bands in each over the steady one."""
    rise, fade = series.rise, series.fade
    steady_s = charge.off_s - charge.on_s - rise.total_s
    duration_s = np.concatenate([rise.duration_s, [steady_s], fade.duration_s])
    return duration_s, np.vstack([rise.share, np.ones(rise.share.shape[1]), fade.share])
