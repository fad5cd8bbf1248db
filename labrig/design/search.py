"""Search for the rates of the states, with Λ and albedo eliminated.

A coarse grid of all combinations of rates is evaluated at once. Its local minima lie in different
basins; the lowest of them are the starts of Levenberg–Marquardt searches by variable projection
(G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; L. Kaufman, BIT 15 (1975) 49).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.optimize import minimize

from labrig.design.glow import Emission, emission, grid_emission
from labrig.design.light import LightProgramme, Steps, steps_to
from labrig.design.linear_part import (
    BandByBand,
    Coefficients,
    Curvature,
    LinearPart,
    Wanted,
    descend,
)
from labrig.fit import Ending, LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.material import MAX_ORDER

#: Range of k_r: the slowest decay over all of the time, the fastest over the shortest step.
SLOWEST, FASTEST = 1e-3, 30.0
#: Shortest step that counts for it, as a part of all of the time, and all of the time at least.
SHORTEST, INSTANT_S = 1e-4, 1e-6
#: κ under the strongest light of a band: times all of the time where only ratios of excitation
#: rates matter, and its largest value over the largest k_r.
FAINT, STRONGEST = 1e-3, 10.0
#: Levels of the grid by number of its bands: of k_e in each, and of k_r.
LEVELS = {1: (16, 16), 2: (10, 12), 3: (6, 10)}
#: The same of one of two states, whose pairs are all tried.
LEVELS_OF_PAIRS = {1: (10, 12), 2: (5, 8), 3: (3, 7)}
#: Bands of which the grid has combinations.
GRID_BANDS = 3
#: Number of starts, and of those that are refined again where the grid ranks another problem.
STARTS, REFINED = 8, 3
#: Levels of a rate, and passes over all rates, where ends are improved rate by rate.
SWEPT_LEVELS, SWEEPS = 14, 1
#: Rounds of searches rate by rate, each followed by descents.
ROUNDS = 3
#: Entries of keys by steps of all searches that go on at once.
MAX_ENTRIES = 2_000_000
#: κ times all of the time under the strongest light that is preferred, and the weight of that.
PREFERRED, PREFERENCE = 1.0, 1e-5
#: Pairs that are looked through for starts.
LOOKED_THROUGH = 3000
#: Evaluations of a search that starts at the end of another.
MAX_EVALUATIONS = 40
#: Gain of a step, as a part of the sum of squares, that ends a search; and as a part of that of the
#: wanted radiances, which is rounding.
MIN_GAIN, ROUNDED = 1e-6, 1e-20
#: Order from which the search for it starts, and least order above 1.
START_ORDER, MIN_ORDER = 1.3, 1.001
#: 1 less the cosine of the angle of two bands' lights below which they are in proportion.
PROPORTIONAL = 1e-9


@dataclass(frozen=True, eq=False)
class Problem:
    """What is searched for under which light.

    Attributes
    ----------
    steps
        Steps of each place.
    n_keys
        Number of keys.
    linear
        The problem of Λ and albedo.
    surrogate
        The problem by which the grid is ranked: `linear`, or channel by channel if that is coupled.
    n_states
        Number of states, 1 or 2.
    groups
        Number of each band's group, −1 of bands without light, shape (bands,). Bands of a group are
        lit in proportion, so that their excitation rates are not told apart.
    strongest
        Strongest irradiance of each group, shape (groups,).
    shortest_s, longest_s
        Shortest step, and time from the start to the last key, in s.
    around
        Rates that are taken where no key depends on them, shape (states, groups + 1); None for
        those with which the strongest light fills a good part of the states.
    held
        Relative error of the keys for which a rate departs from the preferred one by a factor of e.
    """

    steps: tuple[Steps, ...]
    n_keys: int
    linear: LinearPart
    surrogate: BandByBand
    n_states: int
    groups: NDArray[np.intp]
    strongest: FloatArray
    shortest_s: float
    longest_s: float
    around: FloatArray | None = None
    held: float = PREFERENCE

    @classmethod
    def of(
        cls,
        programme: LightProgramme,
        place: NDArray[np.intp],
        time_s: FloatArray,
        linear: LinearPart,
        n_states: int,
    ) -> "Problem":
        """Return the problem of keys at places (m,) and times (m,)."""
        lit_steps = steps_to(programme, place, time_s)
        lights = np.concatenate([step.irradiance for step in lit_steps])
        groups = _groups(lights)
        merged = tuple(
            Steps(step.duration_s, _merged(step.irradiance, groups), step.keys, step.taken)
            for step in lit_steps
        )
        durations = np.concatenate([step.duration_s for step in merged])
        longest = max(*(float(step.duration_s.sum()) for step in merged), INSTANT_S)
        all_lights = np.concatenate([step.irradiance for step in merged])
        return cls(
            merged,
            len(time_s),
            linear,
            _surrogate(linear),
            n_states,
            groups,
            all_lights.max(axis=0, initial=0.0),
            max(float(durations.min(initial=longest)), SHORTEST * longest),
            longest,
        )

    @property
    def n_groups(self) -> int:
        """Number of groups of bands."""
        return len(self.strongest)

    @property
    def n_rates(self) -> int:
        """Number of rates of a state."""
        return self.n_groups + 1

    def of_groups(self, k_e: FloatArray) -> FloatArray:
        """Return the mean excitation rates (states, groups) of each group's bands."""
        members = self.groups[:, np.newaxis] == np.arange(self.n_groups)
        return np.asarray(k_e @ members / np.maximum(members.sum(axis=0), 1))

    @cached_property
    def k_r_range(self) -> tuple[float, float]:
        """Range of k_r in 1/s."""
        return SLOWEST / self.longest_s, FASTEST / self.shortest_s

    @cached_property
    def faint(self) -> FloatArray:
        """Excitation rates below which only their ratios matter, shape (groups,)."""
        return FAINT / self.longest_s / self.strongest

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of the coordinates of all states."""
        low, high = self.k_r_range
        slowest = np.append(np.zeros(self.n_groups), low)
        fastest = np.append(STRONGEST * high / self.strongest, high)
        ends = (
            self.coordinates(np.tile(rates, (self.n_states, 1))) for rates in (slowest, fastest)
        )
        return next(ends), next(ends)

    @cached_property
    def preferred(self) -> FloatArray:
        """Coordinates of rates that are taken where no key depends on them."""
        if self.around is not None:
            return np.clip(self.coordinates(self.around), *self.bounds)
        rates = np.append(PREFERRED / self.longest_s / self.strongest, 1 / self.longest_s)
        return self.coordinates(np.tile(rates, (self.n_states, 1)))

    def coordinates(self, rates: FloatArray) -> FloatArray:
        """Return the coordinates x of rates k_e and k_r (…, states, rates), state by state.

        asinh k_e is nearly a logarithm, but has a value at 0; of k_r it is the logarithm.
        """
        x = np.concatenate([np.arcsinh(rates[..., :-1] / self.faint), np.log(rates[..., -1:])], -1)
        return x.reshape(*x.shape[:-2], -1)

    def rates(self, x: FloatArray) -> FloatArray:
        """Return the rates of coordinates x (…, states · rates)."""
        states = x.reshape(*x.shape[:-1], self.n_states, self.n_rates)
        k_e, k_r = self.faint * np.sinh(states[..., :-1]), np.exp(states[..., -1:])
        return np.concatenate([k_e, k_r], axis=-1)

    @cached_property
    def preference(self) -> float:
        """Weight of the residuals by which rates are kept near the preferred ones."""
        return self.held * math.sqrt(self.scale)

    @cached_property
    def scale(self) -> float:
        """Sum of squares of the wanted radiances."""
        wanted = self.linear.wanted
        return float(((wanted.weight[:, np.newaxis] * wanted.target) ** 2).sum()) or 1.0

    def at_once(self, states: int) -> int:
        """Return how many candidates of `states` fit into the memory at once.

        Products of keys and steps would fill it for thousands of keys.
        """
        entries = sum(len(steps.keys) * len(steps.duration_s) for steps in self.steps)
        return max(1, MAX_ENTRIES // max(1, entries * states))

    def emission_of(self, x: FloatArray, order: float) -> Emission:
        """Return the emission of states of coordinates x, with slopes by coordinates."""
        rates = self.rates(x)
        glow = emission(self.steps, self.n_keys, rates[..., :-1], rates[..., -1], order)
        glow.slopes[..., :-2] *= self.k_e_slopes(rates)[..., np.newaxis, :]
        return glow

    def k_e_slopes(self, rates: FloatArray) -> FloatArray:
        """Return the derivatives of k_e by their coordinates, shape (…, states, groups)."""
        return np.hypot(self.faint, rates[..., :-1])

    def by_parameter(self, slopes: FloatArray) -> FloatArray:
        """Return slopes of emissions (…, keys, states, p) by all rates, and by the common order."""
        size, n_states = self.n_rates, self.n_states
        shape = (*slopes.shape[:-3], self.n_keys, n_states, n_states * size + 1)
        found = np.zeros(shape)
        for state in range(n_states):
            own = slopes[..., state, :]
            found[..., state, state * size : (state + 1) * size] = own[..., :-1]
            found[..., state, -1] = own[..., -1]
        return found


class Found(NamedTuple):
    """End of a search.

    Attributes
    ----------
    rates
        k_e of the groups and k_r of each state, shape (states, groups + 1).
    order
        Kinetic order of all states.
    coefficients
        Λ and albedo.
    cost
        Sum of squared residuals.
    """

    rates: FloatArray
    order: float
    coefficients: Coefficients
    cost: float


def search(problem: Problem, *, is_order_free: bool, order: float) -> tuple[Found, ...]:
    """Return where the searches from the grid's basins end, the lowest first."""
    if not problem.n_groups:
        return (_dark(problem),)
    ends, costs = _descended(problem, np.array(list(_starts(problem))))
    if problem.n_groups > GRID_BANDS or problem.n_states > 1:
        for _ in range(ROUNDS):
            others, their_costs = _descended(problem, _swept(problem, ends))
            ends, costs = np.concatenate([ends, others]), np.concatenate([costs, their_costs])
            best = np.argsort(costs, kind="stable")[:STARTS]
            ends, costs = ends[best], costs[best]
    ends = ends[np.argsort(costs, kind="stable")]
    if not isinstance(problem.linear, BandByBand):
        # They were ranked by channels; colours of bands are another problem.
        fits = [_refined(problem, end, 1.0) for end in ends[:REFINED]]
        ends = np.array([x for x, _ in sorted(fits, key=lambda fit: fit[1])])
    lowest, _ = _refined(problem, ends[0], 1.0)
    if is_order_free or order != 1:
        found = _of_order(problem, [lowest, *ends[1:2]], None if is_order_free else order)
    else:
        found = [_found(problem, end, 1.0) for end in (lowest, *ends[1:])]
    return tuple(sorted(found, key=lambda each: each.cost))


def search_near(problem: Problem, *, is_order_free: bool, order: float) -> tuple[Found, ...]:
    """Return where a search ends that starts at the preferred rates, in their basin."""
    if not problem.n_groups:
        return (_dark(problem),)
    start = problem.preferred
    if is_order_free:
        end, _ = _refined(problem, np.append(start, max(order, MIN_ORDER)), None)
        return (_found(problem, end[:-1], float(end[-1])),)
    end, _ = _refined(problem, start, order)
    return (_found(problem, end, order),)


def _swept(problem: Problem, starts: FloatArray) -> FloatArray:
    """Return points (n, p) after searches along one rate after another over its whole range.

    The grid has few levels of each rate, and none of their own of many bands.
    """
    size = problem.at_once(SWEPT_LEVELS + 1)
    parts = [starts[first : first + size] for first in range(0, len(starts), size)]
    swept = [_swept_at_once(problem, problem.rates(part)) for part in parts]
    return np.unique(problem.coordinates(np.concatenate(swept)), axis=0)


def _swept_at_once(problem: Problem, rates: FloatArray) -> FloatArray:
    """Return rates (n, states, rates) after the searches of `_swept`."""
    glow = np.moveaxis(_glow(problem, rates), 1, 2)
    of_k_e, of_k_r = _axes(problem, (SWEPT_LEVELS - 1, SWEPT_LEVELS), 1)
    kappa = np.append(0.0, np.exp(of_k_e))
    ranges = [*(kappa / strongest for strongest in problem.strongest), np.exp(of_k_r)]
    every = product(range(SWEEPS), range(problem.n_states), range(problem.n_rates))
    for _, state, rate in every:
        # The first candidate is what there is.
        candidates = np.repeat(rates[:, state, np.newaxis], SWEPT_LEVELS + 1, axis=1)
        candidates[:, 1:, rate] = ranges[rate]
        emitted = np.repeat(glow[:, np.newaxis], SWEPT_LEVELS + 1, axis=1)
        emitted[..., state] = _glow(problem, candidates)
        costs = problem.surrogate.costs(emitted.reshape(-1, *glow.shape[1:]))
        best = np.arange(len(rates)), costs.reshape(len(rates), -1).argmin(axis=1)
        rates[:, state], glow = candidates[best], emitted[best]
    return rates


def _glow(problem: Problem, rates: FloatArray) -> FloatArray:
    """Return the first-order emission of rates (…, rates) at the keys, shape (…, keys)."""
    glow = emission(problem.steps, problem.n_keys, rates[..., :-1], rates[..., -1], 1.0)
    return glow.value


def _descended(problem: Problem, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ends of searches from starts (n, p), and their sums of squares, channel by channel."""
    preferred, weight = problem.preferred, problem.preference**2

    def curvature(x: FloatArray) -> Curvature:
        glow = problem.emission_of(x, 1.0)
        slopes = problem.by_parameter(np.swapaxes(glow.slopes, 1, 2))[..., :-1]
        at = problem.surrogate.curvature(np.swapaxes(glow.value, 1, 2), slopes)
        away = x - preferred
        return Curvature(
            at.cost + weight * (away**2).sum(axis=1),
            at.gradient + weight * away,
            at.matrix + weight * np.eye(x.shape[1]),
        )

    size = problem.at_once(problem.n_states)
    parts = [
        descend(curvature, starts[first : first + size], *problem.bounds)
        for first in range(0, len(starts), size)
    ]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _of_order(problem: Problem, starts: Sequence[FloatArray], order: float | None) -> list[Found]:
    """Return the ends of searches of another order than 1, or of a free one, from first-order ends.

    An order of 1 is among the ends of a free one.
    """
    ends = [] if order is not None else [_found(problem, starts[0], 1.0)]
    for start in starts:
        at = np.append(start, START_ORDER) if order is None else start
        end, _ = _refined(problem, at, order)
        reached = float(end[-1]) if order is None else order
        ends.append(_found(problem, end[: len(start)], reached))
    return ends


def residuals_and_slopes(
    problem: Problem, x: FloatArray, order: float, given: Coefficients | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, Coefficients]:
    """Return residuals (rows,), their slopes at fixed Λ and albedo, emissions, and Λ and albedo.

    Λ and albedo are the best ones, or those that are given. Slopes have a column for each
    coordinate, state by state, and one for the common order.
    """
    glow = problem.emission_of(x, order)
    values = glow.value.T
    slopes = problem.by_parameter(np.swapaxes(glow.slopes, 0, 1))
    linear = problem.linear
    coefficients = linear.coefficients(values) if given is None else given
    residuals = linear.residuals(values, coefficients)
    return residuals, linear.slopes(values, slopes, coefficients), values, coefficients


def _refined(problem: Problem, start: FloatArray, order: float | None) -> tuple[FloatArray, float]:
    """Return end and sum of squares of a search; without an order it is the last parameter."""
    low, high = problem.bounds
    if order is None:
        low, high = np.append(low, MIN_ORDER), np.append(high, MAX_ORDER)
    n_rates, weight = problem.n_states * problem.n_rates, problem.preference
    kept = np.eye(n_rates, len(low)) * weight

    def projected(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        residuals, slopes, values, coefficients = residuals_and_slopes(
            problem, x[:n_rates], float(x[-1]) if order is None else order
        )
        slopes = slopes[:, : len(x)]
        for block in problem.linear.blocks(values, coefficients):
            if block.is_free.any():
                basis = _basis(block.columns[:, block.is_free])
                slopes[block.rows] -= basis @ (basis.T @ slopes[block.rows])
        away = weight * (x[:n_rates] - problem.preferred)
        return np.concatenate([residuals, away]), np.concatenate([slopes, kept])

    at_start, _ = projected(start)
    least_gain = max(MIN_GAIN * float(at_start @ at_start), ROUNDED * problem.scale)
    fit = least_squares(
        projected,
        start,
        lower=low,
        upper=high,
        max_iterations=MAX_EVALUATIONS,
        tolerance=1e-9,
        least_gain=least_gain,
    )
    if fit.ending is Ending.MINIMUM:
        return fit.parameters, fit.chi2
    return _descended_by_gradient(projected, fit, low, high)


def _descended_by_gradient(
    residuals: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    end: LeastSquaresFit,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, float]:
    """Go on where a search creeps, since residuals that stay large bend its valley.

    The gradient of variable projection is exact, so that a quasi-Newton method learns the bend.
    """

    def cost(x: FloatArray) -> tuple[float, FloatArray]:
        at, slopes = residuals(x)
        return float(at @ at), 2 * slopes.T @ at

    found = minimize(
        cost,
        end.parameters,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)),
        options={"maxfun": MAX_EVALUATIONS, "ftol": MIN_GAIN / 10, "gtol": 0.0},
    )
    if found.fun < end.chi2:
        return np.asarray(found.x), float(found.fun)
    return end.parameters, end.chi2


def _basis(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the columns."""
    if columns.shape[1] == 1:
        length = np.sqrt(columns[:, 0] @ columns[:, 0])
        return columns / (length or 1.0)
    basis: FloatArray = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    return basis


def _found(problem: Problem, x: FloatArray, order: float) -> Found:
    residuals, _, _, coefficients = residuals_and_slopes(problem, x, order)
    of_keys = residuals[: problem.linear.n_rows]
    rates = problem.rates(x)
    by_falling_rate = np.argsort(-rates[:, -1], kind="stable")
    ordered = coefficients._replace(reradiation=coefficients.reradiation[by_falling_rate])
    return Found(rates[by_falling_rate], order, ordered, float(of_keys @ of_keys))


def _dark(problem: Problem) -> Found:
    """Return a material that nothing excites, since there is no light before the last key."""
    values = np.zeros((problem.n_keys, problem.n_states))
    coefficients = problem.linear.coefficients(values)
    residuals = problem.linear.residuals(values, coefficients)[: problem.linear.n_rows]
    rates = np.full((problem.n_states, 1), 1 / problem.longest_s)
    return Found(rates, 1.0, coefficients, float(residuals @ residuals))


def _starts(problem: Problem) -> Iterator[FloatArray]:
    """Yield coordinates of rates in the lowest basins of a grid."""
    merged = _merged_to(problem.n_groups, GRID_BANDS)
    n_bands = int(merged.max()) + 1
    levels = (LEVELS if problem.n_states == 1 else LEVELS_OF_PAIRS)[n_bands]
    axes = _axes(problem, levels, n_bands)
    k_e = np.stack(np.meshgrid(*axes[:-1], indexing="ij"), axis=-1).reshape(-1, n_bands)
    all_k_e = np.exp(k_e[:, merged]) / problem.strongest
    glow = grid_emission(problem.steps, problem.n_keys, all_k_e, np.exp(axes[-1]))
    shape = tuple(len(axis) for axis in axes)
    states = np.column_stack(
        [np.repeat(all_k_e, shape[-1], 0), np.tile(np.exp(axes[-1]), len(k_e))]
    )[:, np.newaxis]
    candidates = glow.reshape(-1, problem.n_keys)
    if problem.n_states == 1:
        costs = problem.surrogate.costs(candidates[:, :, np.newaxis]).reshape(shape)
        is_lowest = (costs == minimum_filter(costs, size=3, mode="nearest")).ravel()
        lowest = np.flatnonzero(is_lowest)
        places = np.stack(np.unravel_index(lowest, shape), axis=1)
        order = np.argsort(costs.ravel()[lowest], kind="stable")
        for index in _apart(places, order):
            yield problem.coordinates(states[lowest[index]])
        return
    first, second = np.triu_indices(len(candidates), k=1)
    costs = problem.surrogate.costs_of_pairs(candidates, first, second)
    order = np.argsort(costs, kind="stable")[:LOOKED_THROUGH]
    indices = np.stack(np.unravel_index(np.arange(len(candidates)), shape), axis=1)
    places = np.concatenate([indices[first], indices[second]], axis=1)
    for index in _apart(places, order):
        pair = np.concatenate([states[first[index]], states[second[index]]])
        yield problem.coordinates(pair)


def _axes(problem: Problem, levels: tuple[int, int], n_bands: int) -> list[FloatArray]:
    """Return the grid's logarithms of κ under the strongest light of each band, and of k_r."""
    slow, fast = np.log(1 / problem.longest_s / 5), np.log(3 / problem.shortest_s)
    weak, strong = np.log(0.05 / problem.longest_s), np.log(3 / problem.shortest_s)
    kappa = np.linspace(weak, max(strong, weak + 1), levels[0])
    return [*[kappa] * n_bands, np.linspace(slow, max(fast, slow + 1), levels[1])]


def _apart(places: NDArray[np.intp], order: NDArray[np.intp]) -> Iterator[int]:
    """Yield the first of `order` whose places on the grid are more than one step apart."""
    chosen: list[int] = []
    for index in order.tolist():
        steps = np.abs(places[chosen] - places[index]).max(axis=1) if chosen else np.array([9])
        if (steps > 1).all():
            chosen.append(index)
            yield index
        if len(chosen) == STARTS:
            return


def _surrogate(linear: LinearPart) -> BandByBand:
    """Return a problem whose channels are independent."""
    if isinstance(linear, BandByBand):
        return linear
    wanted = linear.wanted
    assert wanted.seen is not None
    light = None if wanted.reflected is None else np.maximum(wanted.reflected @ wanted.seen.T, 0)
    return BandByBand(Wanted(wanted.target, wanted.weight, light, None))


def _groups(lights: FloatArray) -> NDArray[np.intp]:
    """Number the bands (columns) that are lit in proportion; −1 of bands without light."""
    numbers = np.full(lights.shape[1], -1, dtype=np.intp)
    directions: list[FloatArray] = []
    for band, light in enumerate(lights.T):
        if not light.any():
            continue
        direction = light / np.linalg.norm(light)
        alike = [i for i, each in enumerate(directions) if 1 - each @ direction < PROPORTIONAL]
        numbers[band] = alike[0] if alike else len(directions)
        if not alike:
            directions.append(direction)
    return numbers


def _merged(lights: FloatArray, groups: NDArray[np.intp]) -> FloatArray:
    """Return the irradiance summed over the bands of each group, shape (n, groups)."""
    members = groups[:, np.newaxis] == np.arange(groups.max(initial=-1) + 1)
    return np.asarray(lights @ members)


def _merged_to(count: int, most: int) -> NDArray[np.intp]:
    """Number `count` neighbouring groups by the bands of the grid, `most` or fewer."""
    return (np.arange(count) * min(count, most)) // count
