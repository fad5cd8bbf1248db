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
from numpy.typing import ArrayLike
from scipy.ndimage import median_filter

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
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


#: Readings nearer than this to a switching of the lamp, in steps between readings, are left out.
SWITCHING_STEPS = 1.5
#: Least number of readings under the lamp, and of those after it.
MIN_READINGS = 4
#: Neighbours whose median is taken for the mean light where σ is not given.
NEIGHBOURS = 9
#: Median of the square of a standard normal variable.
MEDIAN_SQUARE = 0.4549
#: Least counts in the variance of a reading.
MIN_COUNTS = 4.0
#: Least light after the lamp, in σ of its mean.
VISIBLE_SIGMAS = 5.0
#: Stretches of the charge, of equal times, and of the decay, of equal ratios of times, in which
#: residuals are summed.
CHARGE_STRETCHES, DECAY_STRETCHES = 15, 25


@dataclass(frozen=True)
class Readings:
    """Readings that are fitted, under the lamp first.

    Attributes
    ----------
    times
        When they were read.
    values, sigma
        Values with the dark level, and their σ, shape (n,).
    dark, dark_sigma
        Mean of the readings before the charge and its σ; 0 without any.
    """

    times: ChargeAndDecay
    values: FloatArray
    sigma: FloatArray
    dark: float
    dark_sigma: float

    @property
    def lit(self) -> int:
        """Number of readings under the lamp."""
        return len(self.times.lit_s)

    @property
    def span_s(self) -> float:
        """Time of the last reading after lamp on."""
        return self.times.charge_s + float(self.times.dark_s[-1])

    @property
    def step_s(self) -> float:
        """Shortest time between readings."""
        both = (self.times.lit_s, self.times.dark_s)
        return min(float(np.diff(each).min()) for each in both)

    def stretches(self) -> list[np.ndarray]:
        """Return the indices of the readings of each stretch of charge and decay."""
        times = self.times
        lit = times.lit_s / times.charge_s * CHARGE_STRETCHES
        later = np.log(times.dark_s + self.step_s)
        dark = (later - later[0]) / max(float(np.ptp(later)), 1e-9) * DECAY_STRETCHES
        groups = np.concatenate(
            [np.floor(lit), CHARGE_STRETCHES + np.minimum(np.floor(dark), DECAY_STRETCHES - 1)]
        )
        return [np.flatnonzero(groups == group) for group in np.unique(groups)]


def readings_of(
    t_s: ArrayLike,
    values: ArrayLike,
    sigma: ArrayLike | None,
    exposure_s: ArrayLike,
    light_s: tuple[float, float],
) -> Readings:
    """Return the readings to be fitted, those while the lamp switches left out.

    The arguments are those of `fit_charge_and_decay`; without σ it is told by the scatter of
    neighbours, with a variance that is proportional to the value.
    """
    on_s, off_s = light_s
    t, y = np.asarray(t_s, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if t.ndim != 1 or y.shape != t.shape:
        raise FitError(f"expected one value for each time, got {y.shape} values, {t.shape} times")
    if not off_s > on_s:
        raise FitError(f"expected the lamp off after it was on at {on_s:g} s, got {off_s:g} s")
    exposure = np.broadcast_to(np.asarray(exposure_s, dtype=np.float64), t.shape)
    for quantity, numbers in (("times", t), ("values", y), ("exposures", exposure)):
        if not np.isfinite(numbers).all():
            raise FitError(f"expected finite {quantity}, got NaN or infinite ones; leave them out")
    order = np.argsort(t, kind="stable")
    t, y, exposure = t[order], y[order], exposure[order]
    if len(t) < 2 or not (steps := np.diff(t)).all():
        raise FitError("expected readings at different times, got several at the same time")
    guard = SWITCHING_STEPS * float(np.median(steps))
    before = np.flatnonzero(t + exposure < on_s - guard)
    lit = np.flatnonzero((t > on_s + guard) & (t + exposure < off_s - guard))
    after = np.flatnonzero(t > off_s + guard)
    if min(len(lit), len(after)) < MIN_READINGS:
        raise FitError(
            f"expected {MIN_READINGS} readings or more while the lamp is on, from {on_s:g} s to "
            f"{off_s:g} s, and as many later, got {len(lit)} and {len(after)}; the times are from "
            f"{t[0]:g} s to {t[-1]:g} s"
        )
    parts = (before, lit, after)
    if sigma is None:
        used = _counting_sigma([y[part] for part in parts])
    else:
        given = np.broadcast_to(np.asarray(sigma, dtype=np.float64), t.shape)[order]
        if not np.all(given > 0):
            raise FitError(f"expected σ > 0, got {given.min():g}")
        used = [given[part] for part in parts]
    kept = np.concatenate([lit, after])
    dark_weights = used[0] ** -2.0
    readings = Readings(
        ChargeAndDecay(
            off_s - on_s, (t + exposure / 2)[lit] - on_s, t[after] - off_s, exposure[after]
        ),
        y[kept],
        np.concatenate(used[1:]),
        float(np.average(y[before], weights=dark_weights)) if len(before) else 0.0,
        float(dark_weights.sum() ** -0.5) if len(before) else 0.0,
    )
    _refuse_darkness(readings)
    return readings


def _refuse_darkness(readings: Readings) -> None:
    """Refuse readings after the lamp of which no first few stand out of their noise."""
    glow = readings.values[readings.lit :] - readings.dark
    weights = readings.sigma[readings.lit :] ** -2.0
    total = np.cumsum(weights)
    mean_sigma = np.hypot(total**-0.5, readings.dark_sigma)
    if not np.max(np.cumsum(weights * glow) / total / mean_sigma) > VISIBLE_SIGMAS:
        raise FitError(
            "expected light that decays after the lamp, got none above the noise; check the times "
            "of the lamp"
        )


def _counting_sigma(parts: list[FloatArray]) -> list[FloatArray]:
    """Return the σ of each part, σ² = c y with c by the scatter of neighbours."""
    squares, levels, smooth = [], [], []
    for values in parts:
        level = median_filter(values, NEIGHBOURS, mode="nearest") if len(values) else values
        smooth.append(level)
        if len(values) > 2:
            squares.append((values[2:] - 2 * values[1:-1] + values[:-2]) ** 2 / 6)
            levels.append(level[1:-1])
    square, light = np.concatenate(squares), np.concatenate(levels)
    bright = light > np.median(light)
    if not bright.any() or not (count := np.median(square[bright] / light[bright])) > 0:
        raise FitError("expected values that scatter, got a smooth curve; give their σ")
    count /= MEDIAN_SQUARE
    return [np.sqrt(count * np.maximum(level, MIN_COUNTS * count)) for level in smooth]
