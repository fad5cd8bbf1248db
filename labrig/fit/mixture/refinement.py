"""Least squares of the masked error.

Expectation maximisation finds the greatest likelihood, which weighs the faint tails of a dye like
its peak; the error that is reported, and seen, is the squared one.
"""

import numpy as np

from labrig.fit.mixture.entries import StokesEntries
from labrig.fit.mixture.gaussians import MIN_WEIGHT, Gaussians
from labrig.fit.nonlinear_least_squares import LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray

#: Parameters of a component: log of its height, mean of the input, mean of the output, log of σ of
#: the input, rise of the output with the input, log of σ of the output at one input. They are the
#: Cholesky factor of its covariance, whose positive definiteness they keep.
PARAMETERS = 6
#: Names of what a bound may hold, in this order.
NAMES = (
    "height",
    "mean of the incident light",
    "mean of the returning light",
    "σ of the incident light",
    "rise of the returning light with the incident",
    "σ of the returning light",
)
#: Bounds in units of `StokesEntries.unit_nm`: a mean stays within the measured wavelengths, σ
#: is no more than this, and the height no less than this times the largest entry.
MAX_SD, MIN_HEIGHT, STEEPEST = 20.0, 1e-6, 20.0
#: Relative step at which a fit ends; gain, in parts of the squared light, at which one that is only
#: compared ends.
TOLERANCE, MIN_GAIN = 1e-7, 1e-5
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
            (np.log(MIN_HEIGHT), x.min(), y.min(), least_sd, -STEEPEST),
            (np.inf, x.max(), y.max(), MAX_SD, STEEPEST),
        )
    )
    fit = least_squares(
        residuals,
        _parameters(start, scale / largest),
        lower=lower,
        upper=upper,
        max_iterations=MAX_ITERATIONS,
        tolerance=TOLERANCE,
        least_gain=0.0 if is_final else MIN_GAIN * float(wanted @ wanted),
    )
    return *_gaussians(fit.parameters, largest), fit


def _parameters(start: Gaussians, scale: float) -> FloatArray:
    variance_x, covariance, variance_y = np.moveaxis(start.covariance[0], -1, 0)
    slope = covariance / variance_x
    remaining = variance_y - slope * covariance
    height = scale * start.weights[0] / (2 * np.pi * np.sqrt(variance_x * remaining))
    mean = start.mean[0]
    columns = [
        np.log(np.maximum(height, MIN_WEIGHT)),
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


#: Parameters of a component: log of its height, then of input and of output the median, log of the
#: width and skew, then artanh of the correlation.
SKEWED_PARAMETERS = 8
SKEWED_NAMES = (
    "height",
    *(f"{what} of the incident light" for what in ("median", "σ", "skew")),
    *(f"{what} of the returning light" for what in ("median", "σ", "skew")),
    "correlation",
)

#: Bounds: one side nine times as wide as the other, and no ridge narrower than the bands.
MAX_SKEW, MAX_CORRELATION = np.log(3.0), 0.95

#: Skews are little determined: their valleys are flat.
MAX_SKEWED_ITERATIONS = 1000


def refined_skewed(
    entries: StokesEntries, start: Gaussians, scale: float, least_sd: float, is_final: bool
) -> tuple[Gaussians, float, FloatArray, LeastSquaresFit]:
    """Minimise the squared error of one mixture over all entries, its components' skews free.

    Parameters
    ----------
    entries
        The entries.
    start
        One mixture, B = 1.
    scale
        Its scale: light in an entry per density in `unit_nm`.
    least_sd
        Least width of a component in `unit_nm`.
    is_final
        Whether to go on to the minimum itself.

    Returns
    -------
    gaussians, scale, skew, fit
        The mixture without its skews, its scale, the skews in input and output, shape (K, 2), and
        the fit, whose residuals are weighted.
    """
    largest = float(entries.value.max())
    wanted = entries.weight * entries.wanted
    weight = entries.weight * largest * entries.relative_width
    x, y = entries.points

    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        log_height, *axes, slant = np.moveaxis(parameters.reshape(-1, SKEWED_PARAMETERS, 1), 1, 0)
        u, log_rate_x, by_x = _axis(x, *axes[:3])
        v, log_rate_y, by_y = _axis(y, *axes[3:])
        rho, spread = np.tanh(slant), 1 / np.cosh(slant)
        q = (v - rho * u) / spread
        log_value = log_height + log_rate_x + log_rate_y - 0.5 * (u * u + q * q)
        value = np.exp(log_value) * weight
        by_u, by_v = q * rho / spread - u, -q / spread
        slopes = [
            np.ones_like(value),
            *(by_u * step + rise for step, rise in by_x),
            *(by_v * step + rise for step, rise in by_y),
            q * (u - rho * v) / spread,
        ]
        jacobian = value[:, np.newaxis] * np.stack(slopes, axis=1)
        return value.sum(axis=0) - wanted, jacobian.reshape(-1, len(x)).T

    count = start.weights.shape[-1]
    slant = np.arctanh(MAX_CORRELATION)
    lower, upper = (
        np.tile([height, x_end, np.log(sd), skew, y_end, np.log(sd), skew, steepest], count)
        for height, x_end, y_end, sd, skew, steepest in (
            (np.log(MIN_HEIGHT), x.min(), y.min(), least_sd, -MAX_SKEW, -slant),
            (np.inf, x.max(), y.max(), MAX_SD, MAX_SKEW, slant),
        )
    )
    fit = least_squares(
        residuals,
        np.clip(_skewed_parameters(start, scale / largest), lower, upper),
        lower=lower,
        upper=upper,
        max_iterations=MAX_SKEWED_ITERATIONS,
        tolerance=TOLERANCE,
        least_gain=0.0 if is_final else MIN_GAIN * float(wanted @ wanted),
    )
    return *_skewed_mixture(fit.parameters, largest), fit


def _axis(
    place: FloatArray, median: FloatArray, log_sd: FloatArray, skew: FloatArray
) -> tuple[FloatArray, FloatArray, list[tuple[FloatArray, FloatArray]]]:
    """Return the variate u, the log of its rate, and how both change with the three parameters."""
    z = (place - median) * np.exp(-log_sd)
    cosh, sinh = np.cosh(skew), np.sinh(skew)
    stretched = z * cosh + sinh
    root = np.sqrt(1 + stretched * stretched)
    tilt = stretched / root
    variate = stretched * cosh - root * sinh
    rate = cosh - sinh * tilt
    # Of du/dz = cosh · rate, d log / dz and d log / dskew.
    bend = -sinh / root**3 / rate
    by_z = bend * cosh
    stretch = z * sinh + cosh
    by_skew = sinh / cosh + (sinh - cosh * tilt) / rate + bend * stretch
    slope = cosh * rate
    per_sd = np.exp(-log_sd)
    changes = [
        (-slope * per_sd, -by_z * per_sd),
        (-slope * z, -by_z * z),
        (stretched * sinh - root * cosh + rate * stretch, by_skew),
    ]
    return variate, np.log(slope), changes


def _skewed_parameters(start: Gaussians, scale: float) -> FloatArray:
    variance_x, covariance, variance_y = np.moveaxis(start.covariance[0], -1, 0)
    sd_x, sd_y = np.sqrt(variance_x), np.sqrt(variance_y)
    rho = np.clip(covariance / (sd_x * sd_y), -MAX_CORRELATION, MAX_CORRELATION)
    height = scale * start.weights[0] / (2 * np.pi * sd_x * sd_y * np.sqrt(1 - rho * rho))
    mean, no_skew = start.mean[0], np.zeros_like(rho)
    columns = [
        np.log(np.maximum(height, MIN_HEIGHT)),
        mean[:, 0],
        np.log(sd_x),
        no_skew,
        mean[:, 1],
        np.log(sd_y),
        no_skew,
        np.arctanh(rho),
    ]
    return np.stack(columns, axis=-1).ravel()


def _skewed_mixture(parameters: FloatArray, largest: float) -> tuple[Gaussians, float, FloatArray]:
    log_height, x, log_sd_x, skew_x, y, log_sd_y, skew_y, slant = parameters.reshape(
        -1, SKEWED_PARAMETERS
    ).T
    sd_x, sd_y, rho = np.exp(log_sd_x), np.exp(log_sd_y), np.tanh(slant)
    amount = np.exp(log_height) * 2 * np.pi * sd_x * sd_y / np.cosh(slant)
    gaussians = Gaussians(
        (amount / amount.sum())[np.newaxis],
        np.stack([x, y], axis=-1)[np.newaxis],
        np.stack([sd_x**2, rho * sd_x * sd_y, sd_y**2], axis=-1)[np.newaxis],
    )
    return gaussians, float(amount.sum()) * largest, np.stack([skew_x, skew_y], axis=-1)
