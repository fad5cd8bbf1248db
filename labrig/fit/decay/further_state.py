"""A further state beside those fitted: what it would take from the data, and from the others.

A fast state that is gone after a frame or two shifts the rates of the others long before the data
prove it. For each rate that it could have, the fit is linear in its small amplitude a: with the
column c of that exponential and the Jacobian J of the fitted parameters, q = c − J J⁺c is what only
the further state explains, a = −q·r/q² ± 1/|q| its amplitude, and −J⁺c a its effect on the others.
The chance that it is there follows from the likelihood, averaged over its rate and over the a ≥ 0
that are usual (model averaging; J. Hoeting et al., Statistical Science 14, 1999). Its effect on the
others, times its chance, is a part of their covariance.

If all rates grow as k (1 + γ t), a state's signal is a (1 + γ t) e^(−k (t + γ t²/2)). A fit with
constant rates takes what it can of the derivative c by γ, and its parameters move by J⁺c a unit of
γ, J the Jacobian. Of a drift of some kelvins an hour the rest is below the noise of a decay of
minutes, so that nothing in the data tells it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from labrig.fit.decay.series import FASTEST_DECAYS, WhitenedSeries
from labrig.fit.decay.states import StatesFit
from labrig.foundation.arrays import FloatArray
from labrig.material import exponential_means

#: Rates tried for a further state of any rate, and for one that is faster than all others.
ANY_RATES, FASTER_RATES = 24, 12
#: Odds that a fast state is there before the data tell: most samples have none.
PRIOR_ODDS = 0.2
#: Scale of its amplitude, relative to all others' sum.
USUAL_SHARE = 0.4
#: Lifetimes before the first frame beyond which a state was all of the light at lamp off: e^300 is
#: near the largest number.
MAX_PHASE = 300.0
#: Ratio to the fastest rate found from which a further state is a fast one.
FASTER = 2.0
#: Chance from which a hidden state counts: below, the data do not support it, and a σ that covered
#: what they say nothing of would have no limit. And the chance from which a warning tells it.
POSSIBLE, LIKELY = 0.1, 0.5
#: Probability that the amplitude of a state that goes unseen is below its limit.
LIMIT = 0.95
#: Fall of χ² from which a further state is shown, not hidden: fewer were asked for, or allowed.
SHOWN_GAIN = 40.0
#: Part of an exponential that the fitted parameters must leave over; less is rounding.
MIN_OWN = 1e-4
#: Smallest slope of the others' parameters that counts as dependent.
RCOND = 1e-10


@dataclass(frozen=True)
class FurtherState:
    """Effect of an exponential of each of m rates, in the fit's own units.

    Attributes
    ----------
    log_rates
        Logarithms of the rates, shape (m,).
    amplitude, amplitude_sigma
        Amplitude at the first frame, of either sign, and σ, shape (m,).
    effect
        Change of the fitted parameters by an amplitude of 1, shape (p, m).
    """

    log_rates: FloatArray
    amplitude: FloatArray
    amplitude_sigma: FloatArray
    effect: FloatArray

    @property
    def gain(self) -> FloatArray:
        """Fall of χ² by a positive amplitude, shape (m,)."""
        return np.maximum(self.amplitude / self.amplitude_sigma, 0.0) ** 2


def further_state(data: WhitenedSeries, fit: StatesFit, log_rates: FloatArray) -> FurtherState:
    """Return what a further state would be at each of the given log rates (m,)."""
    series, joint = data.series, fit.joint
    solution = joint.least_squares
    means = exponential_means(np.exp(log_rates), series.t, series.exposure)
    columns = data.signal_design(data.constant(joint.weights), means)
    jacobian = solution.jacobian
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    effect = -np.linalg.lstsq(jacobian / scale, columns, rcond=RCOND)[0] / scale[:, None]
    own = columns + jacobian @ effect
    own2 = np.einsum("ij,ij->j", own, own)
    is_own = own2 > MIN_OWN**2 * np.einsum("ij,ij->j", columns, columns)
    own2 = np.where(is_own, own2, np.inf)
    amplitude = -(own.T @ solution.residuals) / own2
    return FurtherState(
        log_rates[is_own], amplitude[is_own], own2[is_own] ** -0.5, effect[:, is_own]
    )


def promising_rate(data: WhitenedSeries, fit: StatesFit) -> tuple[float, float, float]:
    """Return log rate, amplitude and gain in χ² of the further state that explains most."""
    rates = np.linspace(*data.series.log_rate_bounds, ANY_RATES)
    further = further_state(data, fit, rates)
    if not len(further.log_rates):
        return 0.0, 0.0, 0.0
    best = int(np.argmax(further.gain))
    return (
        float(further.log_rates[best]),
        max(float(further.amplitude[best]), 0.0),
        float(further.gain[best]),
    )


@dataclass(frozen=True)
class FastStates:
    """States that are gone after a step between frames, one of each of m rates.

    Attributes
    ----------
    further
        Their effect.
    amplitude, sigma
        Mode and σ of the normal distribution, cut off below 0, of the amplitude at the first frame,
        by the data and by what is usual, shape (m,).
    shrinkage
        Weight of what is usual against the data, 0 to 1, shape (m,).
    """

    further: FurtherState
    amplitude: FloatArray
    sigma: FloatArray
    shrinkage: FloatArray

    @property
    def z(self) -> FloatArray:
        """Amplitudes in σ, shape (m,)."""
        return np.asarray(self.amplitude / self.sigma)

    @property
    def mean(self) -> FloatArray:
        """Mean amplitudes, shape (m,)."""
        density = np.exp(-(self.z**2) / 2 - log_ndtr(self.z)) / np.sqrt(2 * np.pi)
        return np.asarray(self.sigma * (self.z + density))

    @property
    def limit(self) -> FloatArray:
        """Amplitudes that states which go unseen do not exceed, at 95 % probability, (m,)."""
        return np.asarray(
            self.amplitude - self.sigma * ndtri_exp(np.log(1 - LIMIT) + log_ndtr(self.z))
        )

    def share(self, amplitude: FloatArray, data: WhitenedSeries, fit: StatesFit) -> FloatArray:
        """Return the shares of amplitudes at the first frame in all light at lamp off, (m,)."""
        start = data.series.start
        phases = np.minimum(np.exp(self.further.log_rates) * start, MAX_PHASE)
        at_lamp_off = amplitude * np.exp(phases)
        others = float(fit.amplitudes @ np.exp(np.exp(fit.log_rates) * start))
        return np.asarray(at_lamp_off / (at_lamp_off + others))


def fast_states(data: WhitenedSeries, fit: StatesFit) -> FastStates | None:
    """Return the fast states that may be there beside the fitted ones.

    The result is None if the fastest one fitted leaves no room, or if the data show one.

    Parameters
    ----------
    data
        The series in units of its noise.
    fit
        The fit at its minimum.
    """
    high = data.series.log_rate_bounds[1]
    low = max(float(fit.log_rates.max()) + np.log(FASTER), high - np.log(FASTEST_DECAYS))
    if low >= high or not np.isfinite(fit.joint.least_squares.covariance).all():
        return None
    further = further_state(data, fit, np.linspace(low, high, FASTER_RATES))
    if not len(further.log_rates) or further.gain.max() > SHOWN_GAIN:
        return None
    prior = USUAL_SHARE * float(fit.amplitudes.sum())
    # Not as 1 less the weight of the data, which may be so near 1 that nothing is left.
    shrinkage = further.amplitude_sigma**2 / (prior**2 + further.amplitude_sigma**2)
    return FastStates(
        further=further,
        amplitude=(1 - shrinkage) * further.amplitude,
        sigma=np.sqrt(1 - shrinkage) * further.amplitude_sigma,
        shrinkage=shrinkage,
    )


@dataclass(frozen=True)
class HiddenState:
    """A fast state that the data support and do not show.

    Attributes
    ----------
    lifetime
        Lifetime at which the data support it most, in spans.
    share
        Its share of all light at lamp off.
    covariance
        Its part in the covariance of the fitted parameters, shape (p, p).
    is_likely
        Whether it is likely enough to be told.
    """

    lifetime: float
    share: float
    covariance: FloatArray
    is_likely: bool


def hidden_state(data: WhitenedSeries, fit: StatesFit, fast: FastStates) -> HiddenState | None:
    """Return what a fast state does to the fitted ones; None if the data do not support any."""
    z = fast.z
    # Of a normal distribution cut off below 0: its integral, and its mean square.
    log_evidence = np.log(2 * PRIOR_ODDS) + np.log(fast.shrinkage) / 2 + log_ndtr(z) + z**2 / 2
    mean_square = fast.sigma**2 + fast.amplitude * fast.mean
    largest = max(float(log_evidence.max()), 0.0)
    evidence = np.exp(log_evidence - largest) / len(z)
    probability = evidence / (evidence.sum() + np.exp(-largest))
    chance = float(probability.sum())
    if chance <= POSSIBLE:
        return None
    effect = fast.further.effect
    likeliest = int(np.argmax(probability))
    return HiddenState(
        lifetime=float(np.exp(-fast.further.log_rates[likeliest])),
        share=float(fast.share(fast.mean, data, fit)[likeliest]),
        covariance=(effect * (probability * mean_square)) @ effect.T,
        is_likely=chance > LIKELY,
    )


#: Gauss–Legendre nodes and weights on [0, 1].
_NODES, _FRACTIONS = np.polynomial.legendre.leggauss(8)
NODES, FRACTIONS = (_NODES + 1) / 2, _FRACTIONS / 2


def drift_effect(data: WhitenedSeries, fit: StatesFit) -> FloatArray:
    """Return the change of the fitted parameters by a drift γ of 1 per span, shape (p,).

    The values without it are those of the temperature at lamp off.
    """
    series, joint = data.series, fit.joint
    rates = np.exp(fit.log_rates)
    # Amplitudes are those at the first frame, times are counted from lamp off.
    amplitudes = fit.amplitudes * np.exp(rates * series.start)
    time = (series.t + series.start)[:, None] + series.exposure[:, None] * NODES
    by_drift = np.zeros(time.shape)
    for rate, amplitude in zip(rates, amplitudes, strict=True):
        by_drift += amplitude * np.exp(-rate * time) * (time - rate * time**2 / 2)
    column = data.signal_design(data.constant(joint.weights), (by_drift @ FRACTIONS)[:, None])
    jacobian = joint.least_squares.jacobian
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    effect = np.linalg.lstsq(jacobian / scale, column, rcond=RCOND)[0][:, 0] / scale
    return np.asarray(effect)
