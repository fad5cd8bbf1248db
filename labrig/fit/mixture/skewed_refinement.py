"""Least squares of the masked error by skewed components, from normal ones."""

import numpy as np

from labrig.fit.least_squares import LeastSquaresFit, least_squares
from labrig.fit.mixture.entries import StokesEntries
from labrig.fit.mixture.gaussians import Gaussians
from labrig.fit.mixture.refinement import LARGEST_SD, LEAST_GAIN, LEAST_HEIGHT, TOLERANCE
from labrig.foundation.arrays import FloatArray

#: Parameters of a component: log of its height, then of input and of output the median, log of the
#: width and skew, then artanh of the correlation.
PARAMETERS = 8
#: Bounds: one side nine times as wide as the other, and no ridge narrower than the bands.
LARGEST_SKEW, LARGEST_CORRELATION = np.log(3.0), 0.95

#: Skews are little determined: their valleys are flat.
MAX_ITERATIONS = 1000


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
        log_height, *axes, slant = np.moveaxis(parameters.reshape(-1, PARAMETERS, 1), 1, 0)
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
    slant = np.arctanh(LARGEST_CORRELATION)
    lower, upper = (
        np.tile([height, x_end, np.log(sd), skew, y_end, np.log(sd), skew, steepest], count)
        for height, x_end, y_end, sd, skew, steepest in (
            (np.log(LEAST_HEIGHT), x.min(), y.min(), least_sd, -LARGEST_SKEW, -slant),
            (np.inf, x.max(), y.max(), LARGEST_SD, LARGEST_SKEW, slant),
        )
    )
    fit = least_squares(
        residuals,
        np.clip(_parameters(start, scale / largest), lower, upper),
        lower=lower,
        upper=upper,
        max_iterations=MAX_ITERATIONS,
        tolerance=TOLERANCE,
        least_gain=0.0 if is_final else LEAST_GAIN * float(wanted @ wanted),
    )
    return *_mixture(fit.parameters, largest), fit


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


def _parameters(start: Gaussians, scale: float) -> FloatArray:
    variance_x, covariance, variance_y = np.moveaxis(start.covariance[0], -1, 0)
    sd_x, sd_y = np.sqrt(variance_x), np.sqrt(variance_y)
    rho = np.clip(covariance / (sd_x * sd_y), -LARGEST_CORRELATION, LARGEST_CORRELATION)
    height = scale * start.weights[0] / (2 * np.pi * sd_x * sd_y * np.sqrt(1 - rho * rho))
    mean, no_skew = start.mean[0], np.zeros_like(rho)
    columns = [
        np.log(np.maximum(height, LEAST_HEIGHT)),
        mean[:, 0],
        np.log(sd_x),
        no_skew,
        mean[:, 1],
        np.log(sd_y),
        no_skew,
        np.arctanh(rho),
    ]
    return np.stack(columns, axis=-1).ravel()


def _mixture(parameters: FloatArray, largest: float) -> tuple[Gaussians, float, FloatArray]:
    log_height, x, log_sd_x, skew_x, y, log_sd_y, skew_y, slant = parameters.reshape(
        -1, PARAMETERS
    ).T
    sd_x, sd_y, rho = np.exp(log_sd_x), np.exp(log_sd_y), np.tanh(slant)
    amount = np.exp(log_height) * 2 * np.pi * sd_x * sd_y / np.cosh(slant)
    gaussians = Gaussians(
        (amount / amount.sum())[np.newaxis],
        np.stack([x, y], axis=-1)[np.newaxis],
        np.stack([sd_x**2, rho * sd_x * sd_y, sd_y**2], axis=-1)[np.newaxis],
    )
    return gaussians, float(amount.sum()) * largest, np.stack([skew_x, skew_y], axis=-1)
