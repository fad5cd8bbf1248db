"""What the fit of one patch will know, in the units of its rates."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import fdtri, ncfdtr

from labrig.errors import FitError
from labrig.fit import FloatArray, fit_decay
from labrig.fit.decay import APART_SIGMAS, F_TEST_LEVEL
from labrig.predict.expectation import Expectation
from labrig.predict.series import ExpectedSeries

#: Parameters that one more state takes.
ADDED = 2


def chance_of_all_states(series: ExpectedSeries) -> float:
    """Probability that the fit tells as many states as there are.

    One state fewer is fitted to what is expected without noise; the χ² that it leaves is the
    noncentrality of the F-test and of the BIC by which the fit chooses (`labrig.fit`).
    """
    states, frames = len(series.k_r_per_s), len(series.t_s)
    if states == 1:
        return 1.0
    try:
        fewer = fit_decay(
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
    left = frames - 2 * states
    if left < 1:
        return 0.0
    by_f_test = float(fdtri(ADDED, left, 1 - F_TEST_LEVEL))
    by_bic = float(np.log(series.variance.size))
    return float(1 - ncfdtr(ADDED, left, fewer.chi2, max(by_f_test, by_bic)))


#: Chance of telling all states from which on there is nothing to say.
SURE = 0.95


@dataclass(frozen=True)
class PatchPrediction:
    """m states, by falling rate.

    Attributes
    ----------
    k_r_per_s, amplitude_dn_per_s
        (m,) as put in.
    k_r_sigma_per_s, amplitude_sigma_dn_per_s
        (m,) standard uncertainties; infinite where the frames say nothing.
    budget
        By source of noise, (m,) fraction of each rate's variance.
    chance_of_all_states
        That the fit tells as many states as there are; 1 if the protocol gives their number.
    least_apart
        Distance of the two closest rates on a logarithmic scale, in its σ; infinite for one rate.
    clipped
        Frames of one decay that clip and are left out.
    """

    k_r_per_s: tuple[float, ...]
    k_r_sigma_per_s: tuple[float, ...]
    amplitude_dn_per_s: tuple[float, ...]
    amplitude_sigma_dn_per_s: tuple[float, ...]
    budget: Mapping[str, tuple[float, ...]]
    chance_of_all_states: float
    least_apart: float
    clipped: int

    @property
    def resolves_all_states(self) -> bool:
        """Whether the fit will see every state, and know it from the others."""
        return self.chance_of_all_states >= SURE and self.least_apart >= APART_SIGMAS

    def to_json(self) -> dict[str, Any]:
        """For a program; what is infinite is None."""
        return {
            "states": [
                {
                    "k_r_per_s": self.k_r_per_s[i],
                    "k_r_sigma_per_s": _finite(self.k_r_sigma_per_s[i]),
                    "amplitude_dn_per_s": self.amplitude_dn_per_s[i],
                    "amplitude_sigma_dn_per_s": _finite(self.amplitude_sigma_dn_per_s[i]),
                    "noise": {source: part[i] for source, part in self.budget.items()},
                }
                for i in range(len(self.k_r_per_s))
            ],
            "chance_of_all_states": self.chance_of_all_states,
            "least_apart_sigmas": _finite(self.least_apart),
            "clipped_frames": self.clipped,
        }


def _least_apart(rates: FloatArray, covariance: FloatArray) -> float:
    """Of neighbours among the rates (m,), falling, with their covariance (m, m)."""
    relative = covariance / np.outer(rates, rates)
    variance = np.diag(relative)
    sigma2 = variance[:-1] + variance[1:] - 2 * np.diag(relative, 1)
    return float((-np.diff(np.log(rates)) / np.sqrt(sigma2)).min(initial=np.inf))


def _finite(sigma: float) -> float | None:
    return sigma if math.isfinite(sigma) else None


def predicted_patches(expected: Expectation) -> dict[str, PatchPrediction]:
    """Every patch of `expected`."""
    patches = {}
    for patch, series in expected.series.items():
        found = expected.found[patch]
        patches[patch] = PatchPrediction(
            k_r_per_s=tuple(series.k_r_per_s.tolist()),
            k_r_sigma_per_s=tuple(found.sigma[0::2].tolist()),
            amplitude_dn_per_s=tuple(series.amplitude.tolist()),
            amplitude_sigma_dn_per_s=tuple(found.sigma[1::2].tolist()),
            budget={source: tuple(part[0::2].tolist()) for source, part in found.budget.items()},
            chance_of_all_states=chance_of_all_states(series) if expected.states_chosen else 1.0,
            least_apart=_least_apart(series.k_r_per_s, found.covariance[0::2, 0::2]),
            clipped=expected.clipped[patch],
        )
    return patches
