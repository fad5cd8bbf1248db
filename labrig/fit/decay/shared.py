"""Decays of several tables with the same rates, each with its own amplitudes and offset.

Rates are the nonlinear parameters of a variable projection over all tables at once; amplitudes ≥ 0
and offsets follow table by table. A joint Gauss–Newton fit of all parameters gives the last digits
and one covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import nlopt
import numpy as np
from scipy.special import chdtrc, fdtrc

from labrig.fit.decay.fit import MAX_LIFETIMES
from labrig.fit.decay.selection import F_TEST_LEVEL, REFUTING_BIC
from labrig.fit.decay.series import FASTEST_DECAYS, NO_DECAY, SLOWEST_SPANS
from labrig.fit.decay.states import ILL_DETERMINED, MERGED_LOG_RATE, NEGLIGIBLE_AMPLITUDE
from labrig.fit.decay.variable_projection import LOG_RATE_TOLERANCE, MAX_EVALUATIONS, grid_size
from labrig.fit.nonlinear_least_squares import LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.foundation.result_warning import Contradiction, ResultWarning, Undetermined
from labrig.material import exponential_means, exponential_means_and_slopes
from labrig.results import (
    Candidate,
    DecayReference,
    DecayState,
    SharedDecay,
    TableDecay,
    first_row_at,
)

#: Chance below which tables differ in their rates by more than their noise.
DIFFERENT_LEVEL = 1e-3
#: Fits after each of which σ of residuals are those of the fit, where all values have one.
RESCALINGS = 8
RESCALED_ENOUGH = 1e-12


@dataclass(frozen=True, eq=False)
class DecayTable:
    """Values of a decay that shares its rates with others.

    Attributes
    ----------
    name
        Name of the table.
    t_s, exposure_s
        Begin and length of the exposures in seconds, shape (n,).
    values, sigma
        Values in any unit, and their standard uncertainties, shape (n,).
    offset_sigma
        Prior σ of a constant background: 0 holds it at zero, inf leaves it free.
    """

    name: str
    t_s: FloatArray
    exposure_s: FloatArray
    values: FloatArray
    sigma: FloatArray
    offset_sigma: float = 0.0


def fit_shared_rates(
    tables: Sequence[DecayTable],
    n_states: int | None = None,
    max_states: int = 3,
    *,
    equal_weights: bool = False,
) -> SharedDecay:
    """Fit Σ_i a_ji e^(−k_i t) + b_j to every table j, with rates that all tables share.

    Parameters
    ----------
    tables
        Two tables or more.
    n_states
        Number of states; None chooses it for all tables together, up to `max_states`, by BIC and
        F-test.
    max_states
        Largest number of states tried.
    equal_weights
        Whether all values of a table have one σ, that of its residuals, whatever σ they came with.

    Returns
    -------
    SharedDecay
        Rates, amplitudes and offsets with one covariance.

    Raises
    ------
    FitError
        There are fewer than two tables, or they do not constrain a decay.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import DecayTable, fit_shared_rates
    >>> t_s, none, rng = np.linspace(0, 50, 60), np.zeros(60), np.random.default_rng(1)
    >>> tables = [
    ...     DecayTable(name, t_s, none, a * np.exp(-0.1 * t_s) + rng.normal(0, 1, 60), none + 1)
    ...     for name, a in (("dim", 100.0), ("bright", 400.0))
    ... ]
    >>> fit = fit_shared_rates(tables)
    >>> len(fit.rates), abs(fit.rates[0].value - 0.1) < 4 * fit.rates[0].sigma
    (1, True)
    """
    if len(tables) < 2:
        raise FitError(f"expected two tables or more that share rates, got {len(tables)}")
    problem = _Problem.of(tables)
    numbers = range(n_states, n_states + 1) if n_states else range(1, max_states + 1)
    chosen: _Fit | None = None
    candidates: list[Candidate] = []
    for number in numbers:
        if problem.n_values <= problem.n_parameters(number):
            break
        fit = problem.fit(number, equal_weights)
        if fit is None:
            break
        p_value = None if chosen is None else _p_value(chosen, fit)
        candidates.append(Candidate(number, fit.chi2 / fit.dof, fit.bic(equal_weights), p_value))
        if p_value is not None:
            needed = 0.0 if fit.is_determined else REFUTING_BIC
            if p_value > F_TEST_LEVEL or candidates[-1].bic > candidates[-2].bic - needed:
                break
        chosen = fit
    if chosen is None:
        raise FitError(
            f"the tables together do not support {n_states} state(s) or have too few values; ask "
            "for fewer states"
            if n_states
            else NO_DECAY
        )
    return _result(chosen, tuple(candidates), equal_weights)


@dataclass(frozen=True)
class _Scaled:
    """Table with times from its first row in common spans, and values in its largest one."""

    table: DecayTable
    t: FloatArray
    exposure: FloatArray
    values: FloatArray
    weights: FloatArray
    peak: float

    @property
    def n_offsets(self) -> int:
        return int(self.table.offset_sigma > 0)

    @property
    def prior(self) -> float:
        """Inverse prior σ of the offset."""
        sigma = self.table.offset_sigma
        return self.peak / sigma if 0 < sigma < np.inf else 0.0

    def linear(self, log_rates: FloatArray) -> tuple[FloatArray, float]:
        """Return amplitudes and offset, and χ², at given log rates."""
        columns = exponential_means(np.exp(log_rates), self.t, self.exposure)
        target = np.append(self.values * self.weights, 0.0)
        signs = [1.0] * len(log_rates)
        if self.n_offsets:
            ones = np.ones((len(self.t), 1))
            columns, signs = np.hstack([columns, ones, -ones]), [*signs, 1.0, -1.0]
        design = columns * self.weights[:, None]
        prior = np.zeros((1, design.shape[1]))
        prior[0, len(log_rates) :] = self.prior * np.array(signs[len(log_rates) :])
        design = np.vstack([design, prior])
        found = nonnegative_least_squares(design, target)
        residual = design @ found - target
        offset = found[len(log_rates) :]
        linear = np.append(found[: len(log_rates)], [offset[0] - offset[1]] if len(offset) else [])
        return linear, float(residual @ residual)


@dataclass(frozen=True)
class _Problem:
    tables: tuple[_Scaled, ...]
    span_s: float

    @classmethod
    def of(cls, tables: Sequence[DecayTable]) -> "_Problem":
        spans = [float(np.ptp(table.t_s)) for table in tables]
        span_s = max(spans)
        scaled = []
        for table, span in zip(tables, spans, strict=True):
            if not span > 0 or not table.values.max() > 0:
                raise FitError(f"{table.name}: {NO_DECAY}")
            order = np.argsort(table.t_s, kind="stable")
            peak = float(np.abs(table.values).max())
            scaled.append(
                _Scaled(
                    table,
                    (table.t_s - table.t_s.min())[order] / span_s,
                    table.exposure_s[order] / span_s,
                    table.values[order] / peak,
                    peak / table.sigma[order],
                    peak,
                )
            )
        return cls(tuple(scaled), span_s)

    @property
    def n_values(self) -> int:
        return sum(len(table.t) + int(table.prior > 0) for table in self.tables)

    def n_parameters(self, n_states: int) -> int:
        return n_states + sum(n_states + table.n_offsets for table in self.tables)

    @property
    def log_rate_bounds(self) -> tuple[float, float]:
        steps = [np.diff(table.t) for table in self.tables]
        shortest = min(float(each[each > 0].min()) for each in steps)
        return -float(np.log(SLOWEST_SPANS)), float(np.log(FASTEST_DECAYS / shortest))

    def chi2(self, log_rates: FloatArray) -> float:
        return sum(table.linear(log_rates)[1] for table in self.tables)

    def fit(self, n_states: int, equal_weights: bool) -> "_Fit | None":
        """Return the fit of some states; None if the tables do not support as many."""
        fit = self.fit_from(self._search(n_states))
        for _ in range(RESCALINGS if equal_weights else 0):
            before = fit.chi2
            if before == 0:
                break
            problem = fit.rescaled()
            fit = problem.fit_from(fit.log_rates)
            if abs(fit.chi2 / fit.dof - 1) < RESCALED_ENOUGH and abs(before / fit.dof - 1) < 1e-9:
                break
        return fit if fit.is_supported else None

    def _search(self, n_states: int) -> FloatArray:
        """Return log rates near the global best."""
        low, high = self.log_rate_bounds
        grid = np.linspace(low, high, min(grid_size(n_states), MAX_ON_GRID[n_states]))
        sets = [np.array(each) for each in combinations(grid, n_states)]
        best = min(sets, key=self.chi2)
        if n_states == 1:
            return best
        optimiser = nlopt.opt(nlopt.LN_BOBYQA, n_states)
        optimiser.set_min_objective(lambda log_rates, gradient: self.chi2(log_rates))
        optimiser.set_lower_bounds(np.full(n_states, low))
        optimiser.set_upper_bounds(np.full(n_states, high))
        optimiser.set_initial_step((high - low) / len(grid))
        optimiser.set_xtol_abs(LOG_RATE_TOLERANCE)
        optimiser.set_maxeval(MAX_EVALUATIONS)
        return np.asarray(optimiser.optimize(best))

    def fit_from(self, log_rates: FloatArray) -> "_Fit":
        """Return the fit of all parameters from log rates."""
        n = len(log_rates)
        start = np.concatenate([log_rates, *(t.linear(log_rates)[0] for t in self.tables)])
        low, high = self.log_rate_bounds
        lower, upper = np.full_like(start, -np.inf), np.full_like(start, np.inf)
        lower[:n], upper[:n] = low, high
        for _, rows in self.parameters(n):
            lower[rows.start : rows.start + n] = 0.0
        solution = least_squares(
            lambda theta: self.residuals(theta, n),
            np.clip(start, lower, upper),
            lower=lower,
            upper=upper,
            max_iterations=1000,
        )
        return _Fit(self, n, solution)

    def parameters(self, n_states: int) -> list[tuple[_Scaled, slice]]:
        """Return the tables, and the places of their amplitudes and offset."""
        places, first = [], n_states
        for table in self.tables:
            last = first + n_states + table.n_offsets
            places.append((table, slice(first, last)))
            first = last
        return places

    def residuals(self, theta: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
        """Return (model − values)/σ of all tables, priors last in each, and the Jacobian."""
        rates, parts, slopes = np.exp(theta[:n]), [], []
        for table, own in self.parameters(n):
            means, by_rate = exponential_means_and_slopes(rates, table.t, table.exposure)
            linear = theta[own]
            jacobian = np.zeros((len(table.t), len(theta)))
            jacobian[:, :n] = by_rate * linear[:n]
            jacobian[:, own.start : own.start + n] = means
            if table.n_offsets:
                jacobian[:, own.stop - 1] = 1.0
            model = jacobian[:, own] @ linear
            parts.append((model - table.values) * table.weights)
            slopes.append(jacobian * table.weights[:, None])
            if table.prior:
                row = np.zeros((1, len(theta)))
                row[0, own.stop - 1] = table.prior
                parts.append(table.prior * linear[-1:])
                slopes.append(row)
        return np.concatenate(parts), np.vstack(slopes)


#: Largest grids of the search, by the number of states: the tables' amplitudes are exact.
MAX_ON_GRID = {1: 36, 2: 18, 3: 12}


@dataclass(frozen=True)
class _Fit:
    problem: _Problem
    n_states: int
    solution: LeastSquaresFit

    @property
    def log_rates(self) -> FloatArray:
        return self.solution.parameters[: self.n_states]

    @property
    def chi2(self) -> float:
        return self.solution.chi2

    @property
    def dof(self) -> int:
        return self.problem.n_values - len(self.solution.parameters)

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes at the first rows over the largest value, (tables, n)."""
        places = self.problem.parameters(self.n_states)
        return np.stack([self.solution.parameters[own][: self.n_states] for _, own in places])

    @property
    def is_supported(self) -> bool:
        """Whether every state has light in some table, and no two are one."""
        seen = (self.amplitudes > NEGLIGIBLE_AMPLITUDE).any(axis=0).all()
        apart = np.diff(np.sort(self.log_rates)) > MERGED_LOG_RATE
        return bool(seen and apart.all())

    @property
    def is_determined(self) -> bool:
        """Whether all rates are known."""
        return bool((self.solution.sigma[: self.n_states] < ILL_DETERMINED).all())

    def shares(self) -> list[tuple[float, float]]:
        """Return χ² and degrees of freedom of each table."""
        u, s, _ = np.linalg.svd(self._columns(), full_matrices=False)
        leverage = (u[:, s > 1e-12 * s.max()] ** 2).sum(axis=1)
        shares, first = [], 0
        for table in self.problem.tables:
            last = first + len(table.t) + int(table.prior > 0)
            own = self.solution.residuals[first:last]
            shares.append((float(own @ own), last - first - float(leverage[first:last].sum())))
            first = last
        return shares

    def _columns(self) -> FloatArray:
        norms = np.linalg.norm(self.solution.jacobian, axis=0)
        return self.solution.jacobian / np.where(norms > 0, norms, 1.0)

    def bic(self, equal_weights: bool) -> float:
        """Return the Bayesian information criterion; that of one σ a table, if it is fitted."""
        n, n_parameters = self.problem.n_values, len(self.solution.parameters)
        deviance = self.chi2
        if equal_weights:
            deviance = sum(
                len(table.t) * float(np.log(max(chi2, 1e-300) / table.weights[0] ** 2))
                for (chi2, _), table in zip(self.shares(), self.problem.tables, strict=True)
            )
        return deviance + n_parameters * float(np.log(n))

    def rescaled(self) -> _Problem:
        """Return the problem with the σ of each table's residuals."""
        tables = tuple(
            replace(
                table,
                weights=np.full_like(table.weights, table.weights.mean())
                / max(np.sqrt(chi2 / max(dof, 1.0)), 1e-16 * table.weights.mean()),
            )
            for table, (chi2, dof) in zip(self.problem.tables, self.shares(), strict=True)
        )
        return replace(self.problem, tables=tables)


def _p_value(fewer: _Fit, more: _Fit) -> float:
    """Return the chance of as large a gain from `fewer` states, at the weights of `more`."""
    at_more = more.problem.fit_from(fewer.log_rates)
    added = len(more.solution.parameters) - len(fewer.solution.parameters)
    if more.chi2 == 0 or more.dof < 1:
        return 0.0
    gain = max(at_more.chi2 - more.chi2, 0.0) / added
    return float(fdtrc(added, more.dof, gain / max(more.chi2 / more.dof, 1.0)))


def _result(fit: _Fit, candidates: tuple[Candidate, ...], equal_weights: bool) -> SharedDecay:
    """Return the fit in the tables' units, by falling rate."""
    problem, n = fit.problem, fit.n_states
    order = np.argsort(-fit.log_rates, kind="stable")
    rates = np.exp(fit.log_rates)
    names = [f"k_r_per_s {number}" for number in range(1, n + 1)]
    to_units = np.zeros((len(fit.solution.parameters), len(fit.solution.parameters)))
    values = np.zeros(len(fit.solution.parameters))
    to_units[np.arange(n), order] = rates[order] / problem.span_s
    values[:n] = rates[order] / problem.span_s
    references = []
    for table, own in problem.parameters(n):
        first_s = float(table.table.t_s.min())
        start = first_s / problem.span_s
        from_lamp_off = start >= 0 and rates.max() * start <= MAX_LIFETIMES
        references.append(DecayReference() if from_lamp_off else first_row_at(first_s))
        start = start if from_lamp_off else 0.0
        for rank, i in enumerate(order):
            row = own.start + rank
            growth = np.exp(rates[i] * start) * table.peak
            amplitude = float(fit.solution.parameters[own.start + i])
            to_units[row, own.start + i] = growth
            to_units[row, i] = amplitude * growth * rates[i] * start
            values[row] = amplitude * growth
            names.append(f"amplitude {rank + 1} of {table.table.name}")
        if table.n_offsets:
            to_units[own.stop - 1, own.stop - 1] = table.peak
            values[own.stop - 1] = float(fit.solution.parameters[own.stop - 1]) * table.peak
            names.append(f"offset of {table.table.name}")
    covariance = to_units @ fit.solution.covariance @ to_units.T
    sigma = np.sqrt(np.diag(covariance))
    decays = []
    for (table, own), reference, (chi2, dof) in zip(
        problem.parameters(n), references, fit.shares(), strict=True
    ):
        states = tuple(
            DecayState(
                float(values[rank]),
                float(sigma[rank]),
                float(values[own.start + rank]),
                float(sigma[own.start + rank]),
            )
            for rank in range(n)
        )
        offset = own.stop - 1 if table.n_offsets else None
        decays.append(
            TableDecay(
                name=table.table.name,
                states=states,
                offset=0.0 if offset is None else float(values[offset]),
                offset_sigma=0.0 if offset is None else float(sigma[offset]),
                reference=reference,
                n_values=len(table.t),
                chi2=chi2,
                dof=dof,
                residual_sigma=table.peak / float(table.weights[0]) if equal_weights else None,
            )
        )
    return SharedDecay(
        tables=tuple(decays),
        chi2=fit.chi2,
        dof=fit.dof,
        bic=fit.bic(equal_weights),
        covariance_parameters=tuple(names),
        covariance=covariance,
        candidates=candidates,
        warnings=tuple(_warnings(fit)),
    )


def _warnings(fit: _Fit) -> list[ResultWarning]:
    """Return warnings about rates that differ between the tables or are unresolved."""
    warnings: list[ResultWarning] = []
    alone = 0.0
    for table in fit.problem.tables:
        own = replace(fit.problem, tables=(table,)).fit_from(fit.log_rates)
        alone += own.chi2
    added = fit.n_states * (len(fit.problem.tables) - 1)
    p_value = float(chdtrc(added, max(fit.chi2 - alone, 0.0) / max(fit.chi2 / fit.dof, 1.0)))
    if p_value < DIFFERENT_LEVEL:
        warnings.append(
            Contradiction(
                "rates-not-shared",
                "the tables do not have the same rates (p = {p_value:.1g}): fitted one by one, "
                "they differ by more than σ allows; fit each without --share",
                p_value=p_value,
            )
        )
    sigma = fit.solution.sigma[: fit.n_states]
    for number, i in enumerate(np.argsort(-fit.log_rates), start=1):
        if sigma[i] > ILL_DETERMINED:
            warnings.append(
                Undetermined(
                    "rate-unresolved",
                    "k{state} is determined to {sigma_percent:.0f} % only: ask for one less",
                    state=number,
                    sigma_percent=100 * sigma[i],
                )
            )
    return warnings
