"""Which lines stand on a smooth spectrum: hypotheses, drawn by their probability given the values.

A hypothesis is a weight of the smoothness prior and any number of narrow features, each a line or a
pair of lines too close to be told apart. Their powers and the smooth spectrum are normal given a
hypothesis, so that they are integrated out exactly (x ≥ 0 ignored) and what remains is the evidence
of the hypothesis. Features come and go and move by reversible jumps (P. J. Green, *Reversible jump
Markov chain Monte Carlo computation and Bayesian model determination*, Biometrika 82, 1995; birth
and death of a Poisson process: C. J. Geyer, J. Møller, *Simulation procedures and likelihood
inference for spatial point processes*, Scand. J. Stat. 21, 1994).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import LinAlgError, lapack, solve_triangular
from scipy.special import log_ndtr, logsumexp

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum.line import FWHM_OVER_SIGMA, line_at_knots

#: Prior of a feature's full width at half maximum in nm: even in its logarithm. Wider ones are left
#: to the smooth spectrum, which resolves them.
FWHM_NM = (2.0, 25.0)
#: Prior probability that a feature is one line, not two.
SINGLE = 0.5
#: Least share of the weaker of two lines.
WEAKEST = 0.05
#: Prior expectation of the number of features.
EXPECTED = 0.1
MAX_FEATURES = 16
#: Probability of any line at all below which there are none.
NEGLIGIBLE = 0.01
#: Distance of the tried wavelengths and of the knots of lines, per distance of the knots.
TRIED, FINER = 0.5, 0.25
TRIED_FWHM_NM = (3.0, 8.0, 14.0, 22.0)
#: Steps of the chain for each step that is kept, and those between two features of the start.
THINNING, SETTLING = 20, 120
#: Steps after which another weight is drawn.
WEIGHING = 10
#: Largest steps of a feature's wavelength in nm and of the logarithm of its width; most are smaller.
STEP_NM, STEP_LOG = 5.0, 1.0
SMALLER = 2.5


@dataclass(frozen=True)
class Feature:
    """One line or two, each a Gaussian, by their common mean and width.

    Attributes
    ----------
    wavelength_nm, width_nm
        Mean and standard deviation of the feature's light in nm.
    apart
        Fraction of the variance that is the distance of two lines; 0 for a single one.
    share
        Fraction of the light in the line of longer wavelength.
    """

    wavelength_nm: float
    width_nm: float
    apart: float = 0.0
    share: float = 0.5

    def at_knots(self, knots_nm: FloatArray) -> FloatArray:
        """Return the values (n,) of the feature of integral 1 at evenly spaced knots."""
        fwhm_nm = FWHM_OVER_SIGMA * self.width_nm * np.sqrt(1 - self.apart)
        if self.apart == 0:
            return line_at_knots(knots_nm, self.wavelength_nm, fwhm_nm)
        distance_nm = self.width_nm * np.sqrt(self.apart / (self.share * (1 - self.share)))
        upper = line_at_knots(knots_nm, self.wavelength_nm + (1 - self.share) * distance_nm, fwhm_nm)
        lower = line_at_knots(knots_nm, self.wavelength_nm - self.share * distance_nm, fwhm_nm)
        both: FloatArray = self.share * upper + (1 - self.share) * lower
        return both


def finer_knots(knots_nm: FloatArray) -> FloatArray:
    """Return the knots on which lines are represented."""
    count = round((len(knots_nm) - 1) / FINER) + 1
    return np.linspace(knots_nm[0], knots_nm[-1], count)


def finer_design(design: FloatArray, knots_nm: FloatArray) -> FloatArray:
    """Return the design on `finer_knots`, from that on even knots h apart.

    A column is ∫ A hat dλ = h (A + h² A″/12 + …), A the response per nm, which varies slowly.
    """
    fine = finer_knots(knots_nm)
    h, step = float(knots_nm[1] - knots_nm[0]), float(fine[1] - fine[0])
    whole = design / h
    whole[:, [0, -1]] *= 2
    spline = CubicSpline(knots_nm, whole, axis=1)
    result: FloatArray = step * (spline(fine) - (h**2 - step**2) / 12 * spline(fine, 2))
    return result


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A weight of the smoothness prior, by its index, and the features."""

    weight: int
    features: tuple[Feature, ...]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Log evidence of hypotheses given values.

    Attributes
    ----------
    target, fine_design
        Whitened values (m,) and their design (m, q) for `fine_nm`.
    fine_nm
        Knots of lines, shape (q,).
    smooth
        For every weight, the whitened design of the smooth spectrum in units of its posterior,
        shape (weights, n, m).
    log_smooth
        Log evidence of every weight without features, shape (weights,).
    power
        Prior σ of a feature's power.
    """

    target: FloatArray
    fine_design: FloatArray
    fine_nm: FloatArray
    smooth: FloatArray
    along: FloatArray
    log_smooth: FloatArray
    power: float

    def columns(self, features: Sequence[Feature]) -> FloatArray:
        """Return the whitened values (k, m) of features of power 1."""
        rows = [self.fine_design @ one.at_knots(self.fine_nm) for one in features]
        return np.array(rows).reshape(-1, len(self.target))

    def log_evidence(self, columns: FloatArray, weight: int) -> float:
        """Return the log evidence of a weight with features of the given values."""
        return float(self.log_smooth[weight] + self._gain(columns, weight))

    def log_evidence_of_weights(self, columns: FloatArray) -> FloatArray:
        """Return the log evidence of all weights with features of the given values."""
        if not len(columns):
            return self.log_smooth
        outside = columns @ self.smooth.swapaxes(1, 2)
        information = columns @ columns.T - outside @ outside.swapaxes(1, 2)
        information += np.eye(len(columns)) / self.power**2
        linear = columns @ self.target - np.einsum("wkn,wn->wk", outside, self.along)
        inverse = np.linalg.inv(np.linalg.cholesky(information))
        whitened = np.einsum("wij,wj->wi", inverse, linear)
        mean = np.einsum("wij,wi->wj", inverse, whitened)
        sigma = np.sqrt((inverse**2).sum(axis=1))
        occam = np.log(np.einsum("wii->wi", inverse) / self.power) + np.log(2)
        gain = (whitened**2 / 2 + occam + log_ndtr(mean / sigma)).sum(axis=1)
        return self.log_smooth + gain

    def _gain(self, columns: FloatArray, weight: int) -> float:
        if not len(columns):
            return 0.0
        outside = columns @ self.smooth[weight].T
        information = columns @ columns.T - outside @ outside.T
        information.flat[:: len(columns) + 1] += self.power**-2
        linear = columns @ self.target - outside @ self.along[weight]
        # SciPy's and NumPy's own functions take ten times as long to call as to run.
        lower, info = lapack.dpotrf(information, lower=1)
        if info:
            raise LinAlgError("expected a positive definite matrix")
        inverse, _ = lapack.dtrtri(lower, lower=1)
        whitened = inverse @ linear
        z = (whitened @ inverse) / np.sqrt((inverse**2).sum(axis=0))
        occam = np.log(inverse.diagonal() / self.power * 2).sum()
        return float(whitened @ whitened / 2 + occam + log_ndtr(z).sum())

    @cached_property
    def tried(self) -> tuple[list[Feature], FloatArray]:
        """Features on a grid, and their whitened values."""
        low, high = self.range_nm
        step = TRIED * (self.fine_nm[1] - self.fine_nm[0]) / FINER
        grid_nm = np.arange(low, high, step)
        features = [
            Feature(float(nm), fwhm / FWHM_OVER_SIGMA) for fwhm in TRIED_FWHM_NM for nm in grid_nm
        ]
        return features, self.columns(features)

    @property
    def range_nm(self) -> tuple[float, float]:
        """Least and largest wavelength of a feature."""
        margin = (self.fine_nm[1] - self.fine_nm[0]) / FINER
        return float(self.fine_nm[0] + margin), float(self.fine_nm[-1] - margin)

    def gains(self, columns: FloatArray) -> FloatArray:
        """Return the log evidence of each weight with each tried feature besides given ones."""
        tried = self.tried[1]
        result = np.empty((len(self.smooth), len(tried)))
        direct, known, mixed = tried @ self.target, columns @ self.target, tried @ columns.T
        for number, smooth in enumerate(self.smooth):
            seen, along = tried @ smooth.T, self.along[number]
            norm2 = np.einsum("ij,ij->i", tried, tried) - np.einsum("ij,ij->i", seen, seen)
            norm2 += self.power**-2
            linear = direct - seen @ along
            if len(columns):
                outside = columns @ smooth.T
                information = columns @ columns.T - outside @ outside.T
                information[np.diag_indices_from(information)] += self.power**-2
                lower = np.linalg.cholesky(information)
                cross = np.linalg.solve(lower, (mixed - seen @ outside.T).T)
                norm2 = norm2 - np.einsum("ij,ij->j", cross, cross)
                linear = linear - cross.T @ np.linalg.solve(lower, known - outside @ along)
            norm2 = np.maximum(norm2, self.power**-2)
            sigmas = linear / np.sqrt(norm2)
            result[number] = (
                sigmas**2 / 2 - np.log(norm2 * self.power**2) / 2 + np.log(2) + log_ndtr(sigmas)
            )
        return result + self.log_evidence_of_weights(columns)[:, np.newaxis]

    def lines_are_possible(self) -> bool:
        """Return whether one feature is as probable as `NEGLIGIBLE` or more."""
        with_one = self.gains(self.columns(()))
        log_odds = (
            logsumexp(with_one) - np.log(with_one.shape[1]) + np.log(EXPECTED)
            - logsumexp(self.log_smooth)
        )  # fmt: skip
        return bool(log_odds > np.log(NEGLIGIBLE))


@dataclass(eq=False)
class Chain:
    """A Markov chain of hypotheses."""

    evidence: Evidence
    rng: np.random.Generator
    weight: int = 0
    features: list[Feature] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._see(self.features)
        self._weigh()

    def _see(self, features: Sequence[Feature]) -> None:
        self.features = list(features)
        self._columns = self.evidence.columns(features)
        self._log = self.evidence.log_evidence(self._columns, self.weight)

    def _weigh(self) -> None:
        log = self.evidence.log_evidence_of_weights(self._columns)
        probability = np.exp(log - log.max())
        self.weight = int(self.rng.choice(len(log), p=probability / probability.sum()))
        self._log = float(log[self.weight])

    def settle(self) -> None:
        """Add features one by one as long as the next makes the values more probable."""
        self._walk(SETTLING if self.features else 0)
        while len(self.features) < MAX_FEATURES:
            gains = self.evidence.gains(self._columns)
            best = np.unravel_index(int(np.argmax(gains)), gains.shape)
            added = gains.max() + np.log(EXPECTED) + logsumexp(gains - gains.max()) - np.log(gains.shape[1])
            if added < self._log_all():
                break
            self.weight = int(best[0])
            self._see([*self.features, self.evidence.tried[0][best[1]]])
            self._walk(SETTLING)

    def _log_all(self) -> float:
        return float(logsumexp(self.evidence.log_evidence_of_weights(self._columns)))

    def _walk(self, steps: int) -> None:
        for number in range(steps):
            self._move()
            if number % WEIGHING == 0:
                self._weigh()

    def draw(self, count: int) -> list[Hypothesis]:
        """Return hypotheses of the chain."""
        drawn = []
        for _ in range(count):
            for _ in range(THINNING):
                self._step()
            self._weigh()
            drawn.append(Hypothesis(self.weight, tuple(self.features)))
        return drawn

    def _step(self) -> None:
        kind = self.rng.random()
        if kind < 0.1:
            self._birth()
        elif kind < 0.2:
            self._death()
        elif kind < 0.35:
            self._pair()
        else:
            self._move()

    def _accept(self, columns: FloatArray, log_ratio: float) -> bool:
        log = self.evidence.log_evidence(columns, self.weight)
        if np.log(self.rng.random()) < log - self._log + log_ratio:
            self._columns, self._log = columns, log
            return True
        return False

    def _birth(self) -> None:
        if len(self.features) >= MAX_FEATURES:
            return
        new = self._any_feature()
        columns = np.vstack([self._columns, self.evidence.columns([new])])
        if self._accept(columns, np.log(EXPECTED / (len(self.features) + 1))):
            self.features.append(new)

    def _death(self) -> None:
        if not self.features:
            return
        chosen = int(self.rng.integers(len(self.features)))
        columns = np.delete(self._columns, chosen, axis=0)
        if self._accept(columns, np.log(len(self.features) / EXPECTED)):
            del self.features[chosen]

    def _any_feature(self) -> Feature:
        low, high = np.log(np.array(FWHM_NM) / FWHM_OVER_SIGMA)
        return self._any_pair(
            Feature(
                float(self.rng.uniform(*self.evidence.range_nm)),
                float(np.exp(self.rng.uniform(low, high))),
            )
        )

    def _any_pair(self, one: Feature) -> Feature:
        if self.rng.random() < SINGLE:
            return replace(one, apart=0.0, share=0.5)
        apart, share = float(self.rng.random()), float(self.rng.uniform(WEAKEST, 1 - WEAKEST))
        return replace(one, apart=apart, share=share)

    def _pair(self) -> None:
        if self.features:
            chosen = int(self.rng.integers(len(self.features)))
            self._replace(chosen, self._any_pair(self.features[chosen]))

    def _move(self) -> None:
        if not self.features:
            return
        chosen = int(self.rng.integers(len(self.features)))
        one = self.features[chosen]
        size = 10 ** -self.rng.uniform(0, SMALLER)
        step = size * self.rng.standard_normal(4)
        moved = Feature(
            one.wavelength_nm + STEP_NM * step[0],
            one.width_nm * np.exp(STEP_LOG * step[1]),
            one.apart + step[2] if one.apart else 0.0,
            one.share + step[3] if one.apart else 0.5,
        )
        self._replace(chosen, moved)

    def _replace(self, chosen: int, new: Feature) -> None:
        low, high = self.evidence.range_nm
        narrow, wide = np.array(FWHM_NM) / FWHM_OVER_SIGMA
        if not (
            low < new.wavelength_nm < high
            and narrow < new.width_nm < wide
            and 0 <= new.apart < 1
            and WEAKEST < new.share < 1 - WEAKEST
        ):
            return
        columns = self._columns.copy()
        columns[chosen] = self.evidence.columns([new])[0]
        if self._accept(columns, 0.0):
            self.features[chosen] = new


def evidence_of(
    design: FloatArray,
    target: FloatArray,
    fine_design: FloatArray,
    fine_nm: FloatArray,
    prior: FloatArray,
    ridge: FloatArray,
    weights: FloatArray,
) -> Evidence:
    """Prepare the evidence of hypotheses for whitened values."""
    information, linear = design.T @ design, design.T @ target
    smooth = np.empty((len(weights), *design.T.shape))
    log_smooth = np.empty(len(weights))
    for number, weight in enumerate(weights):
        lower = np.linalg.cholesky(information + weight * prior + ridge)
        smooth[number] = solve_triangular(lower, design.T, lower=True)
        along = smooth[number] @ target
        log_determinant = 2 * float(np.log(np.diag(lower)).sum())
        log_smooth[number] = ((len(prior) - 2) * np.log(weight) - log_determinant + along @ along) / 2
    span_nm = float(fine_nm[-1] - fine_nm[0])
    along = smooth @ target
    return Evidence(target, fine_design, fine_nm, smooth, along, log_smooth, span_nm)
