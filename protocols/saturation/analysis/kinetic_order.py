"""Decays from several levels of charge: does their rate depend on the level, as that of an order?

A state of kinetic order b decays as (1 + u R t)^(−1/u), u = (b − 1)/b, whatever its charge, with
the rate R = b k r(0)^(b − 1) at lamp off; its light there is Λ k r(0)ᵇ, so that R grows with the
power u of the light. First order, and any mixture of exponentials in fixed proportion, has the same
R after every charge. The two exponents, of the shape and of the shift, are measured apart.
"""

from collections.abc import Sequence

import numpy as np

from labrig.fit import LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import DECAY_LAWS
from labrig.protocols.saturation.result import Curve, OrderTest
from labrig.results import Measured

BECQUEREL = DECAY_LAWS["becquerel"]
#: Largest exponent of the shape: that of b = 4.
LARGEST_SHAPE = 0.75
START_SHAPE = 0.3
#: Parameters of a decay: logarithms of light and rate at lamp off, and offset over its σ.
OWN = 3


def compare_levels(curves: Sequence[Curve]) -> OrderTest | None:
    """Fit decays after several charges by one shape, each with its own light and rate.

    Parameters
    ----------
    curves
        The decays, each with more than two frames.

    Returns
    -------
    OrderTest or None
        Rates over the light at lamp off; None if they cannot be fitted.
    """
    if len(curves) < 2 or any(not np.any(curve.value > 0) for curve in curves):
        return None
    theta = [START_SHAPE]
    for curve in curves:
        brightest = float(curve.value.max())
        lasting = curve.t_s[curve.value > brightest / np.e]
        rate = 1 / max(float(lasting[-1]), float(curve.t_s[0]), 1e-9)
        theta += [np.log(brightest), np.log(rate), 0.0]
    low = np.array([0.0, *[-np.inf] * OWN * len(curves)])
    high = np.array([LARGEST_SHAPE, *[np.inf] * OWN * len(curves)])

    def residuals(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        parts = [
            _residuals(curve, float(theta[0]), theta[1 + OWN * row : 1 + OWN * (row + 1)])
            for row, curve in enumerate(curves)
        ]
        jacobian = np.zeros((sum(len(off) for off, _ in parts), len(theta)))
        begin = 0
        for row, (off, slopes) in enumerate(parts):
            rows = slice(begin, begin + len(off))
            jacobian[rows, 0] = slopes[:, 0]
            jacobian[rows, 1 + OWN * row : 1 + OWN * (row + 1)] = slopes[:, 1:]
            begin += len(off)
        return np.concatenate([off for off, _ in parts]), jacobian

    try:
        fit = least_squares(residuals, theta, lower=low, upper=high, max_iterations=500)
    except FitError:
        return None
    return _test(fit, len(curves)) if fit.converged and fit.dof > 0 else None


def _residuals(curve: Curve, shape: float, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return model − value over σ, the offset's prior last, and slopes by shape and own (n, 4)."""
    amplitude, rate = np.exp(own[:2]).tolist()
    means, slopes = BECQUEREL.means(rate, shape, curve.t_s, curve.exposure_s)
    offset = np.full(len(means), curve.offset_sigma)
    off = (amplitude * means + own[2] * offset - curve.value) / curve.sigma
    columns = [amplitude * slopes[:, 1], amplitude * means, amplitude * slopes[:, 0], offset]
    jacobian = np.column_stack(columns) / curve.sigma[:, np.newaxis]
    return np.append(off, own[2]), np.vstack([jacobian, [0.0, 0.0, 0.0, 1.0]])


def _test(fit: LeastSquaresFit, decays: int) -> OrderTest | None:
    """Return the exponents of shape and shift, their σ enlarged where the shape does not fit."""
    covariance = fit.covariance * max(fit.reduced_chi2, 1.0)
    rates = 2 + OWN * np.arange(decays)
    log_light, log_rate = fit.parameters[rates - 1], fit.parameters[rates]
    of_rates = covariance[np.ix_(rates, rates)]
    if not np.isfinite(of_rates).all():
        return None
    design = np.column_stack([np.ones(decays), log_light - log_light.mean()])
    weighted = np.linalg.solve(of_rates, design)
    line = np.linalg.pinv(design.T @ weighted) @ weighted.T
    shift = float(line[1] @ log_rate)
    # What a light is wrong by moves its rate along the line.
    by_parameter = np.zeros((2, len(fit.parameters)))
    by_parameter[0, 0] = 1.0
    by_parameter[1, rates] = line[1]
    by_parameter[1, rates - 1] = -shift * line[1]
    both = by_parameter @ covariance @ by_parameter.T
    difference = np.array([1.0, -1.0])
    shape_sigma, shift_sigma = np.sqrt(np.diag(both)).tolist()
    return OrderTest(
        light=np.exp(log_light),
        rate_per_s=np.exp(log_rate),
        rate_sigma_per_s=np.exp(log_rate) * np.sqrt(np.diag(of_rates)),
        shape=Measured(float(fit.parameters[0]), shape_sigma),
        shift=Measured(shift, shift_sigma),
        difference_sigma=float(np.sqrt(difference @ both @ difference)),
        chi2=fit.chi2,
        dof=fit.dof,
    )
