"""Decays after several charges, with rates in common and with rates of their own.

All are one channel wide here: the channels of a frame, weighed as the fit of the brightest decay
has them, say the same with less noise. Amplitudes are linear, so only the rates are searched for
(variable projection).
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc

from labrig.errors import FitError
from labrig.fit import EPSILON, least_squares
from labrig.fit.decay import exponential_means_and_slopes
from labrig.material import exponential_means
from labrig.results import Curve, FittedDecay, FloatArray, RatesTest, Series


def curve(series: Series, fit: FittedDecay) -> Curve:
    """A series with its channels weighed as in `fit`, flicker in its σ."""
    rows = series.usable
    weights = np.array(fit.channel_weights)
    y, s = series.values[rows], series.sigma[rows]
    information = (weights / s**2) @ weights
    value = (y / s**2) @ weights / information
    sigma = np.hypot(1 / np.sqrt(information), fit.flicker * np.maximum(value, 0.0))
    dark = np.nan_to_num(series.dark_sigma)
    shares = np.mean(weights / s**2, axis=0) / np.mean(information)
    return Curve(series.t_s[rows], series.exposure_s[rows], value, sigma, float(shares @ dark))


def flicker_dof(fit: FittedDecay) -> float:
    """Degrees of freedom from which a fit estimated its flicker; infinite if it was given."""
    if not fit.flicker_sigma > 0:
        return np.inf
    return max(0.5 * (fit.flicker / fit.flicker_sigma) ** 2, 1.0)


def compare_rates(
    curves: Sequence[Curve], start_per_s: Sequence[float], noise_dof: float = np.inf
) -> RatesTest:
    """Fit all decays with shared rates, then each with its own, as many states each.

    Parameters
    ----------
    start_per_s
        Rates to start from; their number is that of the states.
    noise_dof
        Degrees of freedom from which the curves' σ was estimated; infinite if it is known.

    Raises
    ------
    FitError
        Too few frames, or some decay that has none of these states.
    """
    start = np.log(np.asarray(start_per_s, dtype=np.float64))
    states = len(start)
    dof = sum(len(one.t_s) for one in curves) - 2 * states * len(curves)
    if dof < 1 or min(len(one.t_s) for one in curves) <= 2 * states:
        raise FitError(
            f"expected more than {2 * states} frames of each decay for {states} state(s); record "
            "more, or ask for fewer states"
        )
    shared, shared_chi2, _ = _fit(curves, start)
    alone = [_fit([one], shared) for one in curves]
    own_chi2 = sum(chi2 for _, chi2, _ in alone)
    amplitudes = [_amplitudes(one, np.exp(shared)) for one in curves]
    added = states * (len(curves) - 1)
    gain = max(shared_chi2 - own_chi2, 0.0) / added
    # σ may be a little too large, never too small by less scatter than it says.
    scatter = max(own_chi2 / dof, 1.0)
    falling = np.argsort(-shared)
    return RatesTest(
        shared_per_s=np.exp(shared)[falling],
        own_per_s=np.array([np.exp(found)[falling] for found, _, _ in alone]),
        own_sigma_per_s=np.array([(np.exp(found) * sigma)[falling] for found, _, sigma in alone]),
        amplitude=np.array([value[falling] for value, _ in amplitudes]),
        amplitude_sigma=np.array([sigma[falling] for _, sigma in amplitudes]),
        residuals=tuple(-_misfit(one, np.exp(shared)[falling])[0][:-1] for one in curves),
        chi2_shared=shared_chi2,
        chi2_own=own_chi2,
        dof_own=dof,
        noise_dof=noise_dof,
        p_value=float(fdtrc(added, dof, gain / scatter)),
    )


def _fit(curves: Sequence[Curve], start: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Log rates (s,), χ² and σ of the log rates."""

    def residuals(log_rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        rest, slopes = zip(*(_misfit(one, np.exp(log_rates)) for one in curves), strict=True)
        return np.concatenate(rest), np.concatenate(slopes)

    found = least_squares(residuals, start)
    return found.parameters, found.chi2, found.sigma


def _misfit(one: Curve, rates_per_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n + 1,) model − value of the best amplitudes, whitened; (n + 1, s) its slopes by log rates.

    The slopes are Kaufman's (BIT 15, 1975): what other amplitudes explain as well is taken off.
    """
    means, by_log_rate = exponential_means_and_slopes(rates_per_s, one.t_s, one.exposure_s)
    design, target = _design(one, means), _target(one)
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    moved = np.zeros((len(target), len(rates_per_s)))
    moved[:-1] = by_log_rate * solution[:-1] / one.sigma[:, np.newaxis]
    known = np.linalg.qr(design)[0]
    return np.asarray(design @ solution - target), moved - known @ (known.T @ moved)


def _amplitudes(one: Curve, rates_per_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    design = _design(one, exponential_means(rates_per_s, one.t_s, one.exposure_s))
    covariance = np.linalg.pinv(design.T @ design, rcond=1e3 * EPSILON)
    solution = covariance @ design.T @ _target(one)
    return solution[:-1], np.sqrt(np.diag(covariance))[:-1]


def _design(one: Curve, shapes: FloatArray) -> FloatArray:
    """(n + 1, s + 1) of shapes (n, s), whitened; its last row the offset's prior."""
    offset = np.full((len(one.t_s), 1), one.offset_sigma)
    rows = np.hstack([shapes, offset]) / one.sigma[:, np.newaxis]
    prior = np.zeros((1, rows.shape[1]))
    prior[0, -1] = 1.0
    return np.vstack([rows, prior])


def _target(one: Curve) -> FloatArray:
    """(n + 1,) whitened."""
    return np.append(one.value / one.sigma, 0.0)
