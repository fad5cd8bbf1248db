"""A smooth non-negative spectrum of rates, its smoothness chosen by the data.

Every completely monotone decay is a sum of exponentials with non-negative amplitudes. On a fixed
grid of rates a penalty on the amplitudes' second differences makes their spectrum smooth; its
strength is the one of lowest BIC, with the trace of the fit's hat matrix as number of parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit.decay.noise_correlation import NoiseLikelihood
from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.decay.variable_projection import projection
from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.material import exponential_means
from labrig.results import FittedRateSpectrum

#: Number of rates of the grid.
RATES = 28
#: Logarithm of the slowest rate, in 1/spans, beside a free offset. Slower ones and a negative
#: offset cancel: the signal would be as uncertain as one likes.
SLOWEST_BESIDE_OFFSET = -float(np.log(3.0))
#: Largest decay exponent k t from lamp off to the first frame: squares overflow beyond e^300.
MAX_PHASE = 300.0
#: Strengths of the penalty relative to the data's own information on an amplitude. Below, a
#: spectrum is no longer smooth: it is a few exponentials.
STRENGTHS = 10.0 ** np.arange(-6.0, 0.1, 0.5)


@dataclass(frozen=True)
class _Smoothed:
    """Amplitudes at one strength, which of them are kept, and what tells how good they are."""

    amplitudes: FloatArray
    kept: NDArray[np.bool_]
    chi2: float
    n_parameters: float
    penalty: FloatArray

    def bic(self, deviance: float, independent: float) -> float:
        return deviance + self.n_parameters * float(np.log(independent))


def fit_rate_spectrum(
    likelihood: NoiseLikelihood, weights: FloatArray, student: float
) -> FittedRateSpectrum | None:
    """Fit a smooth spectrum of rates at given channel weights.

    Parameters
    ----------
    likelihood
        Likelihood of the whitened series.
    weights
        Weights of the channels, shape (C,).
    student
        Factor of the covariance where the noise was estimated.

    Returns
    -------
    FittedRateSpectrum or None
        The spectrum in the user's units; None if it has no signal.
    """
    data = likelihood.data
    series = data.series
    problem = projection(data, weights)
    low, high = series.log_rate_bounds
    if series.start > 0:
        high = min(high, float(np.log(MAX_PHASE / series.start)))
    if np.isinf(series.offset_sigma).any():
        low = max(low, SLOWEST_BESIDE_OFFSET)
    rates = np.exp(np.linspace(low, high, RATES))
    means = exponential_means(rates, series.t, series.exposure)
    columns = problem.columns(means)
    # All that a strength needs of the data is in RATES + 1 rows.
    stacked = np.column_stack([columns, problem.target])
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    design, target = triangle[:, :RATES], triangle[:, RATES]
    # The strength is a parameter, too.
    n_others = len(weights) + len(series.fitted_offsets)
    scale = float(np.trace(design.T @ design)) / RATES
    # Beyond the grid the spectrum vanishes: else a slow rate would take what an offset is.
    padded = np.pad(np.eye(RATES), ((1, 1), (0, 0)))
    differences = np.sqrt(scale) * np.diff(padded, 2, axis=0)
    fits = _smoothed(design, target, differences, np.sqrt(STRENGTHS), n_others)
    independent = data.independent_data(weights)
    best = min(fits, key=lambda fit: fit.bic(fit.chi2, independent))
    if not best.amplitudes.any():
        return None
    deviance = likelihood.deviance(problem.target - columns @ best.amplitudes)
    # Amplitudes are fitted at the first frame, given at the reference.
    growth = np.append(np.exp(rates * series.start), 1.0) * series.peak
    kept = data.signal_design(problem.unit, means[:, best.kept])
    offsets = data.offsets_of(data.target - kept @ best.amplitudes[best.kept])
    covariance = _covariance(data, kept, best, int(np.argmax(weights)))
    n_values = series.n_values + len(series.offset_prior)
    dof = n_values - best.n_parameters - (len(series.repeats) - 1)
    return FittedRateSpectrum(
        rates_per_s=rates / series.span_s,
        amplitudes=best.amplitudes * growth[:-1],
        covariance=(
            student * covariance * np.outer(growth, growth)
            if np.isfinite(student)
            else np.full_like(covariance, np.inf)
        ),
        n_parameters=best.n_parameters,
        channel_weights=tuple(weights.tolist()),
        offsets=tuple((offsets * series.peak).tolist()),
        reduced_chi2=best.chi2 / dof if dof > 0 else float("nan"),
        bic=best.bic(deviance, independent),
    )


def _covariance(
    data: WhitenedSeries, kept: FloatArray, best: _Smoothed, brightest: int
) -> FloatArray:
    """Return the covariance of all amplitudes and the brightest channel's offset.

    `kept` is the design of the amplitudes above 0.
    """
    offsets = data.offset_design
    precision = np.block(
        [[kept.T @ kept + best.penalty, kept.T @ offsets], [offsets.T @ kept, offsets.T @ offsets]]
    )
    n_kept = kept.shape[1]
    fitted = np.flatnonzero(data.series.fitted_offsets == brightest)
    rows = np.concatenate([np.flatnonzero(best.kept), np.full(len(fitted), len(best.kept))])
    own = np.concatenate([np.arange(n_kept), n_kept + fitted])
    covariance = np.zeros((len(best.kept) + 1, len(best.kept) + 1))
    covariance[np.ix_(rows, rows)] = np.linalg.inv(precision)[np.ix_(own, own)]
    return covariance


def _smoothed(
    design: FloatArray,
    target: FloatArray,
    differences: FloatArray,
    roots: Sequence[float] | FloatArray,
    n_others: int,
) -> list[_Smoothed]:
    """Return the fit at each strength, whose root multiplies the differences."""
    fits = []
    padded = np.append(target, np.zeros(len(differences)))
    information = design.T @ design
    for root in roots:
        amplitudes = nonnegative_least_squares(np.vstack([design, root * differences]), padded)
        kept = amplitudes > 0
        both = information[np.ix_(kept, kept)]
        penalty = root**2 * (differences.T @ differences)[np.ix_(kept, kept)]
        residual = target - design @ amplitudes
        n_parameters = n_others + float(np.trace(np.linalg.solve(both + penalty, both)))
        chi2 = float(residual @ residual)
        fits.append(_Smoothed(amplitudes, kept, chi2, n_parameters, penalty))
    return fits
