"""Intervals of excitation rates, re-radiation rates and kinetic orders by profile likelihood.

The noise and the sizes of the light's errors are held as they were fitted. The error of E, which
enters k_e one to one, moves each limit of k_e by its own share.
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from labrig.fit.excitation.parameters import Parameters, RelativeSigmas, is_fitted
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.fit.nonlinear_least_squares import LeastSquaresFit
from labrig.fit.profile_likelihood import (
    Likelihood,
    LowerMinimumError,
    Quantity,
    Value,
    parameter,
)
from labrig.foundation.arrays import FloatArray
from labrig.material import MAX_ORDER
from labrig.results import ProfileInterval

#: Which intervals a fit has: none, where ±σ misleads, or all.
IntervalChoice = Literal["none", "auto", "all"]


class _Wanted(NamedTuple):
    """Quantities that are judged together by the first one, with their names.

    `light_sigma` is the relative σ of what multiplies each of them.
    """

    names: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    light_sigma: tuple[float, ...]

    def value_of_first(self, theta: FloatArray) -> float:
        """Return the first quantity."""
        return self.quantities[0].value(theta)[0]


def excitation_intervals(
    problem: ExcitationProblem,
    solution: LeastSquaresFit,
    uncertain: RelativeSigmas,
    falling: NDArray[np.intp],
    stated_sigma: Mapping[str, float] | None,
) -> dict[str, ProfileInterval]:
    """Return intervals named as `FittedExcitation.covariance_parameters` are.

    Parameters
    ----------
    problem, solution
        Problem, and its minimum.
    uncertain
        Further sources of scatter.
    falling
        Numbers of the states by falling rate, shape (N,).
    stated_sigma
        σ by the same names: only what two points of the profile show ±σ to miss by more than 20 %
        has an interval. Of the k_e of a state the largest decides for all that it excites. None
        returns all.
    """
    lower, upper = problem.parameters.bounds()
    likelihood = Likelihood(problem.residuals, solution, lower, upper)
    intervals: dict[str, ProfileInterval] = {}
    for wanted in _wanted(problem.parameters, solution.parameters, uncertain, falling):
        if stated_sigma is not None:
            first, value = wanted.quantities[0], wanted.value_of_first(solution.parameters)
            # Without the light's part, which is no part of the profile.
            light = wanted.light_sigma[0] * value
            sigma = float(np.sqrt(max(stated_sigma[wanted.names[0]] ** 2 - light**2, 0.0)))
            if not likelihood.is_asymmetric(first, float, sigma):
                continue
        for name, quantity, sigma in zip(*wanted, strict=True):
            if stated_sigma is not None and quantity.value(solution.parameters)[0] <= 0:
                continue
            # A fit from which the profile falls is not at its minimum, and has a warning.
            with suppress(LowerMinimumError):
                intervals[name] = likelihood.interval(quantity).widened(sigma)
    return intervals


def _wanted(
    parameters: Parameters,
    theta: FloatArray,
    uncertain: RelativeSigmas,
    falling: NDArray[np.intp],
) -> Iterator[_Wanted]:
    columns, bands = parameters.columns, parameters.bands
    light_sigma = np.broadcast_to(uncertain.irradiance, bands)
    k_e = parameters.unpack(theta).k_e_per_s
    for number, state in enumerate(falling.tolist(), start=1):
        inverse = columns.inverse_gain.start + state
        order = columns.order.start + state if is_fitted(columns.order) else None
        rate = columns.k_r.start + state
        k_r = _k_r(rate, inverse, order, parameters.order or 1.0)
        yield _Wanted((f"k_r_per_s {number}",), (Quantity(k_r, least=0.0),), (0.0,))
        if order is not None:
            orders = Quantity(parameter(order), least=1.0, searched=(1.0, MAX_ORDER))
            yield _Wanted((f"kinetic_order {number}",), (orders,), (0.0,))
        by_size = np.argsort(-k_e[state], kind="stable")
        first = columns.growth.start + state * bands
        names = tuple(f"k_e_per_s {number} {band + 1}" for band in by_size)
        rates = tuple(
            Quantity(_product(first + band, inverse), least=0.0, searched=(0.0, np.inf))
            for band in by_size.tolist()
        )
        yield _Wanted(names, rates, tuple(light_sigma[by_size].tolist()))


def _k_r(rate: int, inverse: int, order: int | None, held: float) -> Value:
    """Return k_r = e^θ G^(b − 1) as a quantity's value, by the places of θ, 1/G and b."""

    def value(theta: FloatArray) -> tuple[float, FloatArray]:
        b = held if order is None else theta[order]
        log_gain = -np.log(theta[inverse])
        k_r = float(np.exp(theta[rate] + (b - 1) * log_gain))
        gradient = np.zeros(len(theta))
        gradient[rate] = k_r
        gradient[inverse] = -(b - 1) * k_r / theta[inverse]
        if order is not None:
            gradient[order] = k_r * log_gain
        return k_r, gradient

    return value


def _product(growth: int, inverse: int) -> Value:
    """Return k_e, the product of two parameters, as a quantity's value."""

    def value(theta: FloatArray) -> tuple[float, FloatArray]:
        gradient = np.zeros(len(theta))
        gradient[growth], gradient[inverse] = theta[inverse], theta[growth]
        return float(theta[growth] * theta[inverse]), gradient

    return value
