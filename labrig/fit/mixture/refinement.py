"""Least squares of the masked error.

Expectation maximisation finds the greatest likelihood, which weighs the faint tails of a dye like
its peak; the error that is reported, and seen, is the squared one.
"""

import numpy as np

from labrig.fit.least_squares import LeastSquaresFit, least_squares
from labrig.fit.mixture.entries import StokesEntries
from labrig.fit.mixture.gaussians import LEAST_WEIGHT, Gaussians
from labrig.foundation.arrays import FloatArray

#: Parameters of a component: log of its height, mean of the input, mean of the output, log of σ of
#: the input, rise of the output with the input, log of σ of the output at one input. They are the
#: Cholesky factor of its covariance, whose positive definiteness they keep.
PARAMETERS = 6
#: Bounds in units of `StokesEntries.unit_nm`: a mean stays within the measured wavelengths, σ
#: is no more than this, and the height no less than this times the largest entry.
LARGEST_SD, LEAST_HEIGHT, STEEPEST = 20.0, 1e-6, 20.0
#: Relative step at which a fit ends; gain, in parts of the squared light, at which one that is only
#: compared ends.
TOLERANCE, LEAST_GAIN = 1e-7, 1e-5
MAX_ITERATIONS = 400


def refined(
    entries: StokesEntries,
    start: Gaussians,
    scale: float,
    least_sd: float,
    is_final: bool,
) -> tuple[Gaussians, float, LeastSquaresFit]:
    """Minimise the weighted squared error of one mixture over all entries.

    Parameters
    ----------
    entries
        The entries.
    start
        One mixture, B = 1.
    scale
        Its scale: light in an entry per density in `unit_nm`.
    least_sd
        Least σ of a component in `unit_nm`.
    is_final
        Whether to go on to the minimum itself, or only as near as tells which start is best.

    Returns
    -------
    gaussians, scale, fit
        The mixture, its scale and the fit, whose residuals are weighted.
    """
    largest = float(entries.value.max())
    wanted = entries.weight * entries.wanted
    weight = entries.weight * largest * entries.relative_width
    x, y = entries.points

    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        columns = parameters.reshape(-1, PARAMETERS, 1)
        log_height, mean_x, mean_y, log_sd_x, slope, log_sd_y = np.moveaxis(columns, 1, 0)
        per_sd_x, per_sd_y = np.exp(-log_sd_x), np.exp(-log_sd_y)
        off_x = x - mean_x
        u, v = off_x * per_sd_x, (y - mean_y - slope * off_x) * per_sd_y
        value = np.exp(log_height - 0.5 * (u * u + v * v)) * weight
        by_mean_y = value * v * per_sd_y
        jacobian = np.empty((len(columns), PARAMETERS, len(x)))
        jacobian[:, 0] = value
        jacobian[:, 1] = value * u * per_sd_x - slope * by_mean_y
        jacobian[:, 2] = by_mean_y
        jacobian[:, 3] = value * u * u
        jacobian[:, 4] = by_mean_y * off_x
        jacobian[:, 5] = value * v * v
        return value.sum(axis=0) - wanted, jacobian.reshape(-1, len(x)).T

    count = start.weights.shape[-1]
    lower, upper = (
        np.tile([height, x_end, y_end, np.log(sd), slope, np.log(sd)], count)
        for height, x_end, y_end, sd, slope in (
            (np.log(LEAST_HEIGHT), x.min(), y.min(), least_sd, -STEEPEST),
            (np.inf, x.max(), y.max(), LARGEST_SD, STEEPEST),
        )
    )
    fit = least_squares(
        residuals,
        _parameters(start, scale / largest),
        lower=lower,
        upper=upper,
        max_iterations=MAX_ITERATIONS,
        tolerance=TOLERANCE,
        least_gain=0.0 if is_final else LEAST_GAIN * float(wanted @ wanted),
    )
    return *_gaussians(fit.parameters, largest), fit


def _parameters(start: Gaussians, scale: float) -> FloatArray:
    variance_x, covariance, variance_y = np.moveaxis(start.covariance[0], -1, 0)
    slope = covariance / variance_x
    remaining = variance_y - slope * covariance
    height = scale * start.weights[0] / (2 * np.pi * np.sqrt(variance_x * remaining))
    mean = start.mean[0]
    columns = [
        np.log(np.maximum(height, LEAST_WEIGHT)),
        mean[:, 0],
        mean[:, 1],
        0.5 * np.log(variance_x),
        slope,
        0.5 * np.log(remaining),
    ]
    return np.stack(columns, axis=-1).ravel()


def _gaussians(parameters: FloatArray, largest: float) -> tuple[Gaussians, float]:
    log_height, mean_x, mean_y, log_sd_x, slope, log_sd_y = parameters.reshape(-1, PARAMETERS).T
    amount = np.exp(log_height + log_sd_x + log_sd_y) * 2 * np.pi
    variance_x = np.exp(2 * log_sd_x)
    covariance = slope * variance_x
    variance_y = np.exp(2 * log_sd_y) + slope * covariance
    gaussians = Gaussians(
        (amount / amount.sum())[np.newaxis],
        np.stack([mean_x, mean_y], axis=-1)[np.newaxis],
        np.stack([variance_x, covariance, variance_y], axis=-1)[np.newaxis],
    )
    return gaussians, float(amount.sum()) * largest
