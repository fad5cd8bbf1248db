"""Noise that correlates from value to value, as that of a lamp or a room that drifts does.

Neighbouring values then err together, and what a sum of exponentials averages over is less than it
seems. In units of their σ, the values deviate from the fit with the covariance
V = D + c² S φ^|f − g| S: S is the part of σ that is flicker, or all of it, and D the independent
rest. The restricted likelihood (D. Harville, J. Am. Stat. Assoc. 72, 1977) allows for what the fit
took of the deviations, and weighs all φ and c. That there is no correlation is four times as
probable before the data as all φ > 0 together, since the flicker of shutter and aperture has none;
these have the reference prior (1 − φ²)^(−1/2) (J. O. Berger, R.-Y. Yang, Econometric Theory 10,
1994). The fit, whose weights are those of independent values, has the covariance A V Aᵀ with
A = (JᵀJ)⁻¹Jᵀ, and V is the mean over all φ and c (model averaging; J. Hoeting et al., Statistical
Science 14, 1999). That there may be none or one, an error then having either of two widths, makes
longer tails than those of a normal distribution: σ is not less than what makes 3 σ exceeded as
seldom as by one, if a noise that correlates has the geometric mean of c. A threshold would do
worse: some dozens of values hardly tell a memory of one or two frames, which makes σ too small by a
third, and σ would jump at it.

The flicker ρ, or without σ the scale of the noise, is taken from the scatter about the best
monotone curve. Some dozens of frames tell it to 10 or 20 %, and so a χ² that is larger by ten may
mean no more than that ρ came out small. Models are therefore compared by their likelihood with the
noise that suits each of them best. No model can hide a misfit in it: the scatter about the curve
is in the residuals of all models, and what one adds to it counts the more, the smaller it is.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded
from scipy.special import ndtr

from labrig.fit.decay.diagnostics import BELOW_ZERO_SIGMAS
from labrig.fit.decay.envelope import MAX_FLICKER, USUAL_FLICKER, Envelope
from labrig.fit.decay.series import WhitenedSeries
from labrig.fit.decay.variable_projection import JointFit
from labrig.foundation.arrays import FloatArray

#: Values of ρ that are tried, dense near zero, where a small one already tells.
FLICKERS = MAX_FLICKER * np.linspace(0, 1, 100) ** 2
#: Variance over that assumed where the flicker assumed is all of it and less is tried: rounding
#: may else make it negative.
MIN_FACTOR = 1e-12
#: Relative error of values and models by rounding: smaller residuals say nothing of a model.
ROUNDING = 1e-13


@dataclass(frozen=True)
class NoiseLikelihood:
    """Likelihood of whitened residuals.

    Attributes
    ----------
    data
        The series in units of the noise assumed.
    along
        Direction of the signal in each frame, of length 1, shape (n, C).
    factors
        Variance along the signal with each noise that is possible, over that assumed, shape (m, n).
    """

    data: WhitenedSeries
    along: FloatArray
    factors: FloatArray

    @classmethod
    def of(cls, data: WhitenedSeries, noise: Envelope) -> "NoiseLikelihood":
        """Return the likelihood of residuals in units of a noise."""
        signal = np.einsum("fcd,fd->fc", data.matrices, noise.signal)
        brightness2 = np.einsum("fc,fc->f", signal, signal)
        length = np.sqrt(np.where(brightness2 > 0, brightness2, 1.0))
        flickers = noise.likely_flickers if noise.is_given else FLICKERS
        added = flickers**2 - noise.typical_flicker**2
        return cls(
            data,
            signal / length[:, None],
            np.maximum(1 + np.multiply.outer(added, brightness2), MIN_FACTOR),
        )

    def deviance(self, residuals: FloatArray) -> float:
        """Return −2 log of the largest likelihood of whitened residuals (n C + p,), but a constant.

        It is their χ² if the noise is known.
        """
        chi2 = float(residuals @ residuals)
        if not self.data.series.sigma_given:
            n_values = self.data.series.n_values
            of_rounding = ROUNDING**2 * float(self.data.target @ self.data.target)
            return n_values * (1 + float(np.log(max(chi2, of_rounding) / n_values)))
        return chi2 + float(self._changes(residuals).min())

    def likeliest_factors(self, residuals: FloatArray) -> FloatArray:
        """Return the likeliest variance along the signal, over that assumed, shape (n,)."""
        if not self.data.series.sigma_given:
            return np.ones_like(self.factors[0])
        return np.asarray(self.factors[np.argmin(self._changes(residuals))])

    def _changes(self, residuals: FloatArray) -> FloatArray:
        """Return the change of the deviance by each of the possible noises, shape (m,)."""
        frames = residuals[: self.along.size].reshape(self.along.shape)
        along2 = np.einsum("fc,fc->f", self.along, frames) ** 2
        return np.asarray(np.log(self.factors).sum(axis=1) + (1 / self.factors - 1) @ along2)

    def bic(self, joint: JointFit) -> float:
        """Return the Bayesian information criterion, without the constant of the common noise."""
        independent = self.data.independent_data(joint.weights)
        deviance = self.deviance(joint.least_squares.residuals)
        return deviance + joint.n_parameters * float(np.log(independent))

    @property
    def is_known(self) -> bool:
        """True if the noise was given."""
        return self.data.series.sigma_given and len(self.factors) == 1


#: Correlations of neighbouring values that are weighed, and the prior probability of none: who
#: gives the flicker has measured it, and would have seen how a steady light drifts.
CORRELATIONS = np.array([0.0, 0.4, 0.65, 0.8, 0.92, 0.97])
PRIOR_OF_NONE, PRIOR_OF_NONE_IF_GIVEN = 0.8, 0.95
#: Factor by which the data raise the odds of a correlation from which a warning says so:
#: substantial evidence on the scale of H. Jeffreys, Theory of Probability, 1961. Of 1200 series
#: with independent noise five have it.
TOLD = 5.0
#: Factors c that are weighed: noise that correlates is larger than its scatter about a curve that
#: follows it. The flicker c ρ has half a Student's t distribution with 3 degrees of freedom before
#: the data; half a Cauchy distribution, as for the independent flicker, has no mean square.
FACTORS = np.geomspace(0.5, 4.0, 7)
#: Values below which no correlation is told, and number of first values that tell it.
MIN_VALUES, MAX_VALUES = 12, 100
#: Diagonal of a triangular factor that stands for 0, and variance that is always independent.
TINY, INDEPENDENT = 1e-300, 1e-6
#: Least estimate: a flicker that drifts with the decay leaves hardly any scatter about a curve.
MIN_FLICKER = 0.002
#: Number of σ, the probability beyond which is that of a normal distribution, and steps of a search
#: by halves.
TAIL_SIGMAS, BISECTIONS = 3.0, 20
#: Part of a variance, below which what is added to it does not matter.
MIN_ADDED = 1e-3
#: Mean part of the variance from which it matters whether it correlates.
MIN_FRACTION = 0.1


@dataclass(frozen=True)
class _Part:
    """Part of the noise that may correlate.

    `size` is its σ where it correlates, `found` that of its scatter, where it does not, and `rest`
    the variance of the other noise, in units of all noise, shape (n,); `factors` are the c that are
    weighed, and `log_prior` their prior log probability, shape (m,).
    """

    size: FloatArray
    found: FloatArray
    rest: FloatArray
    factors: FloatArray
    log_prior: FloatArray

    def covariances(self, n_values: int) -> FloatArray:
        """Return V of the first values for every φ and c, shape (k, m, n, n)."""
        frames = np.arange(n_values)
        distance = np.abs(np.subtract.outer(frames, frames))
        sizes = np.where(CORRELATIONS[:, None] > 0, self.size, self.found)[:, :n_values]
        powers = np.power(CORRELATIONS[:, None], frames)[:, distance]
        powers = powers * sizes[:, :, None] * sizes[:, None]
        scaled = self.factors[None, :, None, None] ** 2 * powers[:, None]
        return np.asarray(scaled + np.diag(self.rest[:n_values] + INDEPENDENT))

    def effects_of(self, effect: FloatArray) -> FloatArray:
        """Return A V Aᵀ of A (p, n): of the other noise, and of every φ > 0 with c = 1."""
        sized = effect * self.size
        correlated = [sized @ _correlated(phi, sized.T) for phi in CORRELATIONS[1:]]
        return np.stack([(effect * self.rest) @ effect.T, *correlated])


def _correlated(phi: float, columns: FloatArray) -> FloatArray:
    """Return φ^|f − g| (n, n) times columns (n, p), by its inverse, which has three diagonals."""
    bands = np.empty((2, len(columns)))
    bands[0], bands[1] = -phi, 1 + phi**2
    bands[1, [0, -1]] = 1.0
    return np.asarray(solveh_banded(bands / (1 - phi**2), columns))


@dataclass(frozen=True)
class _Deviations:
    """Deviations of the frames from a fit, and its Jacobian, along the signal; in units of noise.

    `brightness` is the signal of the frames that have one, `deviation` what lies above the fit,
    shape (n,), and `jacobian` that of all fitted parameters, shape (n, p).
    """

    brightness: FloatArray
    deviation: FloatArray
    jacobian: FloatArray

    @classmethod
    def of(cls, data: WhitenedSeries, joint: JointFit, signal: FloatArray) -> "_Deviations":
        """Return them for a fit and its signal without offsets (n, C)."""
        along = np.einsum("fcd,fd->fc", data.matrices, signal)
        brightness = np.linalg.norm(along, axis=1)
        used = brightness > 0
        direction = along[used] / brightness[used, None]
        solution, shape = joint.least_squares, data.values.shape
        residuals = solution.residuals[: data.values.size].reshape(shape)[used]
        jacobian = solution.jacobian[: data.values.size].reshape(*shape, -1)[used]
        return cls(
            brightness[used],
            -np.einsum("fc,fc->f", direction, residuals),
            np.einsum("fc,fcp->fp", direction, jacobian),
        )

    def parts(self, data: WhitenedSeries, noise: Envelope, n_parameters: int) -> dict[str, _Part]:
        """Return what of the noise may correlate, by its name, about a fit of `n_parameters`."""
        n_free = max(len(self.deviation) - n_parameters, 1)
        # The scatter of a σ that is too large is smaller, which is no correlation.
        scatter = float(np.linalg.norm(self.deviation)) / n_free**0.5
        return _parts(data, noise, self.brightness, scatter)


@dataclass(frozen=True)
class NoiseCorrelation:
    """Correlation of neighbouring values' noise.

    Attributes
    ----------
    evidence
        Factor by which the data raise the odds that there is one.
    correlation
        Its mean if there is one.
    factor
        Factor by which the largest σ of a rate of the fit that told it grows with it; 1 where it is
        not told.
    noise
        The flicker.
    probabilities
        Probability of all φ > 0 and c, shape (k − 1, m), by the name of the part of the noise
        that may correlate.
    """

    evidence: float
    correlation: float
    factor: float
    noise: Envelope
    probabilities: dict[str, FloatArray]

    @property
    def is_reported(self) -> bool:
        """Whether the data tell it clearly."""
        return self.evidence > TOLD

    def added_covariance(
        self, data: WhitenedSeries, joint: JointFit, signal: FloatArray
    ) -> FloatArray:
        """Return its part in the covariance (p, p) of a fit's parameters.

        The first arguments of `noise_correlation`, of any fit to the series.
        """
        solution = joint.least_squares
        if not np.isfinite(solution.covariance).all():
            return np.zeros_like(solution.covariance)
        left = _Deviations.of(data, joint, signal)
        effect = solution.covariance @ left.jacobian.T
        parts = left.parts(data, self.noise, len(_kept(data, joint)))
        probability = sum(float(each.sum()) for each in self.probabilities.values())
        added = -probability * (effect @ effect.T)
        typical = np.diag(added).copy()
        for name, probabilities in self.probabilities.items():
            part, total = parts[name], probabilities.sum(axis=1)
            rest, *correlated = part.effects_of(effect)
            mean_square = probabilities @ part.factors**2
            added += float(total.sum()) * rest + np.tensordot(mean_square, correlated, 1)
            log_square = probabilities @ np.log(part.factors**2) / np.maximum(total, TINY)
            usual = float(total.sum()) * rest
            usual += np.tensordot(total * np.exp(log_square), correlated, 1)
            typical += np.diag(usual)
        added = _positive(added, solution.covariance)
        own = np.diag(solution.covariance)
        factors = _tail_factors(own, np.diag(added), typical, probability)
        return np.asarray(factors.max(initial=1.0) * added)


def noise_correlation(
    data: WhitenedSeries, joint: JointFit, signal: FloatArray, rates: slice, noise: Envelope
) -> NoiseCorrelation | None:
    """Return how the noise correlates; None if no part of it may, or if too few values tell.

    Parameters
    ----------
    data
        The series in units of its noise, flicker included.
    joint
        A fit that describes it, at its minimum.
    signal
        What it says without offsets, shape (n, C).
    rates
        Places of its rates among the parameters.
    noise
        The flicker.
    """
    solution = joint.least_squares
    if not (
        np.isfinite(solution.covariance).all()
        and len(data.series.repeats) == 1
        and noise.shapes.size
    ):
        return None
    left = _Deviations.of(data, joint, signal)
    if len(left.deviation) < MIN_VALUES:
        return None
    kept = _kept(data, joint)
    n_values = data.values.size
    known = np.column_stack([solution.jacobian[n_values:, kept], -solution.residuals[n_values:]])
    parts = {
        name: part
        for name, part in left.parts(data, noise, len(kept)).items()
        if (part.size**2).mean() > MIN_FRACTION
    }
    if not parts or _ends_below_zero(left.deviation + left.brightness):
        return None
    told = slice(0, MAX_VALUES)
    deviation, design = left.deviation[told], left.jacobian[told][:, kept]
    log_posteriors = {
        name: _log_restricted_likelihoods(
            deviation, design, known, part.covariances(len(deviation))
        )
        + part.log_prior
        for name, part in parts.items()
    }
    priors = _priors(noise)
    highest = max(float(each.max()) for each in log_posteriors.values())
    posteriors = {
        name: np.exp(each - highest) * priors[:, None] for name, each in log_posteriors.items()
    }
    total = sum(float(each.sum()) for each in posteriors.values())
    none = sum(float(each[0].sum()) for each in posteriors.values()) / total
    correlated = {name: each[1:] / total for name, each in posteriors.items()}
    found = NoiseCorrelation(
        evidence=(1 - none) / max(none, TINY) * priors[0] / (1 - priors[0]),
        correlation=sum(float(each.sum(axis=1) @ CORRELATIONS[1:]) for each in correlated.values())
        / max(1 - none, TINY),
        factor=1.0,
        noise=noise,
        probabilities=correlated,
    )
    if not found.is_reported:
        return found
    independent = np.diag(solution.covariance)[rates]
    added = np.diag(found.added_covariance(data, joint, signal))[rates]
    ratio = added / np.where(independent > 0, independent, np.inf)
    return replace(found, factor=float(np.sqrt(1 + ratio.max(initial=0.0))))


def _kept(data: WhitenedSeries, joint: JointFit) -> list[int]:
    """Return the places of the parameters that the signal along time depends on."""
    return [*range(len(joint.shape)), *range(-len(data.series.fitted_offsets), 0)]


def _ends_below_zero(signal: FloatArray) -> bool:
    """Whether the last quarter of a signal in σ (n,) is below zero: no curve follows it there."""
    last = signal[-max(len(signal) // 4, 1) :]
    return bool(last.sum() < -BELOW_ZERO_SIGMAS * np.sqrt(len(last)))


def _parts(
    data: WhitenedSeries, noise: Envelope, brightness: FloatArray, scatter: float
) -> dict[str, _Part]:
    """Return what may correlate, by name: the flicker, and all noise of a single channel.

    Photons and readings of a camera's channels are independent from frame to frame; what the σ of
    another instrument's table consists of is not known.
    """
    parts = {}
    if not noise.is_given or noise.flicker > 0:
        # A flicker that was given may be wrong, too: a scatter that is small is no long memory.
        flicker = max(noise.flicker, MIN_FLICKER)
        size = flicker * brightness
        log_prior = -2 * np.log1p((flicker * FACTORS / USUAL_FLICKER) ** 2)
        rest = np.maximum(1 - (noise.flicker * brightness) ** 2, 0.0)
        # That there is none is judged by the scatter: one of the least size would be disproved
        # where that is less, and so pass for one that drifts with the decay.
        found = noise.flicker * brightness
        parts["flicker"] = _Part(size, found, rest, FACTORS, log_prior - np.log(len(FACTORS)))
    if len(data.series.channels) == 1:
        ones = np.ones_like(brightness)
        log_prior = np.full_like(FACTORS, -np.log(len(FACTORS)))
        parts["all"] = _Part(ones, ones, np.zeros_like(ones), scatter * FACTORS, log_prior)
    return parts


def _log_restricted_likelihoods(
    deviation: FloatArray, design: FloatArray, known: FloatArray, covariances: FloatArray
) -> FloatArray:
    """Return the log likelihood of what a linear model (n, q) leaves of the deviations (n,).

    `known` are rows (p, q + 1) of design and deviation with independent noise of variance 1. The
    result is (k, m) for covariances (k, m, n, n).
    """
    choleskys = np.linalg.cholesky(covariances)
    rows = np.linalg.solve(choleskys, np.column_stack([design, deviation]))
    known = np.broadcast_to(known, (*rows.shape[:-2], *known.shape))
    triangles = np.linalg.qr(np.concatenate([rows, known], axis=-2), mode="r")
    # The diagonal is log|V⁻¹ᐟ² X| and, last, the norm of the residual.
    diagonal = np.abs(np.diagonal(triangles, axis1=-2, axis2=-1))
    volumes = np.log(np.diagonal(choleskys, axis1=-2, axis2=-1)).sum(axis=-1)
    volumes += np.log(np.maximum(diagonal[..., :-1], TINY)).sum(axis=-1)
    return np.asarray(-volumes - diagonal[..., -1] ** 2 / 2)


def _tail_factors(
    own: FloatArray, added: FloatArray, typical: FloatArray, probability: float
) -> FloatArray:
    """Return factors of an added variance with which 3 σ have their probability, (q,).

    Parameters
    ----------
    own, added
        Variance of the parameters by independent noise, and what is added to it in the mean, (p,).
    typical
        What a correlated noise of the usual size adds, times its probability, (p,).
    probability
        Probability that the noise correlates.
    """
    changed = (own > 0) & (added > MIN_ADDED * own) & (typical > MIN_ADDED * own)
    if not changed.any():
        return np.ones(0)
    own, added, typical = own[changed], added[changed], typical[changed]
    low, high = np.sqrt(own), np.sqrt(own + typical / probability)
    sigma, weights = np.stack([low, high]), np.array([1 - probability, probability])
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_short = weights @ ndtr(-TAIL_SIGMAS * middle / sigma) > ndtr(-TAIL_SIGMAS)
        low, high = np.where(is_short, middle, low), np.where(is_short, high, middle)
    return np.asarray((low**2 - own) / added)


def _positive(added: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return a covariance (p, p) that is added to another one, its negative part left out."""
    scale = np.sqrt(np.maximum(np.diag(covariance), TINY))
    values, vectors = np.linalg.eigh(added / np.outer(scale, scale))
    vectors = vectors * scale[:, None]
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _priors(noise: Envelope) -> FloatArray:
    """Return the prior probability of every correlation, shape (k,)."""
    reference = (1 - CORRELATIONS[1:] ** 2) ** -0.5
    of_none = PRIOR_OF_NONE_IF_GIVEN if noise.is_given else PRIOR_OF_NONE
    return np.append(of_none, (1 - of_none) * reference / reference.sum())
