"""Search of the places where a law of decay fits best, from many starts side by side.

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

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from labrig.fit.decay.search import projection
from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.foundation.arrays import FloatArray
from labrig.material import DecayLaw

#: Largest rate at lamp off in inverse shortest steps between frames, and smallest in spans: laws
#: other than exponentials fall fast at first, and go on falling.
FASTEST_STEPS, SLOWEST_SPANS = 100.0, 100.0
#: Sizes of the grid of rates and shapes, smallest shape above 0 on it, and most of its basins from
#: which a search starts.
GRID = (36, 16)
LEAST_SHAPE = 1e-5
MOST_BASINS = 4
#: Steps in time, relative to the time since the first frame, within which frames are merged: for
#: the grid, which only shows where to start, and for the search.
GRID_MERGED, MERGED = 0.05, 0.01
#: Steps of a search of the rate at each shape, and of both.
PROFILE_STEPS, MOST_STEPS = 4, 60
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
    shapes = np.geomspace(max(least, LEAST_SHAPE), largest, GRID[1])
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
    return frames.descended(law, starts, [low, least], [high, largest], MOST_STEPS).lowest()


def _basins(gains: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of the highest gains of a grid that are higher than all around them."""
    is_basin = (gains == maximum_filter(gains, size=3, mode="nearest")) & (gains > 0)
    rows, columns = np.nonzero(is_basin)
    best = np.argsort(-gains[rows, columns], kind="stable")[:MOST_BASINS]
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
