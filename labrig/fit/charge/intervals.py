"""Intervals of kinetic orders, rates and lifetimes of a charge by profile likelihood."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from labrig.fit.charge.model import STATE_PARAMETERS, level_at_off, rates_of
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
from labrig.material import MAX_ORDER
from labrig.results import ProfileInterval

#: Places of log κ and of the order among a state's parameters.
LOG_KAPPA, ORDER = 0, 2
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
        for quantity, names in _quantities(state, charge_s):
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


def _quantities(
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
