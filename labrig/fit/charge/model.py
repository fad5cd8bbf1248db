"""Light of states of general order while a lamp charges them and afterwards, with derivatives.

A state obeys dr/dt = (1 − r) κ − k rᵇ from r = 0 and emits Λ (k rᵇ + η κ r) under the lamp, Λ k rᵇ
in the dark: a carrier that finds its trap filled recombines at once, all of them if η is 1. Prompt
light is added while the lamp is on, and a dark level to all readings.

Where r stays far below 1, r → c r, Λ → Λ/c, κ → c κ, k → c^(1 − b) k changes no light. The
parameters are therefore κ, of which only the saturation knows, and what does not depend on c: the
order b, the speed s = (k κ^(b − 1))^(1/b), which is k where b is 1, and the steady light g = Λ κ.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS, becquerel_of, lit_concentration, lit_step

#: Parameters of a state: log κ, log s, b, log g; and the place of b.
STATE_PARAMETERS, ORDER = 4, 2
#: Those of all states, which follow: η, the prompt light and the dark level.
COMMON_PARAMETERS = 3


class StateRates(NamedTuple):
    """Parameters of a state as in its equation: κ and k in 1/s, b, and Λ."""

    kappa: float
    k_r: float
    order: float
    reradiation: float


def rates_of(state: FloatArray) -> StateRates:
    """Return κ, k, b, Λ of a state's four parameters."""
    log_kappa, log_speed, order, log_steady = (float(value) for value in state)
    log_k = order * log_speed + (1 - order) * log_kappa
    kappa, k_r, reradiation = np.exp([log_kappa, log_k, log_steady - log_kappa]).tolist()
    return StateRates(kappa, k_r, order, reradiation)


def level_at_off(rates: StateRates, charge_s: float) -> float:
    """Return r(0), the concentration at lamp off."""
    return float(lit_concentration(0.0, rates.kappa, rates.k_r, rates.order, charge_s))


@dataclass(frozen=True)
class ChargeAndDecay:
    """Times at which the light of a sample was read.

    Attributes
    ----------
    charge_s
        Length of the charge in seconds.
    lit_s
        Times of readings under the lamp after lamp on in seconds, shape (n,).
    dark_s, exposure_s
        Begin after lamp off and length of readings in the dark in seconds, shape (m,).
    """

    charge_s: float
    lit_s: FloatArray
    dark_s: FloatArray
    exposure_s: FloatArray

    def light(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the light (n + m,), readings under the lamp first, and its Jacobian (n + m, p).

        Parameters
        ----------
        theta
            Four parameters of each state, then η, prompt light and dark level, shape (p,).
        """
        n, size = len(self.lit_s), len(self.lit_s) + len(self.dark_s)
        stimulated, prompt, dark = theta[-COMMON_PARAMETERS:].tolist()
        light, jacobian = np.zeros(size), np.zeros((size, len(theta)))
        for first in range(0, len(theta) - COMMON_PARAMETERS, STATE_PARAMETERS):
            own = slice(first, first + STATE_PARAMETERS)
            part = self._of_state(theta[own], stimulated)
            light += part.light
            jacobian[:, own] = part.slopes
            jacobian[:n, -3] += part.stimulated
        light[:n] += prompt
        jacobian[:n, -2] = 1.0
        jacobian[:, -1] = 1.0
        return light + dark, jacobian

    def _of_state(self, state: FloatArray, stimulated: float) -> "_StateLight":
        """Return the light of one state and its derivatives."""
        kappa, k_r, b, reradiation = rates_of(state)
        n, steady = len(self.lit_s), reradiation * kappa
        charged = lit_step(0.0, kappa, k_r, b, np.append(self.lit_s, self.charge_s))
        r = np.maximum(charged.value, np.finfo(float).tiny)
        # By log κ, log s and b, on which log k depends.
        k_by = (1 - b, b, (np.log(k_r) - np.log(kappa)) / b)
        r_by = [k_r * charged.by_k_r * slope for slope in k_by]
        r_by[0] = r_by[0] + kappa * charged.by_kappa
        r_by[2] = r_by[2] + charged.by_order
        escaping = k_r * r**b / kappa
        log_by = [slope + b * each / r for slope, each in zip(k_by, r_by, strict=True)]
        log_by[0] = log_by[0] - 1
        log_by[2] = log_by[2] + np.log(r)

        law = becquerel_of(float(r[-1]), k_r, b)
        mean, by_law = DECAY_LAWS["becquerel"].means(*law, self.dark_s, self.exposure_s)
        light, slopes = np.empty(n + len(mean)), np.empty((n + len(mean), STATE_PARAMETERS))
        light[:n] = steady * (escaping[:n] + stimulated * r[:n])
        light[n:] = steady * escaping[-1] * mean
        for column in range(3):
            lit = escaping[:n] * log_by[column][:n] + stimulated * r_by[column][:n]
            slopes[:n, column] = steady * lit
            rate_by = k_by[column] + (b - 1) * r_by[column][-1] / r[-1]
            shape_by = 0.0
            if column == 2:
                rate_by, shape_by = rate_by + 1 / b + np.log(r[-1]), 1 / b**2
            decaying = mean * log_by[column][-1] + by_law[:, 0] * rate_by + by_law[:, 1] * shape_by
            slopes[n:, column] = steady * escaping[-1] * decaying
        slopes[:, 3] = light
        return _StateLight(light, slopes, steady * r[:n])


class _StateLight(NamedTuple):
    """Light of a state (n + m,), its derivatives (n + m, 4), and that by η, (n,)."""

    light: FloatArray
    slopes: FloatArray
    stimulated: FloatArray
