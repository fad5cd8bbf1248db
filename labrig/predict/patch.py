"""Expected uncertainties of the fit of one patch."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import fdtri, ncfdtr

from labrig.fit import fit_decay
from labrig.fit.decay import APART_SIGMAS, F_TEST_LEVEL
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.predict.expectation import Expectation
from labrig.predict.series import ExpectedSeries

#: Number of parameters that one more state adds.
ADDED = 2


def chance_of_all_states(series: ExpectedSeries) -> float:
    """Return the probability that the fit resolves as many states as there are.

    A fit with one state less is made to the expected signal without noise; its χ² is the
    noncentrality of the F-test and of the BIC by which the fit chooses (`labrig.fit`). Of general
    order it fits one state.
    """
    states, frames = len(series.rate_per_s), len(series.t_s)
    if states == 1:
        return 1.0
    if series.shape.any():
        return 0.0
    try:
        fit = fit_decay(
            series.t_s,
            np.multiply.outer(series.curve, series.weights),
            np.sqrt(series.variance),
            exposure_s=series.exposure_s,
            channels=[str(number) for number in range(len(series.weights))],
            n_states=states - 1,
            offset_sigma=series.offset_sigma,
            flicker=series.flicker,
        )
    except FitError:
        return 0.0
    degrees_of_freedom = frames - 2 * states
    if degrees_of_freedom < 1:
        return 0.0
    f_test_limit = float(fdtri(ADDED, degrees_of_freedom, 1 - F_TEST_LEVEL))
    bic_limit = float(np.log(series.variance.size))
    return float(1 - ncfdtr(ADDED, degrees_of_freedom, fit.chi2, max(f_test_limit, bic_limit)))


#: Probability of resolving all states from which no warning is given.
SURE = 0.95


#: Numbers of a state, each with its σ.
STATE_HEAD = (
    *("rate (1/s)", "rate_sigma (1/s)", "kinetic_order", "kinetic_order_sigma"),
    *("amplitude (DN/s)", "amplitude_sigma (DN/s)"),
)


@dataclass(frozen=True)
class PatchPrediction:
    """Expected uncertainties of a patch with m states, by descending rate.

    Attributes
    ----------
    rate_per_s
        Rates assumed at lamp off in 1/s, shape (m,): k_r, or b k_r r(0)^(b − 1) of a kinetic order.
    rate_per_s_sigma
        Standard uncertainties of the rates in 1/s, shape (m,); infinite if undetermined.
    kinetic_order
        Kinetic orders b assumed, shape (m,).
    kinetic_order_sigma
        Standard uncertainties of the orders, shape (m,); 0 of the first order, which is not fitted,
        infinite if undetermined.
    amplitude_dn_per_s
        Amplitudes assumed in DN/s, shape (m,).
    amplitude_dn_per_s_sigma
        Standard uncertainties of the amplitudes in DN/s, shape (m,); infinite if undetermined.
    budget
        Fraction of each rate's variance by source of noise, shape (m,).
    chance_of_all_states
        Probability that the fit resolves all states; 1 if the protocol gives their number.
    least_apart
        Distance of the two closest rates on a logarithmic scale, in units of its σ; infinite for
        one rate.
    clipped
        Number of frames of one decay that clip and are left out.
    """

    rate_per_s: tuple[float, ...]
    rate_per_s_sigma: tuple[float, ...]
    kinetic_order: tuple[float, ...]
    kinetic_order_sigma: tuple[float, ...]
    amplitude_dn_per_s: tuple[float, ...]
    amplitude_dn_per_s_sigma: tuple[float, ...]
    budget: Mapping[str, tuple[float, ...]]
    chance_of_all_states: float
    least_apart: float
    clipped: int

    def states(self) -> Iterator[tuple[float, ...]]:
        """Yield the numbers of each state, in the order of `STATE_HEAD`."""
        yield from zip(
            *(self.rate_per_s, self.rate_per_s_sigma),
            *(self.kinetic_order, self.kinetic_order_sigma),
            *(self.amplitude_dn_per_s, self.amplitude_dn_per_s_sigma),
            strict=True,
        )

    @property
    def resolves_all_states(self) -> bool:
        """Whether the fit will resolve every state."""
        return self.chance_of_all_states >= SURE and self.least_apart >= APART_SIGMAS

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON; infinite ones are None."""
        return {
            "states": [
                {
                    "rate_per_s": self.rate_per_s[i],
                    "rate_per_s_sigma": _finite(self.rate_per_s_sigma[i]),
                    "kinetic_order": self.kinetic_order[i],
                    "kinetic_order_sigma": _finite(self.kinetic_order_sigma[i]),
                    "amplitude_dn_per_s": self.amplitude_dn_per_s[i],
                    "amplitude_dn_per_s_sigma": _finite(self.amplitude_dn_per_s_sigma[i]),
                    "noise": {source: part[i] for source, part in self.budget.items()},
                }
                for i in range(len(self.rate_per_s))
            ],
            "chance_of_all_states": self.chance_of_all_states,
            "least_apart_sigmas": _finite(self.least_apart),
            "clipped_frames": self.clipped,
        }


def _least_apart(rates: FloatArray, covariance: FloatArray) -> float:
    """Return the smallest distance of neighbouring rates in units of its σ.

    Parameters
    ----------
    rates
        Rates in 1/s, descending, shape (m,).
    covariance
        Covariance of the rates in 1/s², shape (m, m).
    """
    relative = covariance / np.outer(rates, rates)
    variance = np.diag(relative)
    sigma2 = variance[:-1] + variance[1:] - 2 * np.diag(relative, 1)
    return float((-np.diff(np.log(rates)) / np.sqrt(sigma2)).min(initial=np.inf))


def _finite(sigma: float) -> float | None:
    return sigma if math.isfinite(sigma) else None


def predicted_patches(expectation: Expectation) -> dict[str, PatchPrediction]:
    """Return the prediction of every patch."""
    patches = {}
    for patch, series in expectation.series.items():
        fit_information = expectation.found[patch]
        rates = slice(0, 2 * len(series.rate_per_s), 2)
        amplitudes = slice(1, 2 * len(series.rate_per_s), 2)
        order = 1 / (1 - series.shape)
        shape_sigma = np.zeros_like(order)
        shape_sigma[series.shape > 0] = fit_information.sigma[2 * len(order) :]
        patches[patch] = PatchPrediction(
            rate_per_s=tuple(series.rate_per_s.tolist()),
            rate_per_s_sigma=tuple(fit_information.sigma[rates].tolist()),
            kinetic_order=tuple(order.tolist()),
            kinetic_order_sigma=tuple((order**2 * shape_sigma).tolist()),
            amplitude_dn_per_s=tuple(series.amplitude.tolist()),
            amplitude_dn_per_s_sigma=tuple(fit_information.sigma[amplitudes].tolist()),
            budget={
                source: tuple(part[rates].tolist())
                for source, part in fit_information.budget.items()
            },
            chance_of_all_states=chance_of_all_states(series) if expectation.states_chosen else 1.0,
            least_apart=_least_apart(series.rate_per_s, fit_information.covariance[rates, rates]),
            clipped=expectation.clipped[patch],
        )
    return patches
