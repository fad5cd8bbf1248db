"""Selection of the number of states.

One more state is accepted only if both the Bayesian information criterion and an F-test favour it,
and if the rates are distinct and determined, unless fewer states are refuted. The F-test's
denominator is the frames' own scatter along the signal, so that neither an underestimated σ nor
common-mode flicker of the channels produces a spurious state.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc, fdtrc

from labrig.fit.decay.further_state import promising_rate
from labrig.fit.decay.noise_correlation import NoiseLikelihood
from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.decay.states import StatesFit, fit_one_more, fit_states, refit
from labrig.fit.decay.variable_projection import JointFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.results import Candidate

#: Significance level of a further state of known rate. Searching the rate adds false positives,
#: the BIC removes some: ≤ 0.3 % of single exponentials come out double (tests/acceptance).
F_TEST_LEVEL = 0.002
#: Gain in χ² that a creeping candidate may still reach where fewer states fit well already, hardly
#: ever more than 2; and the reduced χ² below which they do.
CREEPING_GAIN, GOOD_REDUCED_CHI2 = 4.0, 1.5
#: Gain in χ² beyond that found from which a further state is looked for at its most promising rate.
MISSED_GAIN = 1.0
#: Difference in BIC from which a law of one shape is taken instead of two exponentials. By one of
#: 2 a trap that hardly retraps passed for two rates in 11 of 100 decays of a signal-to-noise ratio
#: of 250; 1 takes no more sums of exponentials for a law.
PREFERRED_BIC = 1.0
#: Difference in BIC from which three exponentials are taken instead of a law.
THREE_BIC = 2.0
#: Gain in BIC from which a further state is accepted though its rate is ill-determined: odds of
#: e^5 = 150 : 1 against fewer states.
REFUTING_BIC = 10.0


def law_margin(n_states: int) -> float:
    """Return by how much the BIC of a law of one shape has to be lower than that of exponentials.

    One exponential is the limit of every law, which then has to be clearly better. Three can take
    the shape of any law, and hardly ever is a decay of three states as smooth as a law.
    """
    if n_states <= 1:
        return STRONG_EVIDENCE_DELTA_BIC
    return PREFERRED_BIC if n_states == 2 else -THREE_BIC


def choose_states(
    likelihood: NoiseLikelihood,
    numbers: range,
    fixed: FloatArray,
    weights: FloatArray,
    offsets: FloatArray,
) -> tuple[StatesFit | None, list[Candidate]]:
    """Fit more and more states, `numbers` of them, until one more is not supported.

    Parameters
    ----------
    likelihood
        Likelihood of the series whitened by the envelope's signal.
    numbers
        Total numbers of states, the fixed ones included.
    fixed
        Logarithms of the fixed rates, shape (f,).
    weights, offsets
        Start values of the channels, shape (C,).

    Returns
    -------
    fit, candidates
        The selected fit, None if not even the first is supported, and all candidates tried.
    """
    data = likelihood.data
    chosen: StatesFit | None = None
    tried: list[Candidate] = []
    needed_chi2 = np.inf
    for n_states in numbers:
        if chosen is None:
            fit = fit_states(data, n_states - len(fixed), fixed, weights, offsets)
        else:
            fit = _with_one_more(data, chosen, needed_chi2)
        if fit is not None and _must_end(likelihood, fit) and fit.joint.chi2 < needed_chi2:
            # The first number is perhaps the one that was asked for.
            fit = _at_minimum(data, fit) or (fit if chosen is None else None)
        if fit is None:
            break
        p_value = None if chosen is None else f_test(likelihood, chosen.joint, fit.joint)
        tried.append(
            Candidate(
                n_states, fit.joint.least_squares.reduced_chi2, likelihood.bic(fit.joint), p_value
            )
        )
        if p_value is not None:
            needed_gain = 0.0 if fit.rates_are_determined else REFUTING_BIC
            if p_value > F_TEST_LEVEL or tried[-1].bic > tried[-2].bic - needed_gain:
                break
        chosen = fit
        if fit.joint.least_squares.reduced_chi2 < GOOD_REDUCED_CHI2:
            penalty = 2 * float(np.log(data.independent_data(fit.joint.weights)))
            needed_chi2 = fit.joint.chi2 - penalty + CREEPING_GAIN
    return chosen, tried


def _must_end(likelihood: NoiseLikelihood, fit: StatesFit) -> bool:
    """Return whether a fit goes on to its minimum before it is compared with others.

    Without σ, models are compared by the ratio of their χ², in which a small rest counts.
    """
    return fit.joint.least_squares.creeps or not likelihood.data.series.sigma_given


def _at_minimum(data: WhitenedSeries, fit: StatesFit) -> StatesFit | None:
    """Return a fit carried to its minimum; None if a state vanishes there."""
    finished = refit(data, fit)
    return finished if finished.n_states == fit.n_states else None


def _with_one_more(data: WhitenedSeries, fewer: StatesFit, needed_chi2: float) -> StatesFit | None:
    """Fit one state more, from the rate that promises most or, if that is enough, from all.

    A state that lasts for a frame is easily missed on the grid of rates, where others are so far
    from their best that their misfit outweighs it.
    """
    log_rate, amplitude, gain = promising_rate(data, fewer)
    tried: list[StatesFit | None] = []
    reached = 0.0
    if gain >= fewer.joint.chi2 - needed_chi2:
        weights, offsets = fewer.joint.weights, fewer.joint.offsets
        found = fit_states(data, fewer.n_free + 1, fewer.fixed, weights, offsets, needed_chi2)
        reached = 0.0 if found is None else fewer.joint.chi2 - found.joint.chi2
        tried = [found]
    if not tried or reached < 0 or gain >= reached + MISSED_GAIN:
        tried.append(fit_one_more(data, fewer, log_rate, amplitude))
    # A fit that is worse than one with fewer states did not end at its minimum.
    better = [fit for fit in tried if fit is not None and fit.joint.chi2 <= fewer.joint.chi2]
    return min(better, key=lambda fit: fit.joint.chi2, default=None)


def is_needed(
    likelihood: NoiseLikelihood,
    fit: StatesFit,
    candidates: Sequence[Candidate],
) -> bool:
    """Return whether one state fewer is refuted, fitting it if it is not among the candidates."""
    data = likelihood.data
    if fit.n_free < 2:
        return True
    fewer_bic = next(
        (other.bic for other in candidates if other.n_states == fit.n_states - 1), None
    )
    if fewer_bic is None:
        joint = fit.joint
        fewer = fit_states(data, fit.n_free - 1, fit.fixed, joint.weights, joint.offsets)
        if fewer is None or f_test(likelihood, fewer.joint, joint) > F_TEST_LEVEL:
            return False
        fewer_bic = likelihood.bic(fewer.joint)
    return fewer_bic - likelihood.bic(fit.joint) > REFUTING_BIC


def f_test(likelihood: NoiseLikelihood, fewer: JointFit, more: JointFit) -> float:
    """Return the chance of a gain in χ² as large as that from `fewer` to `more` parameters.

    The gain is compared with the scatter of all frames, or of the bright ones if that is larger:
    these produce the gain, and an unmodelled flicker appears only in them.
    """
    data = likelihood.data
    added = more.n_parameters - fewer.n_parameters
    residuals = more.least_squares.residuals
    frames, brightness2 = more.frame_residuals(data)
    factors = likelihood.likeliest_factors(residuals)
    frames, brightness2 = frames / np.sqrt(factors), brightness2 / factors
    dof = len(frames) - more.leverage(data)[0]
    if dof < 1 or added <= 0:
        return 1.0
    free_fraction = dof / len(frames)
    bright_scatter = float(brightness2 @ frames**2) / float(brightness2.sum())
    scatter = max(float(frames @ frames) / len(frames), bright_scatter) / free_fraction
    if scatter == 0:
        return 0.0
    deviance = likelihood.deviance(fewer.least_squares.residuals) - likelihood.deviance(residuals)
    gain = max(deviance, 0.0) / scatter
    if likelihood.is_known:
        return float(fdtrc(added, dof, gain / added))
    # The deviance allows for a noise that is told by a few frames only.
    return float(chdtrc(added, gain))
