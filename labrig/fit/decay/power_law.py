"""The rival of a sum of exponentials: A (1 + t/τ)^(−p).

Traps of many depths, or electrons and holes that must meet, decay by a power law (Jonscher and
de Polignac 1984). It is fitted to the same series with the same noise, to say so when it does better.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.joint import JointFit, fit_jointly
from labrig.fit.decay.search import projection
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.shapes import power_law_mean
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray

#: Exponents considered: an exponential is the limit of large p, so there must be an end.
EXPONENTS = (0.1, 10.0)
#: τ from this share of the shortest step between frames …
SHORTEST_STEPS = 0.01
#: … to this many spans.
LONGEST_SPANS = 100.0
GRID = (24, 12)
MAX_ITERATIONS = 60
TOLERANCE = 1e-5


@dataclass(frozen=True)
class PowerLaw:
    """A (1 + t/τ)^(−p) in the brightest channel, A in the values' units at lamp off.

    Attributes
    ----------
    amplitude, tau_s, exponent
        A, τ, p.
    exponent_sigma
        σ(p).
    """

    amplitude: float
    tau_s: float
    exponent: float
    exponent_sigma: float


def fit_power_law(data: WhitenedSeries, weights: FloatArray, offset: float) -> JointFit:
    """Least squares from the best of a grid of τ and p; `shape` is [A, log τ, p], τ in spans."""
    series = data.series
    time = series.t + series.start
    steps = np.diff(series.t)
    low = np.log(SHORTEST_STEPS * steps[steps > 0].min())
    high = np.log(LONGEST_SPANS)

    def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        tau, exponent = float(np.exp(theta[1])), float(theta[2])
        mean, slopes = power_law_mean(tau, exponent, time, series.exposure)
        return theta[0] * mean, np.column_stack([mean, theta[0] * slopes])

    log_tau, exponents = (
        grid.ravel()
        for grid in np.meshgrid(np.linspace(low, high, GRID[0]), np.geomspace(*EXPONENTS, GRID[1]))
    )
    problem = projection(data, weights)
    middle = time + series.exposure / 2
    means = (1 + np.multiply.outer(middle, np.exp(-log_tau))) ** -exponents
    columns = problem.columns(means)
    moments = problem.target @ columns
    norms2 = np.einsum("ij,ij->j", columns, columns)
    best = int(np.argmax(np.maximum(moments, 0) ** 2 / norms2))
    return fit_jointly(
        data,
        shape,
        np.array([max(moments[best], 0) / norms2[best], log_tau[best], exponents[best]]),
        weights,
        offset,
        np.array([0.0, low, EXPONENTS[0]]),
        np.array([np.inf, high, EXPONENTS[1]]),
        MAX_ITERATIONS,
        TOLERANCE,
    )


def power_law(fit: JointFit, series: DecaySeries) -> PowerLaw:
    """The fit in the user's units."""
    amplitude, log_tau, exponent = fit.shape
    return PowerLaw(
        amplitude=float(amplitude) * series.peak,
        tau_s=float(np.exp(log_tau)) * series.span_s,
        exponent=float(exponent),
        exponent_sigma=float(fit.least_squares.sigma[2]),
    )
