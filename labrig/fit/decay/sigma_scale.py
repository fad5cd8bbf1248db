"""A factor by which the given σ of a table are too small, told by the scatter of its values.

The scatter is that about the best completely monotone curve (see `envelope`), so that a misfit of
the exponentials is not taken for it. σ is multiplied by R. Birge's ratio (Phys. Rev. 40, 1932)
where it is above 1, never below, as the Particle Data Group does: a σ that is larger than the
scatter may hold what all values have in common. Excess scatter in proportion to the signal is
flicker instead; the likelihood tells the two apart.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from labrig.fit.decay.diagnostics import MISFIT_LEVEL, order_p_value
from labrig.fit.decay.envelope import MAX_FLICKER, monotone_curve
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.whitening import whitened
from labrig.foundation.arrays import FloatArray

#: Chance of right σ to scatter so much that they are scaled.
SCALED_LEVEL = 5e-4
#: Log likelihood by which the factor has to be better than flicker: odds of e² = 7 : 1.
CLEAR_LOG_LIKELIHOOD = 2.0
#: Least ratio of robust scatter to scatter: below, few values lie far off and the others do not.
LEAST_ROBUST = 0.6
#: Fewest degrees of freedom that tell it.
FEWEST_DOF = 5.0
#: Values of a flicker that are tried.
FLICKERS = np.linspace(0.0, MAX_FLICKER, 100)


@dataclass(frozen=True)
class SigmaScale:
    """Factor by which the given σ are multiplied, and the degrees of freedom that tell it."""

    factor: float
    dof: float


def sigma_scale(series: DecaySeries, flicker: float | None) -> SigmaScale | None:
    """Return the factor of all σ that the scatter of one channel tells; None if they are right.

    Parameters
    ----------
    series
        Series with given σ.
    flicker
        Relative flicker; None if it is to be estimated, so that a scatter in proportion to the
        signal is its own.

    Raises
    ------
    FitError
        The signal does not decay.
    """
    if not series.sigma_given or len(series.channels) > 1 or len(series.repeats) > 1:
        return None
    data = whitened(series, series.values, flicker or 0.0)
    curve, offsets, leverage, _ = monotone_curve(data, np.ones(1))
    # Beside flicker, the variance of the curve and not of the values: these would weigh the low.
    data = whitened(series, curve[:, None], flicker or 0.0)
    weights = data.matrices[:, 0, 0]
    used = weights > 0
    residual = ((series.values[:, 0] - curve - offsets[0]) * weights)[used]
    free = np.clip(1 - leverage[used], 0.0, 1.0)
    dof = float(free.sum())
    chi2 = float(residual @ residual)
    if dof < FEWEST_DOF or chdtrc(dof, chi2) > SCALED_LEVEL:
        return None
    # Where neighbours agree it is no noise: the curve does not describe the signal, or a drift.
    if order_p_value(residual) < MISFIT_LEVEL:
        return None
    factor = float(np.sqrt(chi2 / dof))
    robust = 1.4826 * float(np.median(np.abs(residual)) / np.sqrt(free.mean()))
    if robust < LEAST_ROBUST * factor:
        return None
    if flicker is None:
        brightness2 = ((curve * weights)[used]) ** 2
        scaled = -(dof * np.log(factor**2) + dof) / 2
        if scaled < _log_likelihood(residual, free, brightness2) + CLEAR_LOG_LIKELIHOOD:
            return None
    return SigmaScale(factor, dof)


def _log_likelihood(residual: FloatArray, free: FloatArray, brightness2: FloatArray) -> float:
    """Return the largest log likelihood of residuals (n,) that are larger by flicker."""
    variance = 1 + np.multiply.outer(FLICKERS**2, brightness2)
    log_likelihood = -(np.log(variance) @ free + (residual**2 / variance).sum(axis=1)) / 2
    return float(log_likelihood.max())
