"""Noise that correlates from value to value, as that of a lamp or a room that drifts does.

Neighbouring values then err together, and what a sum of exponentials averages over is less than it
seems. In units of their σ, the values deviate from the fit with the covariance
V = D + c² S φ^|f − g| S: S is the part of σ that is flicker, or all of it, and D the independent
rest. The restricted likelihood (D. Harville, J. Am. Stat. Assoc. 72, 1977) allows for what the fit
took of the deviations, and weighs all φ and c. That there is no correlation is six times as
probable before the data as all φ > 0 together, since the flicker of shutter and aperture has none;
these have the reference prior (1 − φ²)^(−1/2) (J. O. Berger, R.-Y. Yang, Econometric Theory 10,
1994). The fit, whose weights are those of independent values, has the covariance A V Aᵀ with
A = (JᵀJ)⁻¹Jᵀ, and V is the mean over all φ and c, none included (model averaging; J. Hoeting et
al., Statistical Science 14, 1999). A threshold would do worse: some dozens of values hardly tell a
memory of one or two frames, which makes σ too small by a third, and σ would jump at it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from labrig.fit.decay.diagnostics import BELOW_ZERO_SIGMAS
from labrig.fit.decay.envelope import USUAL_FLICKER, Envelope
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray

#: Correlations of neighbouring values that are weighed, and the prior probability of none.
CORRELATIONS = np.array([0.0, 0.4, 0.65, 0.8, 0.92, 0.97])
PRIOR_OF_NONE = 0.85
#: Factor by which the data raise the odds of a correlation from which a warning says so: strong
#: evidence on the scale of H. Jeffreys, Theory of Probability, 1961. Of 720 series with independent
#: noise one has it.
TOLD = 10.0
#: Factors c that are weighed: noise that correlates is larger than its scatter about a curve that
#: follows it. The flicker c ρ has half a Student's t distribution with 3 degrees of freedom before
#: the data; half a Cauchy distribution, as for the independent flicker, has no mean square.
FACTORS = np.geomspace(0.5, 4.0, 7)
#: Values below which no correlation is told, and number of first values that tell it.
FEWEST_VALUES, MOST_VALUES = 12, 100
#: Diagonal of a triangular factor that stands for 0, and variance that is always independent.
TINY, INDEPENDENT = 1e-300, 1e-6
#: Least estimate: a flicker that drifts with the decay leaves hardly any scatter about a curve.
LEAST_FLICKER = 0.002
#: Mean fraction of the variance from which flicker matters.
LEAST_FRACTION = 0.1


@dataclass(frozen=True)
class NoiseCorrelation:
    """Correlation of neighbouring values' noise, and what it does to the fit.

    Attributes
    ----------
    evidence
        Factor by which the data raise the odds that there is one.
    correlation
        Its mean if there is one.
    covariance
        Its part in the covariance of the fitted parameters, shape (p, p).
    factor
        Factor by which the largest σ of a rate grows with it.
    """

    evidence: float
    correlation: float
    covariance: FloatArray
    factor: float

    @property
    def is_told(self) -> bool:
        """Whether the data tell it clearly."""
        return self.evidence > TOLD


@dataclass(frozen=True)
class _Part:
    """Part of the noise that may correlate.

    `size` is its σ and `rest` the variance of the other noise, in units of all noise, shape (n,);
    `factors` are the c that are weighed, and `log_prior` their prior log probability, shape (m,).
    """

    size: FloatArray
    rest: FloatArray
    factors: FloatArray
    log_prior: FloatArray

    def covariances(self, n_values: int) -> FloatArray:
        """Return V of the first values for every φ and c, shape (k, m, n, n)."""
        frames = np.arange(n_values)
        distance = np.abs(np.subtract.outer(frames, frames))
        size = self.size[:n_values]
        powers = np.power(CORRELATIONS[:, None], frames)[:, distance] * np.outer(size, size)
        scaled = self.factors[None, :, None, None] ** 2 * powers[:, None]
        return np.asarray(scaled + np.diag(self.rest[:n_values] + INDEPENDENT))

    def effect_of(self, effect: FloatArray, weights: FloatArray) -> FloatArray:
        """Return A V Aᵀ (p, p) of A (p, n), summed with weights of all φ > 0 and c (k − 1, m)."""
        total = float(weights.sum()) * (effect * self.rest) @ effect.T
        sized = effect * self.size
        for phi, weight in zip(CORRELATIONS[1:], weights @ self.factors**2, strict=True):
            total += weight * sized @ _correlated(phi, sized.T)
        return np.asarray(total)


def _correlated(phi: float, columns: FloatArray) -> FloatArray:
    """Return φ^|f − g| (n, n) times columns (n, p), by its inverse, which has three diagonals."""
    bands = np.empty((2, len(columns)))
    bands[0], bands[1] = -phi, 1 + phi**2
    bands[1, [0, -1]] = 1.0
    return np.asarray(solveh_banded(bands / (1 - phi**2), columns))


def noise_correlation(
    data: WhitenedSeries, fit: StatesFit, noise: Envelope
) -> NoiseCorrelation | None:
    """Return how the noise correlates; None if no part of it may, or if too few values tell.

    Parameters
    ----------
    data
        The series in units of its noise, flicker included.
    fit
        The fit at its minimum.
    noise
        The flicker.
    """
    series, solution = data.series, fit.joint.least_squares
    along = np.einsum("fcd,fd->fc", data.matrices, fit.signal(series))
    brightness = np.linalg.norm(along, axis=1)
    used = brightness > 0
    if not (
        np.isfinite(solution.covariance).all()
        and used.sum() >= FEWEST_VALUES
        and len(series.repeats) == 1
        and noise.shapes.size
    ):
        return None
    direction = along[used] / brightness[used, None]
    deviation, jacobian = _along(direction, used, data, fit)
    kept = [*range(len(fit.joint.shape)), *range(-len(series.fitted_offsets), 0)]
    design = jacobian[:, kept]
    n_values = data.values.size
    known = np.column_stack([solution.jacobian[n_values:, kept], -solution.residuals[n_values:]])
    # The scatter of a σ that is too large is smaller, which is no correlation.
    scatter = float(np.linalg.norm(deviation)) / max(len(deviation) - design.shape[1], 1) ** 0.5
    parts = _parts(data, noise, brightness[used], scatter)
    if not parts or _ends_below_zero(deviation + brightness[used]):
        return None
    told = slice(0, MOST_VALUES)
    n_told = len(deviation[told])
    log_posteriors = [
        _log_restricted_likelihoods(deviation[told], design[told], known, part.covariances(n_told))
        + part.log_prior
        for part in parts
    ]
    priors = _priors()
    highest = max(float(each.max()) for each in log_posteriors)
    posteriors = [np.exp(each - highest) * priors[:, None] for each in log_posteriors]
    total = sum(float(each.sum()) for each in posteriors)
    none = sum(float(each[0].sum()) for each in posteriors) / total
    correlated = [each[1:] / total for each in posteriors]
    effect = solution.covariance @ jacobian.T
    added = -(1 - none) * (effect @ effect.T)
    for weights, part in zip(correlated, parts, strict=True):
        added += part.effect_of(effect, weights)
    covariance = _positive(added, solution.covariance)
    rates = slice(0, 2 * fit.n_free, 2)
    independent = np.diag(solution.covariance)[rates]
    ratio = np.diag(covariance)[rates] / np.where(independent > 0, independent, np.inf)
    return NoiseCorrelation(
        evidence=(1 - none) / max(none, TINY) * priors[0] / (1 - priors[0]),
        correlation=sum(float(each.sum(axis=1) @ CORRELATIONS[1:]) for each in correlated)
        / max(1 - none, TINY),
        covariance=covariance,
        factor=float(np.sqrt(1 + ratio.max(initial=0.0))),
    )


def _ends_below_zero(signal: FloatArray) -> bool:
    """Whether the last quarter of a signal in σ (n,) is below zero: no curve follows it there."""
    last = signal[-max(len(signal) // 4, 1) :]
    return bool(last.sum() < -BELOW_ZERO_SIGMAS * np.sqrt(len(last)))


def _parts(
    data: WhitenedSeries, noise: Envelope, brightness: FloatArray, scatter: float
) -> list[_Part]:
    """Return what may correlate: the flicker, and all noise of a single channel.

    Photons and readings of a camera's channels are independent from frame to frame; what the σ of
    another instrument's table consists of is not known.
    """
    parts = []
    if len(noise.likely_flickers) > 1 or noise.flicker > 0:
        # A flicker that was given may be wrong, too: a scatter that is small is no long memory.
        flicker = max(noise.flicker, LEAST_FLICKER)
        size = flicker * brightness
        log_prior = -2 * np.log1p((flicker * FACTORS / USUAL_FLICKER) ** 2)
        if (size**2).mean() > LEAST_FRACTION:
            rest = np.maximum(1 - (noise.flicker * brightness) ** 2, 0.0)
            parts.append(_Part(size, rest, FACTORS, log_prior - np.log(len(FACTORS))))
    if len(data.series.channels) == 1:
        ones = np.ones_like(brightness)
        log_prior = np.full_like(FACTORS, -np.log(len(FACTORS)))
        parts.append(_Part(ones, np.zeros_like(ones), scatter * FACTORS, log_prior))
    return parts


def _along(
    direction: FloatArray, used: FloatArray, data: WhitenedSeries, fit: StatesFit
) -> tuple[FloatArray, FloatArray]:
    """Return deviations from the fit (n,) and its Jacobian (n, p) along the signal (n, C)."""
    solution, shape = fit.joint.least_squares, data.values.shape
    residuals = solution.residuals[: data.values.size].reshape(shape)[used]
    jacobian = solution.jacobian[: data.values.size].reshape(*shape, -1)[used]
    return (
        -np.einsum("fc,fc->f", direction, residuals),
        np.einsum("fc,fcp->fp", direction, jacobian),
    )


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


def _positive(added: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return a covariance (p, p) that is added to another one, its negative part left out."""
    scale = np.sqrt(np.maximum(np.diag(covariance), TINY))
    values, vectors = np.linalg.eigh(added / np.outer(scale, scale))
    vectors = vectors * scale[:, None]
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _priors() -> FloatArray:
    """Return the prior probability of every correlation, shape (k,)."""
    reference = (1 - CORRELATIONS[1:] ** 2) ** -0.5
    return np.append(PRIOR_OF_NONE, (1 - PRIOR_OF_NONE) * reference / reference.sum())
