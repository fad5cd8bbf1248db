"""Fits of the laws of decay that are no sum of a few exponentials.

They are fitted to the same series with the same noise and the same offsets as the exponentials, so
that their χ² compare. Traps of many depths and the recombination of electrons and holes decay like
this (Nalbach et al., section 4.4).

The signal at lamp off, long before the first frame, follows the rate as a power: along that curved
valley a search creeps. The level that is fitted is therefore that at the time about which the
frames tell it, which hardly depends on rate and shape.
"""

from dataclasses import dataclass, replace

import numpy as np

from labrig.fit.decay.joint import JointFit, Shape, covariance_under_flicker, fit_jointly
from labrig.fit.decay.law_search import law_minima, log_rate_bounds
from labrig.fit.decay.noise_likelihood import NoiseLikelihood
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import parameter_covariance
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import DECAY_LAWS, DecayLaw
from labrig.results import FittedLaw

#: Places of the rate and of the shape among the parameters.
LAW_RATE, LAW_SHAPE = slice(1, 2), 2
MAX_ITERATIONS = 200
TOLERANCE = 1e-8


class UnfinishedFitError(FitError):
    """A fit that did not end at a minimum, whose χ² must not be compared."""


@dataclass(frozen=True)
class LawFit:
    """Fit of a law in the series' own units, and in the user's.

    Attributes
    ----------
    joint
        Joint fit; its `shape` is [amplitude, log rate, shape of the law].
    covariance
        Covariance of all fitted parameters, shape (p, p).
    fitted
        The law in the user's units.
    """

    joint: JointFit
    covariance: FloatArray
    fitted: FittedLaw

    def signal(self, series: DecaySeries) -> FloatArray:
        """Return the law without offset, shape (n, C)."""
        h, _ = _shape(series, DECAY_LAWS[self.fitted.name])(self.joint.shape)
        return np.multiply.outer(h, self.joint.weights)

    def with_added(self, covariance: FloatArray, series: DecaySeries) -> "LawFit":
        """Return the fit with a covariance (p, p) added to its own."""
        total = self.covariance + covariance
        if self.covariance[LAW_SHAPE, LAW_SHAPE] == 0:
            total = _without_shape(total)
        fitted = replace(self.fitted, covariance=_own_covariance(self.joint, series, total))
        return replace(self, covariance=total, fitted=fitted)


def fit_law(
    likelihood: NoiseLikelihood,
    law: DecayLaw,
    weights: FloatArray,
    offsets: FloatArray,
    added_square: float,
    student: float,
) -> LawFit | None:
    """Fit a law from the places that may be its best at given channel weights.

    Parameters
    ----------
    likelihood
        Likelihood of the whitened series.
    law
        The law.
    weights, offsets
        Start values of the channels, shape (C,).
    added_square
        Mean square of the flicker less that of the series' noise.
    student
        Factor of the covariance where the noise was estimated.

    Returns
    -------
    LawFit or None
        The fit; None if the law has no signal.

    Raises
    ------
    UnfinishedFitError
        The lowest fit did not end at a minimum.
    """
    problem = _LawProblem(likelihood.data, law, weights, offsets)
    series = problem.data.series
    fits = problem.fits()
    if not fits:
        return None
    fit = min(fits, key=lambda each: each.chi2)
    if fit.shape[0] == 0:
        return None
    if fit.least_squares.creeps:
        raise UnfinishedFitError(f"the fit of {law.label} did not end at a minimum")
    # Near an exponential, retrapping changes the signal as the rate does: its σ has no limit there.
    least, largest = law.shapes
    if not np.sqrt(fit.least_squares.covariance[LAW_SHAPE, LAW_SHAPE]) <= largest - least:
        fit = _with_shape_held(fit)
    signal = np.multiply.outer(_shape(series, law)(fit.shape)[0], fit.weights)
    covariance = covariance_under_flicker(fit, problem.data, signal, added_square)
    with np.errstate(invalid="ignore"):
        covariance = np.where(covariance == 0, 0.0, student * covariance)
    return LawFit(fit, covariance, _in_units(law, fit, series, covariance, likelihood.bic(fit)))


def fit_laws(
    likelihood: NoiseLikelihood,
    weights: FloatArray,
    offsets: FloatArray,
    added_square: float,
    student: float,
) -> tuple[tuple[LawFit, ...], tuple[str, ...]]:
    """Fit every law; the arguments are those of `fit_law`.

    Returns
    -------
    fits
        Fits of the laws that have a signal and ended at a minimum.
    unfinished
        Names of the laws whose fit did not, which must not be compared.
    """
    fits, unfinished = [], []
    for law in DECAY_LAWS.values():
        try:
            fit = fit_law(likelihood, law, weights, offsets, added_square, student)
        except UnfinishedFitError:
            unfinished.append(law.name)
            continue
        if fit is not None:
            fits.append(fit)
    return tuple(fits), tuple(unfinished)


def _shape(series: DecaySeries, law: DecayLaw) -> Shape:
    """Return the law as a function of [amplitude, log rate, shape]."""
    time = series.t + series.start

    def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        means, slopes = law.means(float(np.exp(theta[1])), float(theta[2]), time, series.exposure)
        return theta[0] * means, np.column_stack([means, theta[0] * slopes])

    return shape


@dataclass(frozen=True)
class _LawProblem:
    """A law, the series that it is fitted to, and start values of the channels (C,)."""

    data: WhitenedSeries
    law: DecayLaw
    weights: FloatArray
    offsets: FloatArray

    def fits(self) -> list[JointFit]:
        """Return the fits from the minima that may be the lowest."""
        minima = law_minima(self.data, self.law, self.weights)
        fits = (self._fit(minimum) for minimum in minima)
        return [fit for fit in fits if fit is not None]

    def _fit(self, start: FloatArray) -> JointFit | None:
        """Return the fit from [amplitude, log rate, shape], if there is one."""
        pivot = self._pivot(start)
        low, high = log_rate_bounds(self.data.series)
        least, largest = self.law.shapes
        level, _ = self._level(start, pivot)
        try:
            fit = fit_jointly(
                self.data,
                self._pivoted(pivot),
                np.array([start[0] * level, *start[1:]]),
                self.weights,
                self.offsets,
                np.array([0.0, low, least]),
                np.array([np.inf, high, largest]),
                MAX_ITERATIONS,
                TOLERANCE,
            )
        except FitError:
            return None
        return self._from_reference(fit, pivot)

    def _pivot(self, theta: FloatArray) -> float:
        """Return the time about which the frames tell the level of a signal."""
        series, unit = self.data.series, self.data.constant(self.weights)
        signal, _ = _shape(series, self.law)(theta)
        information = np.einsum("fc,fc->f", unit, unit) * signal**2
        middle = series.t + series.start + series.exposure / 2
        return float(information @ middle / information.sum())

    def _level(self, theta: FloatArray, pivot: float) -> tuple[float, FloatArray]:
        """Return the signal at a time over that at the reference, and its slopes (2,)."""
        rate, shape = float(np.exp(theta[1])), float(theta[2])
        level, slopes = self.law.means(rate, shape, np.array([pivot]), np.zeros(1))
        return float(level[0]), slopes[0]

    def _pivoted(self, pivot: float) -> Shape:
        """Return the law as a function of [level at the pivot, log rate, shape]."""
        series = self.data.series
        time, exposure = np.append(series.t + series.start, pivot), np.append(series.exposure, 0.0)

        def shape(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
            means, slopes = self.law.means(float(np.exp(theta[1])), float(theta[2]), time, exposure)
            unit = means[:-1] / means[-1]
            changes = (slopes[:-1] - np.outer(unit, slopes[-1])) / means[-1]
            return theta[0] * unit, np.column_stack([unit, theta[0] * changes])

        return shape

    def _from_reference(self, fit: JointFit, pivot: float) -> JointFit:
        """Return a fit of the level at the pivot as one of [amplitude, log rate, shape]."""
        level, slopes = self._level(fit.shape, pivot)
        theta = np.array([fit.shape[0] / level, *fit.shape[1:]])
        solution = fit.least_squares
        jacobian = solution.jacobian.copy()
        jacobian[:, 1:3] += np.outer(jacobian[:, 0], theta[0] * slopes)
        jacobian[:, 0] *= level
        # What the frames tell nothing of may overflow: that is as good as infinite.
        with np.errstate(over="ignore"):
            covariance = parameter_covariance(jacobian)[0]
        solution = replace(
            solution,
            parameters=np.concatenate([theta, solution.parameters[3:]]),
            jacobian=jacobian,
            covariance=covariance,
        )
        return replace(fit, shape=theta, least_squares=solution)


def _with_shape_held(fit: JointFit) -> JointFit:
    """Return a fit in whose covariance the shape is no parameter."""
    jacobian = fit.least_squares.jacobian.copy()
    jacobian[:, LAW_SHAPE] = 0.0
    covariance = _without_shape(parameter_covariance(jacobian)[0])
    solution = replace(fit.least_squares, jacobian=jacobian, covariance=covariance)
    return replace(fit, least_squares=solution)


def _without_shape(covariance: FloatArray) -> FloatArray:
    """Return a covariance (p, p) with nothing of the shape."""
    held = covariance.copy()
    held[LAW_SHAPE, :] = held[:, LAW_SHAPE] = 0.0
    return held


def _in_units(
    law: DecayLaw, fit: JointFit, series: DecaySeries, covariance: FloatArray, fit_bic: float
) -> FittedLaw:
    """Return the fit in the user's units; `covariance` is that of all fitted parameters."""
    amplitude, log_rate, shape = (float(value) for value in fit.shape)
    n_values = series.n_values + len(series.offset_prior)
    dof = n_values - fit.n_parameters - (len(series.repeats) - 1)
    return FittedLaw(
        name=law.name,
        amplitude=amplitude * series.peak,
        rate_per_s=float(np.exp(log_rate)) / series.span_s,
        shape=shape,
        covariance=_own_covariance(fit, series, covariance),
        channel_weights=tuple(fit.weights.tolist()),
        offsets=tuple((fit.offsets * series.peak).tolist()),
        reduced_chi2=fit.chi2 / dof if dof > 0 else float("nan"),
        bic=fit_bic,
    )


def _own_covariance(fit: JointFit, series: DecaySeries, covariance: FloatArray) -> FloatArray:
    """Return the covariance of amplitude, rate, shape and offset in the user's units, (4, 4)."""
    rate_per_s = float(np.exp(fit.shape[1])) / series.span_s
    units = np.array([series.peak, rate_per_s, 1.0, series.peak])
    own = np.zeros((4, 4))
    fitted = np.flatnonzero(series.fitted_offsets == fit.brightest)
    rows = [0, 1, 2, *(3 + len(fit.weights) - 1 + fitted)]
    own[: len(rows), : len(rows)] = covariance[np.ix_(rows, rows)]
    with np.errstate(invalid="ignore"):
        return np.where(own == 0, 0.0, own * np.outer(units, units))
