"""Which lines stand on a smooth spectrum: hypotheses, drawn by their probability given the values.

A hypothesis is a weight of the smoothness prior and any number of narrow features, each a line or a
pair of lines too close to be told apart. Their powers and the smooth spectrum are normal given a
hypothesis, so that they are integrated out exactly (x ≥ 0 ignored) and what remains is the evidence
of the hypothesis. Features come and go and move by reversible jumps (P. J. Green, *Reversible jump
Markov chain Monte Carlo computation and Bayesian model determination*, Biometrika 82, 1995; birth
and death of a Poisson process: C. J. Geyer, J. Møller, *Simulation procedures and likelihood
inference for spatial point processes*, Scand. J. Stat. 21, 1994).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import LinAlgError, lapack, solve_triangular
from scipy.optimize import minimize
from scipy.special import log_ndtr, logsumexp

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum.line import FWHM_OVER_SIGMA, line_at_knots, wings_at_knots

#: Prior of a feature's full width at half maximum in nm: even in its logarithm. Wider ones are left
#: to the smooth spectrum, which resolves them.
FWHM_NM = (2.0, 40.0)
#: Prior probability that a feature is a Gaussian line, and that it is two; else it has wings.
GAUSSIAN, PAIR = 0.35, 0.45
#: Least share of the weaker of two lines.
WEAKEST = 0.05
#: Prior probability of a first feature relative to none, and of each further one to as many less.
FIRST, FURTHER = 0.1, 0.5
MAX_FEATURES = 16
#: Least significance, in σ of the values, of a line with all the light.
SEEN_SIGMA = 30.0
#: Distance in knots of the places at which the smooth spectrum must not be negative, and how much
#: it may be for a spectrum of about 1.
PLACES, TOLERATED = 4, 0.01
#: Probability of any line at all below which there are none.
NEGLIGIBLE = 0.01
#: Distance of the tried wavelengths and of the knots of lines, per distance of the knots.
TRIED, FINER = 0.5, 0.25
TRIED_FWHM_NM = (3.0, 8.0, 14.0, 22.0)
#: Steps of the chain for each step that is kept, and those between two features of the start.
THINNING, SETTLING = 20, 200
#: Largest loss of log evidence for one feature less: what its place and width cost by their prior.
WORTH, SIMPLIFYING = 10.0, 4
#: Steps after which another weight is drawn.
WEIGHING = 20
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
    wings: float = 0.0

    def at_knots(self, knots_nm: FloatArray) -> FloatArray:
        """Return the values (n,) of the feature of integral 1 at evenly spaced knots."""
        fwhm_nm = FWHM_OVER_SIGMA * self.width_nm * np.sqrt(1 - self.apart)
        if self.apart == 0:
            core = line_at_knots(knots_nm, self.wavelength_nm, fwhm_nm)
            if self.wings == 0:
                return core
            wings = wings_at_knots(knots_nm, self.wavelength_nm, fwhm_nm)
            return (1 - self.wings) * core + self.wings * wings
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
    at_places: FloatArray
    mean_at_places: FloatArray
    variance_at_places: FloatArray
    power: float

    def columns(self, features: Sequence[Feature]) -> FloatArray:
        """Return the whitened values (k, m) of features of power 1."""
        rows = [self.fine_design @ one.at_knots(self.fine_nm) for one in features]
        return np.array(rows).reshape(-1, len(self.target))

    def log_evidence_of_weights(self, columns: FloatArray) -> FloatArray:
        """Return the log evidence of all weights with features of the given values."""
        if not len(columns):
            return self.log_none
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
        lever = self.at_places @ columns.T
        smooth = self.mean_at_places - np.einsum("wpk,wk->wp", lever, mean)
        variance = self.variance_at_places + ((lever @ inverse.swapaxes(1, 2)) ** 2).sum(axis=2)
        return self.log_smooth + gain + log_ndtr(smooth / np.sqrt(variance)).sum(axis=1)

    def log_evidence(self, columns: FloatArray, weight: int) -> float:
        """Return the log evidence of a weight with features of the given values."""
        if not len(columns):
            return float(self.log_none[weight])
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
        mean = whitened @ inverse
        z = mean / np.sqrt((inverse**2).sum(axis=0))
        occam = np.log(inverse.diagonal() / self.power * 2).sum()
        lever = self.at_places[weight] @ columns.T
        smooth = self.mean_at_places[weight] - lever @ mean
        variance = self.variance_at_places[weight] + ((lever @ inverse.T) ** 2).sum(axis=1)
        positive = log_ndtr(z).sum() + log_ndtr(smooth / np.sqrt(variance)).sum()
        return float(self.log_smooth[weight] + whitened @ whitened / 2 + occam + positive)

    def powers(self, columns: FloatArray, weight: int) -> FloatArray:
        """Return the mean powers of features of the given values."""
        outside = columns @ self.smooth[weight].T
        information = columns @ columns.T - outside @ outside.T
        information.flat[:: len(columns) + 1] += self.power**-2
        linear = columns @ self.target - outside @ self.along[weight]
        return np.asarray(np.linalg.solve(information, linear))

    @cached_property
    def log_none(self) -> FloatArray:
        """Log evidence of all weights without features."""
        z = self.mean_at_places / np.sqrt(self.variance_at_places)
        result: FloatArray = self.log_smooth + log_ndtr(z).sum(axis=1)
        return result

    @cached_property
    def tried(self) -> tuple[list[Feature], FloatArray]:
        """Features on a grid, and their whitened values."""
        low, high = self.range_nm
        grid_nm = np.arange(low, high, TRIED * self.margin_nm)
        features = [
            Feature(float(nm), fwhm / FWHM_OVER_SIGMA) for fwhm in TRIED_FWHM_NM for nm in grid_nm
        ]
        return features, self.columns(features)

    @property
    def margin_nm(self) -> float:
        """Distance of the knots of the smooth spectrum."""
        return float(self.fine_nm[1] - self.fine_nm[0]) / FINER

    @cached_property
    def range_nm(self) -> tuple[float, float]:
        """Least and largest wavelength of a feature: a knot within what the values see."""
        step = float(self.fine_nm[1] - self.fine_nm[0])
        seen = np.linalg.norm(self.fine_design, axis=0)
        inside = self.fine_nm[seen * self.power > SEEN_SIGMA * step]
        low, high = self.fine_nm[0] + self.margin_nm, self.fine_nm[-1] - self.margin_nm
        return float(max(low, inside[0])), float(min(high, inside[-1]))

    def gains(self) -> FloatArray:
        """Return the log evidence of each weight with each tried feature."""
        tried = self.tried[1]
        result = np.empty((len(self.smooth), len(tried)))
        direct = tried @ self.target
        for number, smooth in enumerate(self.smooth):
            seen = tried @ smooth.T
            norm2 = np.einsum("ij,ij->i", tried, tried) - np.einsum("ij,ij->i", seen, seen)
            norm2 = np.maximum(norm2, 0.0) + self.power**-2
            sigmas = (direct - seen @ self.along[number]) / np.sqrt(norm2)
            occam = np.log(2) - np.log(norm2 * self.power**2) / 2
            result[number] = sigmas**2 / 2 + occam + log_ndtr(sigmas) + self.log_smooth[number]
        return result

    def log_odds_of_one(self) -> float:
        """Return the log of the evidence of one feature, its prior included."""
        with_one = self.gains()
        return float(logsumexp(with_one) - np.log(with_one.size) + np.log(FIRST))


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
        """Go to where the evidence is high, with as few features as explain the values."""
        self._climb()
        for _ in range(SIMPLIFYING):
            before = len(self.features)
            self._simplify()
            self._climb()
            if len(self.features) == before:
                break
        self._walk(SETTLING)
        self._simplify()
        self._climb()

    def _simplify(self) -> None:
        """Leave out features, and unite neighbours, as long as that costs no evidence to speak of."""
        while self.features:
            options = list(self._simpler())
            logs = [
                self.evidence.log_evidence(self.evidence.columns(one), self.weight)
                for one in options
            ]
            best = int(np.argmax(logs))
            if logs[best] + WORTH < self._log:
                break
            self._see(options[best])
            if not self.features:
                break

    def _simpler(self) -> Iterator[list[Feature]]:
        """Yield the features without one of them, and with two neighbours made one."""
        order = sorted(range(len(self.features)), key=lambda k: self.features[k].wavelength_nm)
        features = [self.features[k] for k in order]
        power = np.maximum(self.evidence.powers(self._columns, self.weight)[order], 0.0)
        for k in range(len(features)):
            yield features[:k] + features[k + 1 :]
        for k in range(len(features) - 1):
            pair, total = features[k : k + 2], float(power[k : k + 2].sum())
            if total > 0:
                share = (power[k : k + 2] / total).tolist()
                mean_nm = sum(p * one.wavelength_nm for p, one in zip(share, pair, strict=True))
                variance = sum(
                    p * (one.width_nm**2 + (one.wavelength_nm - mean_nm) ** 2)
                    for p, one in zip(share, pair, strict=True)
                )
                width_nm = min(float(np.sqrt(variance)), 0.999 * FWHM_NM[1] / FWHM_OVER_SIGMA)
                yield [*features[:k], Feature(mean_nm, width_nm), *features[k + 2 :]]
                between = (share[0] * share[1] * (pair[1].wavelength_nm - pair[0].wavelength_nm) ** 2)
                apart = between / variance
                if WEAKEST < share[1] < 1 - WEAKEST and 0.01 < apart < 0.99:
                    double = Feature(mean_nm, width_nm, apart, share[1])
                    yield [*features[:k], double, *features[k + 2 :]]

    def _climb(self) -> None:
        """Take the wavelengths and widths to a maximum of the evidence."""
        if not self.features:
            return
        margin = self.evidence.margin_nm
        low, high = self.evidence.range_nm
        narrow, wide = np.log(np.array(FWHM_NM) / FWHM_OVER_SIGMA)

        def at(x: FloatArray) -> list[Feature]:
            return [
                replace(one, wavelength_nm=margin * float(place), width_nm=float(np.exp(width)))
                for one, place, width in zip(self.features, x[::2], x[1::2], strict=True)
            ]

        def cost(x: FloatArray) -> float:
            return -self.evidence.log_evidence(self.evidence.columns(at(x)), self.weight)

        start = [(one.wavelength_nm / margin, np.log(one.width_nm)) for one in self.features]
        bounds = [(low / margin, high / margin), (narrow, wide)] * len(self.features)
        found = minimize(cost, np.ravel(start), bounds=bounds, options={"maxiter": 50})
        self._see(at(found.x))
        self.weight = int(np.argmax(self.evidence.log_evidence_of_weights(self._columns)))
        self._see(self.features)

    def _log_prior(self, more: int) -> float:
        """Return the logarithm of the prior of one feature more, or less, relative to now."""
        return float(more * np.log(FIRST if len(self.features) + min(more, 0) == 0 else FURTHER))

    def _walk(self, steps: int) -> None:
        for _ in range(steps // WEIGHING):
            for _ in range(WEIGHING):
                self._step()
            self._weigh()

    def draw(self, count: int) -> list[Hypothesis]:
        """Return hypotheses of the chain."""
        drawn = []
        for _ in range(count):
            self._walk(THINNING)
            drawn.append(Hypothesis(self.weight, tuple(self.features)))
        return drawn

    def _step(self) -> None:
        kind = self.rng.random()
        if kind < 0.08:
            self._birth()
        elif kind < 0.16:
            self._death()
        elif kind < 0.4:
            self._reshape()
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
        if self._accept(columns, self._log_prior(1)):
            self.features.append(new)

    def _death(self) -> None:
        if not self.features:
            return
        chosen = int(self.rng.integers(len(self.features)))
        columns = np.delete(self._columns, chosen, axis=0)
        if self._accept(columns, self._log_prior(-1)):
            del self.features[chosen]

    def _any_feature(self) -> Feature:
        low, high = np.log(np.array(FWHM_NM) / FWHM_OVER_SIGMA)
        return self._any_shape(
            Feature(
                float(self.rng.uniform(*self.evidence.range_nm)),
                float(np.exp(self.rng.uniform(low, high))),
            )
        )

    def _any_shape(self, one: Feature) -> Feature:
        kind = self.rng.random()
        plain = Feature(one.wavelength_nm, one.width_nm)
        if kind < GAUSSIAN:
            return plain
        if kind < GAUSSIAN + PAIR:
            share = float(self.rng.uniform(WEAKEST, 1 - WEAKEST))
            return replace(plain, apart=float(self.rng.random()), share=share)
        return replace(plain, wings=float(self.rng.random()))

    def _reshape(self) -> None:
        if self.features:
            chosen = int(self.rng.integers(len(self.features)))
            new = self._any_shape(self.features[chosen])
            size = 10 ** -self.rng.uniform(0, SMALLER) * (self.rng.random() < 0.5)
            step = size * self.rng.standard_normal(2)
            self._replace(
                chosen,
                replace(
                    new,
                    wavelength_nm=new.wavelength_nm + float(STEP_NM * step[0]),
                    width_nm=new.width_nm * float(np.exp(STEP_LOG * step[1])),
                ),
            )

    def _move(self) -> None:
        if not self.features:
            return
        chosen = int(self.rng.integers(len(self.features)))
        one = self.features[chosen]
        size = 10 ** -self.rng.uniform(0, SMALLER)
        step = (size * self.rng.standard_normal(5)).tolist()
        moved = Feature(
            one.wavelength_nm + STEP_NM * step[0],
            one.width_nm * float(np.exp(STEP_LOG * step[1])),
            one.apart + step[2] if one.apart else 0.0,
            one.share + step[3] if one.apart else 0.5,
            one.wings + step[4] if one.wings else 0.0,
        )
        self._replace(chosen, moved)

    def _replace(self, chosen: int, new: Feature) -> None:
        low, high = self.evidence.range_nm
        narrow, wide = np.array(FWHM_NM) / FWHM_OVER_SIGMA
        if not (
            low < new.wavelength_nm < high
            and narrow < new.width_nm < wide
            and 0 <= new.apart < 1
            and 0 <= new.wings < 1
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
    places = np.arange(PLACES // 2, len(prior), PLACES)
    at_places, variance = np.empty((len(weights), len(places), len(target))), np.empty((len(weights), len(places)))
    for number, weight in enumerate(weights):
        lower = np.linalg.cholesky(information + weight * prior + ridge)
        smooth[number] = solve_triangular(lower, design.T, lower=True)
        along = smooth[number] @ target
        root = solve_triangular(lower, np.eye(len(prior))[:, places], lower=True)
        at_places[number] = root.T @ smooth[number]
        variance[number] = (root**2).sum(axis=0) + TOLERATED**2
        log_determinant = 2 * float(np.log(np.diag(lower)).sum())
        log_smooth[number] = ((len(prior) - 2) * np.log(weight) - log_determinant + along @ along) / 2
    span_nm = float(fine_nm[-1] - fine_nm[0])
    along = smooth @ target
    return Evidence(
        target, fine_design, fine_nm, smooth, along, log_smooth,
        at_places, at_places @ target, variance, span_nm,
    )  # fmt: skip


#: Distance in nm up to which neighbouring lines of the first solution make one feature.
TOGETHER_NM = 3.0
SMALLEST_POWER = 1e-3


def features_of(power: FloatArray, grid_nm: FloatArray) -> list[Feature]:
    """Return features for the powers (n,) of lines at evenly spaced wavelengths."""
    seen = np.flatnonzero(power > SMALLEST_POWER * power.sum())
    if not len(seen):
        return []
    groups = np.split(seen, np.flatnonzero(np.diff(grid_nm[seen]) > TOGETHER_NM) + 1)
    features = []
    for group in groups:
        share = power[group] / power[group].sum()
        mean_nm = float(share @ grid_nm[group])
        variance = float(share @ (grid_nm[group] - mean_nm) ** 2)
        width_nm = max(np.sqrt(variance), 1.5 * FWHM_NM[0] / FWHM_OVER_SIGMA)
        features.append(Feature(mean_nm, float(width_nm)))
    return features
