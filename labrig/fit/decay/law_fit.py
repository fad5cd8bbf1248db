"""Fits of the laws of decay that are no sum of a few exponentials.

They are fitted to the same series with the same noise and the same offsets as the exponentials, so
that their χ² compare. Traps of many depths and the recombination of electrons and holes decay like
this (Nalbach et al., section 4.4).

The signal at lamp off, long before the first frame, follows the rate as a power: along that curved
valley a search creeps. The level that is fitted is therefore that at the time about which the
frames tell it, which hardly depends on rate and shape.

At given channel weights the level of a law and the offsets follow from its rate and shape by linear
least squares, so that χ² is a function of two numbers. A grid of them shows its basins. From these,
from the simpler laws that it contains, and from every shape where the shape hardly matters, damped
Gauss–Newton steps descend, each search in a row of the same arrays: with some dozens of frames ten
searches take hardly longer than one. Frames that follow each other much faster than the signal can
change are merged; the joint fit to all of them adds the last digits.

References
----------
G. H. Golub, V. Pereyra, *Inverse Problems* 19 (2003) R1, for variable projection; L. Kaufman, *BIT*
15 (1975) 49, for its slopes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from labrig.fit.decay.noise_correlation import NoiseLikelihood
from labrig.fit.decay.series import DecaySeries, WhitenedSeries
from labrig.fit.decay.variable_projection import (
    JointFit,
    Shape,
    covariance_under_flicker,
    fit_jointly,
    projection,
)
from labrig.fit.nonlinear_least_squares import parameter_covariance
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.foundation.errors import FitError
from labrig.foundation.result_warning import Misfit, ResultWarning
from labrig.material import DECAY_LAWS, DecayLaw
from labrig.results import (
    EXPONENTIALS,
    LAW_LABELS,
    RATE_SPECTRUM,
    ComparedLaw,
    FittedDecay,
    FittedLaw,
)

#: Largest rate at lamp off in inverse shortest steps between frames, and smallest in spans: laws
#: other than exponentials fall fast at first, and go on falling.
FASTEST_STEPS, SLOWEST_SPANS = 100.0, 100.0
#: Sizes of the grid of rates and shapes, smallest shape above 0 on it, and most of its basins from
#: which a search starts.
GRID = (36, 16)
MIN_SHAPE = 1e-5
MAX_BASINS = 4
#: Steps in time, relative to the time since the first frame, within which frames are merged: for
#: the grid, which only shows where to start, and for the search.
GRID_MERGED, MERGED = 0.05, 0.01
#: Steps of a search of the rate at each shape, and of both.
PROFILE_STEPS, MAX_STEPS = 4, 60
#: First damping, and its factors after a step that descends and after another one.
DAMPING, LESS, MORE = 1e-3, 0.1, 4.0
#: Gain in χ² of a step at which a search ends.
ENOUGH = 1e-3
#: Difference in χ², absolute and relative, by which a minimum may be above the lowest one and be
#: that after the joint fit.
CLOSE, RELATIVELY_CLOSE = 4.0, 0.02
#: Distance in σ below which two places are the same minimum.
SAME = 0.1


def log_rate_bounds(series: DecaySeries) -> tuple[float, float]:
    """Return the logarithms of the slowest and the fastest rate of a law, in 1/spans."""
    return -float(np.log(SLOWEST_SPANS)), float(np.log(FASTEST_STEPS / series.shortest_step))


def law_minima(data: WhitenedSeries, law: DecayLaw, weights: FloatArray) -> FloatArray:
    """Return [amplitude, log rate, shape] at the distinct minima of a law that may be the lowest.

    Parameters
    ----------
    data
        The whitened series.
    law
        The law.
    weights
        Weights of the channels, shape (C,).

    Returns
    -------
    ndarray
        The minima, the lowest first, shape (m, 3); none where nothing has a signal.
    """
    low, high = log_rate_bounds(data.series)
    least, largest = law.shapes
    frames = _Frames.of(data, weights)
    log_rates = np.linspace(low, high, GRID[0])
    shapes = np.geomspace(max(least, MIN_SHAPE), largest, GRID[1])
    with_limits = np.append(shapes, law.limits)
    gains = frames.merged(GRID_MERGED).gains(law, log_rates, with_limits)
    frames = frames.merged(MERGED)
    # The best rate at each shape.
    at_shapes = np.column_stack([log_rates[gains.argmax(axis=1)], with_limits])
    at_shapes = at_shapes[gains.max(axis=1) > 0]
    held = at_shapes[:, 1:]
    lows, highs = np.insert(held, 0, low, axis=1), np.insert(held, 0, high, axis=1)
    profile = frames.descended(law, at_shapes, lows, highs, PROFILE_STEPS)
    is_close = profile.chi2 <= profile.chi2.min(initial=np.inf) + CLOSE
    is_start = is_close | np.isin(at_shapes[:, 1], law.limits)
    places = _basins(gains[: len(shapes)])
    starts = np.concatenate(
        [profile.x[is_start], np.column_stack([log_rates[places[1]], shapes[places[0]]])]
    )
    return frames.descended(law, starts, [low, least], [high, largest], MAX_STEPS).lowest()


def _basins(gains: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of the highest gains of a grid that are higher than all around them."""
    is_basin = (gains == maximum_filter(gains, size=3, mode="nearest")) & (gains > 0)
    rows, columns = np.nonzero(is_basin)
    best = np.argsort(-gains[rows, columns], kind="stable")[:MAX_BASINS]
    return rows[best], columns[best]


@dataclass(frozen=True)
class _Frames:
    """Linear part of the fit of a law, the offsets eliminated, of frames that may be merged.

    Attributes
    ----------
    since_first, begin, exposure
        Begins of the exposures since that of the first frame and since the reference, and their
        lengths, in spans, shape (n,).
    information, pull, shadow
        As those of `Projection`, shape (n,), (n,) and (m, n).
    chi2
        χ² without a signal.
    """

    since_first: FloatArray
    begin: FloatArray
    exposure: FloatArray
    information: FloatArray
    pull: FloatArray
    shadow: FloatArray
    chi2: float

    @classmethod
    def of(cls, data: WhitenedSeries, weights: FloatArray) -> "_Frames":
        """Return all frames of a series at channel weights (C,)."""
        series, problem = data.series, projection(data, weights)
        return cls(
            series.t,
            series.t + series.start,
            series.exposure,
            problem.information,
            problem.pull,
            problem.shadow,
            float(problem.target @ problem.target),
        )

    def merged(self, relative_step: float) -> "_Frames":
        """Return the frames with those merged that are about as long after the first one."""
        with np.errstate(divide="ignore"):
            steps = np.floor(np.log(self.since_first) / np.log1p(relative_step))
        firsts = np.flatnonzero(np.append(True, steps[1:] > steps[:-1]))
        if len(firsts) == len(steps):
            return self
        # Where nothing was measured, a frame counts as little as it may.
        weight = np.maximum(self.information, np.finfo(float).tiny)
        total = np.add.reduceat(weight, firsts)
        since_first, begin, exposure = (
            np.add.reduceat(weight * each, firsts) / total
            for each in (self.since_first, self.begin, self.exposure)
        )
        information, pull, shadow = (
            np.add.reduceat(each, firsts, axis=-1)
            for each in (self.information, self.pull, self.shadow)
        )
        return _Frames(
            since_first,
            begin,
            exposure,
            information,
            pull,
            shadow,
            self.chi2,
        )

    def gains(self, law: DecayLaw, log_rates: FloatArray, shapes: FloatArray) -> FloatArray:
        """Return the fall of χ² by a law on a grid of rates (r,) and shapes (s,), shape (s, r).

        Exposures count as their middles.
        """
        log_rate, shape = np.meshgrid(log_rates, shapes)
        phases = np.multiply.outer(np.exp(log_rate.ravel()), self.begin + self.exposure / 2)
        values = law.value(phases, shape.reshape(-1, 1))
        norms2 = values**2 @ self.information - ((values @ self.shadow.T) ** 2).sum(axis=1)
        moments = np.maximum(values @ self.pull, 0.0)
        gains = moments**2 / np.where(norms2 > 0, norms2, np.inf)
        return np.asarray(gains.reshape(log_rate.shape))

    def at(self, law: DecayLaw, x: FloatArray) -> "_Places":
        """Return the fit of a law at [log rate, shape], shape (k, 2)."""
        with np.errstate(all="ignore"):
            means, slopes = law.means(np.exp(x[:, :1]), x[:, 1:], self.begin, self.exposure)
            columns = np.concatenate([means[:, None], np.moveaxis(slopes, 2, 1)], axis=1)
            shadows = columns @ self.shadow.T
            gram = (columns * self.information) @ np.swapaxes(columns, 1, 2)
            gram -= shadows @ np.swapaxes(shadows, 1, 2)
            moments = columns @ self.pull
            level = np.maximum(moments[:, 0], 0.0) / gram[:, 0, 0]
            by_level = gram[:, 0, 1:]
            slope = -level[:, None] * (moments[:, 1:] - level[:, None] * by_level)
            own = gram[:, 1:, 1:] - by_level[:, :, None] * by_level[:, None] / gram[:, :1, :1]
            curvature = level[:, None, None] ** 2 * own
        chi2 = self.chi2 - level * moments[:, 0]
        is_finite = np.isfinite(chi2) & np.isfinite(slope).all(1) & np.isfinite(own).all((1, 2))
        return _Places(x, level, np.where(is_finite, chi2, np.inf), slope, curvature)

    def descended(
        self, law: DecayLaw, starts: FloatArray, low: ArrayLike, high: ArrayLike, most_steps: int
    ) -> "_Places":
        """Return where searches from some starts (k, 2) end within bounds, broadcast to (k, 2)."""
        low, high = np.broadcast_to(low, starts.shape), np.broadcast_to(high, starts.shape)
        ends = self.at(law, np.clip(starts, low, high))
        damping = np.full(len(starts), DAMPING)
        scales = np.zeros_like(starts)
        goes_on = np.isfinite(ends.chi2)
        for _ in range(most_steps):
            rows = np.flatnonzero(goes_on)
            if not len(rows):
                break
            here = ends.of(rows)
            # Moré: scales never shrink, so that a flat stretch does not set a parameter loose.
            scales[rows] = np.maximum(scales[rows], np.einsum("kii->ki", here.curvature))
            step = here.step(damping[rows, None] * scales[rows], low[rows], high[rows])
            there = self.at(law, np.clip(here.x + step, low[rows], high[rows]))
            gained = here.chi2 - there.chi2
            descends = gained > 0
            ends.replace(rows[descends], there.of(descends))
            damping[rows] *= np.where(descends, LESS, MORE)
            # χ² falls by half of its slope along a step to the minimum.
            hoped = -np.einsum("ki,ki->k", here.slope, there.x - here.x)
            is_near = np.maximum(gained, hoped) < ENOUGH
            goes_on[rows] = ~is_near | (damping[rows] >= 1)
        return ends


@dataclass(frozen=True)
class _Places:
    """Fits of a law with some rates and shapes.

    Attributes
    ----------
    x
        [log rate, shape], shape (k, 2).
    level, chi2
        Level at the reference, and χ², infinite where there is no fit, shape (k,).
    slope, curvature
        Halves of the derivatives of χ² by x, shape (k, 2), and by x twice, shape (k, 2, 2).
    """

    x: FloatArray
    level: FloatArray
    chi2: FloatArray
    slope: FloatArray
    curvature: FloatArray

    def of(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "_Places":
        """Return some of the places."""
        return _Places(*(each[rows] for each in self._arrays))

    def replace(self, rows: NDArray[np.intp], others: "_Places") -> None:
        """Put others in the place of some."""
        for each, other in zip(self._arrays, others._arrays, strict=True):
            each[rows] = other

    @property
    def _arrays(self) -> tuple[FloatArray, ...]:
        return self.x, self.level, self.chi2, self.slope, self.curvature

    def step(self, damping: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        """Return the damped Gauss–Newton step of what no bound holds, shape (k, 2)."""
        is_held = ((self.x <= low) & (self.slope >= 0)) | ((self.x >= high) & (self.slope <= 0))
        (a, b), (_, d) = np.moveaxis(self.curvature, 0, 2)
        a, d = np.where(is_held.T, 1.0, np.stack([a, d]) + damping.T)
        b = np.where(is_held.any(axis=1), 0.0, b)
        p, q = np.where(is_held.T, 0.0, -self.slope.T)
        with np.errstate(all="ignore"):
            step = np.stack([d * p - b * q, a * q - b * p], axis=1) / (a * d - b * b)[:, None]
        return np.asarray(np.nan_to_num(step))

    def lowest(self) -> FloatArray:
        """Return [level, log rate, shape] of the distinct places that may be the lowest, (m, 3)."""
        order = np.argsort(self.chi2, kind="stable")
        best = self.chi2.min(initial=np.inf)
        kept: list[int] = []
        for row in order:
            if not self.chi2[row] <= best + CLOSE + RELATIVELY_CLOSE * best or not self.level[row]:
                break
            apart = self.x[kept] - self.x[row]
            sigmas2 = np.einsum("ki,kij,kj->k", apart, self.curvature[kept], apart)
            if (sigmas2 > SAME**2).all():
                kept.append(int(row))
        return np.column_stack([self.level[kept], self.x[kept]])


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

    def with_inflated_covariance(self, covariance: FloatArray, series: DecaySeries) -> "LawFit":
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


#: Difference in BIC from which the data support the shape of a law beside one exponential, which is
#: the limit of every law: odds of e² = 7 : 1. At half of that, one clean decay in a hundred had a
#: tie.
SUPPORTED_BIC = 4.0
#: Difference of two laws at the end of a forecast, in their σ, from which it matters which holds.
#: A law that contains the other one, as one trap does the exponential, differs by less.
MATTERS_SIGMAS = 3.0
#: Part of the signal where amplitudes hold below which it does not matter whether rates are spread.
DARKNESS = 1e-4
#: Relative difference of a spectrum's forecast from which it matters: two states that are close
#: together differ from it by less.
SPREAD_MATTERS = 1 / 3


def tie_warnings(fit: FittedDecay) -> list[ResultWarning]:
    """Return a warning if laws that are as good as the one taken predict another signal."""
    compared = {law.name: law for law in fit.compared_laws}
    taken = compared.pop(fit.law)
    ties = [
        law for law in compared.values() if _is_close(fit, taken, law) and _differs(fit, law.name)
    ]
    if not ties:
        return []
    at_s = fit.forecast_until_s - fit.reference.t_s
    signals = [_signal(fit, law.name)[0] for law in (taken, *ties)]
    lowest = max(min(signals), np.finfo(float).tiny)
    return [
        Misfit(
            "laws-tied",
            "the data do not distinguish {law} from {others} (ΔBIC below {delta_bic:.0f}): at "
            "{at_s:.3g} s they differ by a factor of {factor:2r}; record longer, or take more "
            "light at first",
            law=_name(fit, taken),
            others=_names(fit, ties),
            delta_bic=STRONG_EVIDENCE_DELTA_BIC,
            at_s=at_s,
            factor=max(signals) / lowest,
        )
    ]


def _is_close(fit: FittedDecay, taken: ComparedLaw, other: ComparedLaw) -> bool:
    difference = other.bic_above_best - taken.bic_above_best
    is_limit = fit.law == EXPONENTIALS and fit.n_states == 1
    return (
        -STRONG_EVIDENCE_DELTA_BIC
        < difference
        < (-SUPPORTED_BIC if is_limit else STRONG_EVIDENCE_DELTA_BIC)
    )


def _signal(fit: FittedDecay, law: str) -> tuple[float, float]:
    return _signal_at(fit.forecast_until_s, fit, law)


def _signal_at(t_s: float, fit: FittedDecay, law: str) -> tuple[float, float]:
    value, variance = fit.signal(np.array([t_s]), np.zeros(1), law)
    return float(value[0]), float(variance[0])


def _differs(fit: FittedDecay, law: str) -> bool:
    own, own_variance = _signal(fit, fit.law)
    other, variance = _signal(fit, law)
    if law == RATE_SPECTRUM:
        # What it has beyond the record hardly constrains: the law taken would have to hold it.
        variance = (DARKNESS * _signal_at(fit.reference.t_s, fit, fit.law)[0]) ** 2
        if abs(own - other) < SPREAD_MATTERS * min(own, other):
            return False
    return bool(abs(own - other) > MATTERS_SIGMAS * np.sqrt(own_variance + variance))


def _name(fit: FittedDecay, law: ComparedLaw) -> str:
    if law.name != EXPONENTIALS:
        return LAW_LABELS[law.name]
    return f"{fit.n_states} exponential{'s' if fit.n_states > 1 else ''}"


def _names(fit: FittedDecay, laws: Sequence[ComparedLaw]) -> str:
    return " or ".join(_name(fit, law) for law in laws)
