"""Fit of states of general order to charge and decay of one series.

A sum of first-order states cannot follow a charge that is convex, as that of SrAl₂O₄:Eu,Dy is for
its first minute and a half: whether orders other than 1 do is told by the Bayesian information
criterion. Where neighbouring residuals of even the best model go together, χ² and variances are
divided and multiplied by the factor by which their sums exceed noise, so that a misfit neither
adds states nor makes parameters look known. Intervals are those of the profile likelihood.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from labrig.fit.charge.model import (
    COMMON_PARAMETERS,
    ORDER,
    STATE_PARAMETERS,
    Readings,
    level_at_off,
    rates_of,
    readings_of,
)
from labrig.fit.charge.result import ChargeCandidate, ChargeFit, FittedReadings, OrderState
from labrig.fit.nonlinear_least_squares import LeastSquaresFit, least_squares
from labrig.fit.profile_likelihood import (
    Likelihood,
    LowerMinimumError,
    NoiseScale,
    Quantity,
    Value,
    exponential,
    parameter,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.foundation.errors import FitError
from labrig.foundation.result_warning import Misfit, ResultWarning, Undetermined, Unmeasured
from labrig.material import MAX_ORDER
from labrig.results import Measured, OneSided, ProfileInterval

#: Place of log κ among a state's parameters.
LOG_KAPPA = 0

#: Step of the parameters by which derivatives are differenced.
STEP = 1e-5


class ProfiledState(NamedTuple):
    """State whose intervals are wanted: its place among the states that were fitted from 0, its
    number in the output, and whether its order was fitted and κ is known.
    """

    place: int
    number: int
    is_order_fitted: bool
    is_kappa_known: bool


def charge_intervals(
    likelihood: Likelihood,
    charge_s: float,
    states: list[ProfiledState],
    misfit: float,
    *,
    all_of_them: bool,
) -> dict[str, ProfileInterval]:
    """Return intervals by the name of a field of `OrderState` and the state's number.

    Parameters
    ----------
    likelihood
        Likelihood at the minimum.
    charge_s
        Length of the charge in seconds.
    states
        States whose intervals are wanted.
    misfit
        Factor of all variances.
    all_of_them
        Whether to return all, not only those that two points of the profile show ±σ to miss by more
        than 20 %.
    """
    intervals: dict[str, ProfileInterval] = {}
    for state in states:
        for quantity, names in _profiled_quantities(state, charge_s):
            shown = names.values()
            if not (all_of_them or any(likelihood.is_asymmetric(quantity, one) for one in shown)):
                continue
            try:
                interval = likelihood.interval(quantity, NoiseScale(misfit))
            except LowerMinimumError:
                continue
            for name, function in names.items():
                intervals[f"{name} {state.number}"] = interval.mapped(function)
    return intervals


def _profiled_quantities(
    state: ProfiledState, charge_s: float
) -> Iterator[tuple[Quantity, dict[str, Callable[[float], float]]]]:
    """Yield what is profiled of a state, and the fields that are functions of each."""
    first = state.place * STATE_PARAMETERS
    if state.is_order_fitted:
        order = Quantity(parameter(first + ORDER), least=1.0, searched=(1.0, MAX_ORDER))
        yield order, {"order": float, "exponent": _exponent}
    at_off = Quantity(_log_rate_at_off(first, charge_s))
    yield at_off, {"rate_at_off_per_s": exponential, "lifetime_at_off_s": _falling}
    if state.is_kappa_known:
        yield Quantity(parameter(first + LOG_KAPPA)), {"kappa_per_s": exponential}
        yield Quantity(_log_k_r(first)), {"k_r_per_s": exponential}


def _log_rate_at_off(first: int, charge_s: float) -> Value:
    """Return log (b k r(0)^(b − 1)), the rate at which the light falls at lamp off."""

    def of(own: FloatArray) -> float:
        rates = rates_of(own)
        level = max(level_at_off(rates, charge_s), np.finfo(float).tiny)
        return math.log(rates.order * rates.k_r) + (rates.order - 1) * math.log(level)

    def value(theta: FloatArray) -> tuple[float, FloatArray]:
        own = theta[first : first + STATE_PARAMETERS]
        gradient = np.zeros(len(theta))
        for place in range(ORDER + 1):
            step = STEP * (np.arange(STATE_PARAMETERS) == place)
            # At an order of 1, a step inwards.
            low = own if place == ORDER and own[ORDER] - STEP < 1 else own - step
            gradient[first + place] = (of(own + step) - of(low)) / (own + step - low)[place]
        return of(own), gradient

    return value


def _log_k_r(first: int) -> Value:
    """Return log k = b log s + (1 − b) log κ."""

    def value(theta: FloatArray) -> tuple[float, FloatArray]:
        log_kappa, log_speed, order = theta[first : first + ORDER + 1].tolist()
        gradient = np.zeros(len(theta))
        gradient[first : first + ORDER + 1] = 1 - order, order, log_speed - log_kappa
        return order * log_speed + (1 - order) * log_kappa, gradient

    return value


def _exponent(order: float) -> float:
    if order == math.inf:
        return 1.0
    return order / (order - 1) if order > 1 else math.inf


def _falling(log_rate: float) -> float:
    return exponential(-log_rate)


#: Largest number of states.
MAX_STATES = 2
#: Largest η that is tried; above 1 it conserves no energy.
MAX_STIMULATED = 10.0
#: Concentration after the charge at the least κ: saturation changes nothing.
UNSATURATED = 1e-3
#: Start values: orders, κ times the length of the charge, and speeds of the states over the
#: inverse time in which the light falls by a factor e.
START_ORDER, START_KAPPA = 1.7, 0.3
START_SPEEDS = {1: ((1.0,),), 2: ((3.0, 0.3), (1.5, 0.7))}
#: Gain in χ² of a step at which fits that are compared end.
MIN_GAIN = 0.1
TOLERANCE = 1e-7
MAX_ITERATIONS = 150
#: Largest σ of log κ with which κ is known from above, and gain in χ² over the least κ from which
#: it is known from below: 3 σ.
KNOWN_LOG_KAPPA, KNOWN_GAIN = 0.5, 9.0
#: Distance of an order from 1 in σ from which τ = 1/((b − 1) k r(0)^(b − 1)) has a σ of its own.
ABOVE_FIRST_SIGMAS = 2.0
#: Chance of noise alone to look like a misfit.
MISFIT_CHANCE = 1e-3


def fit_charge_and_decay(
    t_s: ArrayLike,
    values: ArrayLike,
    sigma: ArrayLike | None,
    *,
    light_on_s: float,
    light_off_s: float,
    exposure_s: ArrayLike = 0.0,
    states: int | Literal["auto"] = "auto",
    order: Literal["auto", "first", "general"] = "auto",
    light_stimulated: float | None = 1.0,
    intervals: bool = False,
) -> ChargeFit:
    """Fit the light of a sample while a lamp charges it and afterwards.

    Each of 1 or 2 states obeys dr/dt = (1 − r) κ − k rᵇ and emits Λ (k rᵇ + η κ r) under the lamp,
    Λ k rᵇ in the dark (C. E. May and J. A. Partridge, J. Chem. Phys. 40 (1964) 1401). It is empty
    when the lamp is switched on, and the lamp is constant. Prompt light and a dark level are
    fitted, too. Readings while the lamp switches are left out; one under the lamp counts as the
    light at its middle, one in the dark as the mean over its exposure.

    Parameters
    ----------
    t_s
        Start of each reading in seconds on any clock, shape (n,).
    values
        Light, shape (n,), in any unit.
    sigma
        Standard uncertainties of the values, one or of shape (n,). None: the variance is
        proportional to the value, as that of counts is, and the scatter of neighbours tells the
        factor.
    light_on_s, light_off_s
        When the lamp was switched on and off, on the clock of `t_s`.
    exposure_s
        Length of the readings in seconds, one or of shape (n,); 0 if it does not matter.
    states
        Number of states, 1 or 2; "auto" chooses it.
    order
        "first" holds b = 1, "general" frees b, "auto" chooses.
    light_stimulated
        Fraction η of the carriers that find their trap filled and recombine at once; 1, all of
        them, conserves energy. None: it is fitted.
    intervals
        Whether every order, rate and lifetime has an interval by profile likelihood. Those that ±σ
        misses by more than 20 % have one in any case.

    Returns
    -------
    ChargeFit
        States, the models that were compared, and what is doubtful.

    Raises
    ------
    FitError
        There are too few readings on either side of lamp off, or values that are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_charge_and_decay
    >>> from labrig.material import dark_concentration, lit_concentration
    >>> t_s = np.arange(1.0, 900.0, 2.0)
    >>> charged = lit_concentration(0.0, 0.01, 0.05, 1.8, np.minimum(t_s, 200.0))
    >>> level = dark_concentration(charged, 0.05, 1.8, np.maximum(t_s - 200, 0.0))
    >>> light = 0.05 * level**1.8 + np.where(t_s < 200, 0.01 * level, 0.0)
    >>> light += 1e-5 * np.random.default_rng(1).standard_normal(len(t_s))
    >>> fit = fit_charge_and_decay(t_s, light, 1e-5, light_on_s=0.0, light_off_s=200.0)
    >>> fit.candidates[fit.chosen].label, abs(fit.states[0].order.value - 1.8) < 0.02
    ('1 state of general order', True)
    """
    readings = readings_of(t_s, values, sigma, exposure_s, (light_on_s, light_off_s))
    models = _models(states, order)
    problem = _Problem(readings, light_stimulated)
    tried = [(model, problem.fit(model)) for model in models if problem.allows(model)]
    if not tried:
        raise FitError(
            f"expected more readings than parameters, got {len(readings.values)}; ask for fewer "
            "states"
        )
    factor = min(problem.misfit(fit) for _, fit in tried)
    candidates = tuple(problem.candidate(model, fit, factor) for model, fit in tried)
    chosen = _chosen(candidates)
    return _result(problem, tried[chosen], candidates, chosen, factor, all_intervals=intervals)


class _Model(NamedTuple):
    states: int
    is_general: bool


def _models(states: int | Literal["auto"], order: str) -> list[_Model]:
    """Return the models to try, those with fewer parameters first."""
    if order not in ("auto", "first", "general"):
        raise FitError(f"expected the order 'auto', 'first' or 'general', got '{order}'")
    if states != "auto" and not 1 <= states <= MAX_STATES:
        raise FitError(f"expected 1 to {MAX_STATES} states, got {states}")
    numbers = range(1, MAX_STATES + 1) if states == "auto" else (states,)
    orders = {"auto": (False, True), "first": (False,), "general": (True,)}[order]
    return [_Model(number, is_general) for number in numbers for is_general in orders]


def _chosen(candidates: Sequence[ChargeCandidate]) -> int:
    """Return the index of the first model that no later one beats clearly."""
    chosen = 0
    for index, candidate in enumerate(candidates):
        if candidate.bic < candidates[chosen].bic - STRONG_EVIDENCE_DELTA_BIC:
            chosen = index
    return chosen


@dataclass(frozen=True)
class _Problem:
    """Readings, and η if it is given."""

    readings: Readings
    light_stimulated: float | None

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return residuals and Jacobian, with the prior of the dark level last."""
        readings = self.readings
        light, jacobian = readings.times.light(theta)
        off, slopes = (light - readings.values) / readings.sigma, jacobian.T / readings.sigma
        if readings.dark_sigma == 0:
            return off, slopes.T
        prior = np.zeros((len(theta), 1))
        prior[-1] = 1 / readings.dark_sigma
        off_dark = (theta[-1] - readings.dark) / readings.dark_sigma
        return np.append(off, off_dark), np.hstack([slopes, prior]).T

    def bounds(self, model: _Model) -> tuple[FloatArray, FloatArray]:
        """Return the least and the largest parameters."""
        readings = self.readings
        charge_s, largest = readings.times.charge_s, float(np.abs(readings.values).max())
        order = (1.0, MAX_ORDER if model.is_general else 1.0)
        fastest = np.log(10 / readings.step_s)
        low = [np.log(UNSATURATED / charge_s), np.log(0.01 / readings.span_s), order[0], -np.inf]
        high = [fastest, fastest, order[1], np.inf]
        stimulated = (
            (0.0, MAX_STIMULATED) if self.light_stimulated is None else (self.light_stimulated,) * 2
        )
        is_dark_known = readings.dark_sigma > 0
        dark = (-np.inf, np.inf) if is_dark_known else (0.0, 0.0)
        return (
            np.array([*low * model.states, stimulated[0], 0.0, dark[0]]),
            np.array([*high * model.states, stimulated[1], 10 * largest, dark[1]]),
        )

    def allows(self, model: _Model) -> bool:
        """Whether there are more readings than parameters of a model."""
        return self.n_parameters(model) < len(self.readings.values)

    def n_parameters(self, model: _Model) -> int:
        """Return the number of fitted parameters."""
        low, high = self.bounds(model)
        return int(np.count_nonzero(low < high))

    def fit(self, model: _Model) -> LeastSquaresFit:
        """Fit a model from several starts; η, where it is free, from the fit that holds it at 1."""
        if self.light_stimulated is None:
            held = _Problem(self.readings, 1.0).fit(model)
            return self._search(held.parameters, model)
        found = [
            self._search(self._start(speeds, model), model) for speeds in START_SPEEDS[model.states]
        ]
        return min(found, key=lambda fit: fit.chi2)

    def _start(self, speeds: tuple[float, ...], model: _Model) -> FloatArray:
        """Return start values by the time in which the light decays."""
        readings = self.readings
        lit, n = readings.values - readings.dark, readings.lit
        fading = lit[n:] < lit[n] / np.e
        fall_s = float(readings.times.dark_s[int(np.argmax(fading)) if fading.any() else -1])
        steady = max(float(lit[:n].max()), float(lit.max())) / model.states
        theta = [
            value
            for speed in speeds
            for value in (
                np.log(START_KAPPA / readings.times.charge_s),
                np.log(speed / fall_s),
                START_ORDER if model.is_general else 1.0,
                np.log(max(steady, np.finfo(float).tiny)),
            )
        ]
        stimulated = 1.0 if self.light_stimulated is None else self.light_stimulated
        return np.array([*theta, stimulated, 0.05 * steady, readings.dark])

    def _search(self, start: FloatArray, model: _Model) -> LeastSquaresFit:
        """Fit from a start until a step gains little."""
        low, high = self.bounds(model)
        return least_squares(
            self.residuals,
            start,
            lower=low,
            upper=high,
            max_iterations=MAX_ITERATIONS,
            least_gain=MIN_GAIN,
        )

    def refined(self, fit: LeastSquaresFit, model: _Model) -> LeastSquaresFit:
        """Carry a fit to its minimum."""
        low, high = self.bounds(model)
        return least_squares(
            self.residuals,
            fit.parameters,
            lower=low,
            upper=high,
            max_iterations=MAX_ITERATIONS,
            tolerance=TOLERANCE,
        )

    def gain_of_kappa(self, fit: LeastSquaresFit, model: _Model, state: int) -> float:
        """Return the gain in χ² over a fit in which a state does not saturate."""
        low, high = self.bounds(model)
        place = state * STATE_PARAMETERS
        start = fit.parameters.copy()
        start[place] = high[place] = low[place]
        held = least_squares(
            self.residuals,
            start,
            lower=low,
            upper=high,
            max_iterations=MAX_ITERATIONS,
            least_gain=MIN_GAIN,
        )
        return held.chi2 - fit.chi2

    def misfit(self, fit: LeastSquaresFit) -> float:
        """Return the mean square of normalised sums of neighbouring residuals; 1 where noise."""
        stretches = self.readings.stretches()
        sums = [float(fit.residuals[own].sum() ** 2) / len(own) for own in stretches]
        dof = max(len(sums) - fit.rank, 1)
        return sum(sums) / dof if chdtrc(dof, sum(sums)) < MISFIT_CHANCE else 1.0

    def chi2_per_reading(self, fit: LeastSquaresFit) -> tuple[float, float]:
        """Return χ² per reading of charge and decay."""
        n = self.readings.lit
        squares = fit.residuals[: len(self.readings.values)] ** 2
        return float(squares[:n].mean()), float(squares[n:].mean())

    def candidate(self, model: _Model, fit: LeastSquaresFit, factor: float) -> ChargeCandidate:
        """Return the record of a model, with its BIC for noise `factor` times as large."""
        number = self.n_parameters(model)
        bic = fit.chi2 / factor + number * float(np.log(len(self.readings.values)))
        return ChargeCandidate(*model, number, *self.chi2_per_reading(fit), bic)


def _result(
    problem: _Problem,
    tried: tuple[_Model, LeastSquaresFit],
    candidates: tuple[ChargeCandidate, ...],
    chosen: int,
    factor: float,
    *,
    all_intervals: bool,
) -> ChargeFit:
    """Return the chosen model in the user's quantities."""
    model, readings = tried[0], problem.readings
    fit = problem.refined(tried[1], model)
    misfit = max(factor, problem.misfit(fit))
    covariance = misfit * _covariance(problem, fit, model)
    states = tuple(
        _state(problem, fit, model, covariance, number, misfit) for number in range(model.states)
    )
    chi2_charge, chi2_decay = problem.chi2_per_reading(fit)
    is_given = problem.light_stimulated is not None
    warnings = _warnings(
        readings,
        fit,
        states,
        misfit,
        (chi2_charge, chi2_decay),
        None if is_given else float(fit.parameters[-COMMON_PARAMETERS]),
    )
    common = [
        _measured(problem, fit, model, covariance, place % len(fit.parameters), misfit)
        for place in range(-COMMON_PARAMETERS, 0)
    ]
    places = sorted(range(model.states), key=lambda place: -states[place].rate_at_off_per_s.value)
    profiled = [
        ProfiledState(place, number, model.is_general, states[place].kappa_per_s is not None)
        for number, place in enumerate(places, start=1)
    ]
    intervals = charge_intervals(
        Likelihood(problem.residuals, fit, *problem.bounds(model)),
        readings.times.charge_s,
        profiled,
        misfit,
        all_of_them=all_intervals,
    )
    return ChargeFit(
        states=tuple(states[place] for place in places),
        light_stimulated=common[0],
        prompt=common[1],
        dark=common[2],
        charge_s=readings.times.charge_s,
        n_charge=readings.lit,
        n_decay=len(readings.values) - readings.lit,
        chi2_charge=chi2_charge,
        chi2_decay=chi2_decay,
        misfit=misfit,
        candidates=candidates,
        chosen=chosen,
        warnings=tuple(warnings),
        readings=_readings(readings, fit),
        intervals=intervals,
    )


def _readings(readings: Readings, fit: LeastSquaresFit) -> FittedReadings:
    """Return what was fitted, and the light of the fit."""
    times, sigma = readings.times, readings.sigma
    middles = [times.lit_s, times.charge_s + times.dark_s + times.exposure_s / 2]
    light = readings.values + fit.residuals[: len(readings.values)] * sigma
    return FittedReadings(np.concatenate(middles), readings.values, sigma, light)


def _covariance(problem: _Problem, fit: LeastSquaresFit, model: _Model) -> FloatArray:
    """Return the covariance of the parameters (p, p), 0 of those that are held.

    Bounds of orders, η and prompt light are those of what is possible: at one of them the mean
    square distance from it is that of the parameter without a bound, as is its effect on others.
    """
    low, high = problem.bounds(model)
    inside = (low < fit.parameters) & (fit.parameters < high)
    places = np.arange(len(low))
    is_common = places >= len(low) - COMMON_PARAMETERS
    is_possible = is_common | (places % STATE_PARAMETERS == ORDER)
    free = np.flatnonzero(inside | (is_possible & (low < high)))
    covariance = np.zeros((len(low), len(low)))
    columns = fit.jacobian[:, free]
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    factors = np.linalg.qr(columns / lengths, mode="r")
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.linalg.pinv(factors, rcond=1e-12) / lengths[:, None]
    covariance[np.ix_(free, free)] = inverse @ inverse.T
    return covariance


def _measured(
    problem: _Problem,
    fit: LeastSquaresFit,
    model: _Model,
    covariance: FloatArray,
    place: int,
    misfit: float,
) -> Measured:
    """Return a parameter with σ, one-sided where a bound holds it."""
    value, sigma = float(fit.parameters[place]), float(np.sqrt(covariance[place, place]))
    low, high = (float(ends[place]) for ends in problem.bounds(model))
    if sigma == 0 or low < value < high:
        return Measured(value, sigma)
    gradient = float(fit.jacobian[:, place] @ fit.residuals)
    return OneSided.held(value, sigma, abs(gradient) * sigma / misfit, is_upper=value >= high)


def _state(
    problem: _Problem,
    fit: LeastSquaresFit,
    model: _Model,
    covariance: FloatArray,
    number: int,
    misfit: float,
) -> OrderState:
    """Return a state with the σ of what the data tell of it."""
    own = slice(number * STATE_PARAMETERS, (number + 1) * STATE_PARAMETERS)
    charge_s, parameters = problem.readings.times.charge_s, fit.parameters[own]
    values = _quantities(parameters, charge_s)
    steps = STEP * np.eye(STATE_PARAMETERS)
    jacobian = np.stack(
        [
            (_quantities(parameters + step, charge_s) - _quantities(parameters - step, charge_s))
            / (2 * STEP)
            for step in steps
        ],
        axis=1,
    )
    sigma = np.sqrt(np.diag(jacobian @ covariance[own, own] @ jacobian.T))
    _, amplitude, rate, inverse_time, kappa, k_r, r0, reradiation = (
        Measured(float(value), float(each)) for value, each in zip(values, sigma, strict=True)
    )
    log_kappa_sigma = float(np.sqrt(covariance[own, own][0, 0]))
    is_known = 0 < log_kappa_sigma < KNOWN_LOG_KAPPA
    is_known = is_known and problem.gain_of_kappa(fit, model, number) > KNOWN_GAIN * misfit
    order = _measured(problem, fit, model, covariance, own.start + ORDER, misfit)
    b = order.value
    # A speed that a bound holds is not determined.
    is_timed = covariance[own, own][1, 1] > 0
    rate_sigma = rate.sigma if is_timed else np.inf
    time = exponent = None
    if order.sigma == 0:
        time = Measured(1 / rate.value, rate_sigma / rate.value**2, "s")
    elif b - 1 > ABOVE_FIRST_SIGMAS * order.sigma:
        time_s = 1 / inverse_time.value
        time = Measured(time_s, inverse_time.sigma * time_s**2 if is_timed else np.inf, "s")
        exponent = Measured(b / (b - 1), order.sigma / (b - 1) ** 2)
    return OrderState(
        order=order,
        amplitude=amplitude,
        rate_at_off_per_s=Measured(rate.value, rate_sigma, "1/s"),
        decay_time_s=time,
        exponent=exponent,
        kappa_per_s=Measured(kappa.value, kappa.sigma, "1/s") if is_known else None,
        k_r_per_s=Measured(k_r.value, k_r.sigma, "1/s") if is_known else None,
        r0=r0 if is_known else None,
        reradiation=reradiation if is_known else None,
    )


def _quantities(parameters: FloatArray, charge_s: float) -> FloatArray:
    """Return b, amplitude, p/τ, (b − 1)/b of that, κ, k, r(0), Λ of a state's parameters, (8,)."""
    rates = rates_of(parameters)
    b, r0 = rates.order, level_at_off(rates, charge_s)
    at_off = rates.k_r * r0 ** (b - 1)
    rate, inverse_time = b * at_off, (b - 1) * at_off
    amplitude = rates.reradiation * at_off * r0
    own = rates.kappa, rates.k_r, r0, rates.reradiation
    return np.array([b, amplitude, rate, inverse_time, *own])


def _warnings(
    readings: Readings,
    fit: LeastSquaresFit,
    states: Sequence[OrderState],
    misfit: float,
    chi2: tuple[float, float],
    stimulated: float | None,
) -> Iterator[ResultWarning]:
    """Yield warnings about a fit."""
    if fit.creeps:
        yield Undetermined(
            "fit-unconverged",
            "the search did not end at a minimum: parameters may move further",
        )
    if misfit > 1:
        charge, decay = chi2
        yield Misfit(
            "model-misfit",
            "the model misses the light by more than noise (χ² per reading {chi2_charge:.2f} of "
            "the charge, {chi2_decay:.2f} of the decay); every σ is enlarged by {factor:.1f}",
            chi2_charge=charge,
            chi2_decay=decay,
            factor=np.sqrt(misfit),
        )
    if readings.dark_sigma == 0:
        yield Unmeasured(
            "dark-level-unmeasured",
            "no reading was taken before the lamp was on: the dark level is assumed to be 0",
        )
    if stimulated is not None and stimulated >= MAX_STIMULATED:
        yield Misfit(
            "stimulation-at-bound",
            "η reached its bound, {bound:g}: the light under the lamp is not that of full traps; "
            "give η",
            bound=MAX_STIMULATED,
        )
    for state in states:
        if state.order.value >= MAX_ORDER:
            yield Misfit(
                "order-at-bound",
                "an order reached its bound, {bound:g}: this is no state of general order",
                bound=MAX_ORDER,
            )
    if any(np.isinf(state.rate_at_off_per_s.sigma) for state in states):
        yield Undetermined(
            "rate-unresolved",
            "the rate of a state is not determined: record for longer, or more densely",
        )
    if any(state.kappa_per_s is None for state in states):
        yield Undetermined(
            "charge-unsaturated",
            "κ, k_r and r(0) of a state are not determined apart, since its charge does not "
            "saturate enough: amplitude, τ and p belong to this charge only",
        )
