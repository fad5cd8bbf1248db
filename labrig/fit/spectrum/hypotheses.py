"""Lines on a smooth spectrum: hypotheses, drawn by their probability given the values.

A hypothesis is a weight of the smoothness prior and any number of features. Features come, go,
move and change their shape by reversible jumps (P. J. Green, *Reversible jump Markov chain Monte
Carlo computation and Bayesian model determination*, Biometrika 82, 1995), so that the draws differ
in all that the values leave open: how many lines there are, where, and how broad.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum.evidence import Evidence
from labrig.fit.spectrum.feature import FWHM_NM, WEAKEST, Feature, united
from labrig.fit.spectrum.line import FWHM_OVER_SIGMA

#: Prior probabilities that a feature is a Gaussian line, and that it is two; else it has wings.
#: Ions in crystals have their lines in groups.
GAUSSIAN, PAIR = 0.15, 0.7
#: Prior probability of a first feature relative to none, and of each further one to one less.
FIRST, FURTHER = 0.1, 0.5
MOST_FEATURES = 16
#: Loss of log evidence for one feature less up to which it is left out of the start: about what its
#: place and width cost by their prior.
WORTH = 10.0
#: Steps of the chain before the first draw and for each draw, and those between new weights.
SETTLING, THINNING, WEIGHING = 200, 20, 20
#: Probabilities of a step of a birth, of a death and of a new shape; else a feature moves.
BIRTH, DEATH, RESHAPING = 0.08, 0.08, 0.24
#: Largest steps of the wavelength in nm, of the logarithm of the width and of fractions; all are
#: smaller by up to this power of ten.
STEP_NM, STEP_LOG, STEP_FRACTION, SMALLER = 5.0, 1.0, 1.0, 2.5
#: Iterations of a climb.
CLIMBING = 50


@dataclass(frozen=True)
class Hypothesis:
    """A weight of the smoothness prior, by its index, and features."""

    weight: int
    features: tuple[Feature, ...]


class Chain:
    """A Markov chain of hypotheses.

    Parameters
    ----------
    evidence
        Evidence of hypotheses.
    features
        Features at the start.
    rng
        Source of the steps.
    """

    def __init__(
        self, evidence: Evidence, features: Sequence[Feature], rng: np.random.Generator
    ) -> None:
        self._evidence, self._rng = evidence, rng
        low, high = np.log(np.array(FWHM_NM) / FWHM_OVER_SIGMA).tolist()
        self._log_width = (low, high)
        self._see(features, None)

    @property
    def hypothesis(self) -> Hypothesis:
        """Hypothesis at which the chain is."""
        return Hypothesis(self._weight, tuple(self._features))

    @property
    def log_posterior(self) -> float:
        """Log evidence, less what places and widths of the features cost by their prior."""
        return self._log - WORTH * len(self._features)

    def climb(self) -> None:
        """Go to a maximum of the evidence with as few features as explain the values."""
        self._climb()
        while self._simplify():
            self._climb()

    def settle(self) -> None:
        """Walk for a while, and climb."""
        self._walk(SETTLING)
        self._simplify()
        self._climb()

    def draw(self, count: int) -> list[Hypothesis]:
        """Return hypotheses, drawn by their probability."""
        drawn = []
        for _ in range(count):
            self._walk(THINNING)
            drawn.append(self.hypothesis)
        return drawn

    def _see(self, features: Sequence[Feature], weight: int | None) -> None:
        """Go to other features, with the given or the most probable weight."""
        self._features = list(features)
        self._columns = self._evidence.columns(features)
        if weight is None:
            weight = int(np.argmax(self._evidence.of_weights(self._columns)))
        self._weight = weight
        self._log = self._evidence.of_weight(self._columns, weight)

    def _climb(self) -> None:
        """Take wavelengths and widths to a maximum of the evidence."""
        if not self._features:
            return
        unit_nm = self._evidence.margin_nm

        def at(x: FloatArray) -> list[Feature]:
            return [
                replace(one, wavelength_nm=unit_nm * float(nm), width_nm=float(np.exp(width)))
                for one, nm, width in zip(self._features, x[::2], x[1::2], strict=True)
            ]

        def cost(x: FloatArray) -> float:
            return -self._evidence.of_weight(self._evidence.columns(at(x)), self._weight)

        start = [(one.wavelength_nm / unit_nm, np.log(one.width_nm)) for one in self._features]
        low_nm, high_nm = self._evidence.range_nm
        bounds = [(low_nm / unit_nm, high_nm / unit_nm), self._log_width] * len(self._features)
        # Not least squares: determinants and probabilities of signs are in the evidence.
        found = minimize(cost, np.ravel(start), bounds=bounds, options={"maxiter": CLIMBING})
        self._see(at(found.x), None)

    def _simplify(self) -> bool:
        """Have fewer features as long as that costs little evidence; return whether there are."""
        before = len(self._features)
        while self._features:
            simpler = list(self._simpler())
            logs = [
                self._evidence.of_weight(self._evidence.columns(one), self._weight)
                for one in simpler
            ]
            best = int(np.argmax(logs))
            if logs[best] + WORTH < self._log:
                break
            self._see(simpler[best], self._weight)
        return len(self._features) < before

    def _simpler(self) -> Iterator[list[Feature]]:
        """Yield the features without one of them, and with two neighbours made one."""
        powers = self._evidence.powers(self._columns, self._weight).tolist()
        both = sorted(zip(self._features, powers, strict=True), key=lambda f: f[0].wavelength_nm)
        features = [one for one, _ in both]
        for k in range(len(features)):
            yield features[:k] + features[k + 1 :]
        for k, ((one, power), (other, next_power)) in enumerate(pairwise(both)):
            if power > 0 and next_power > 0:
                for single in united(one, other, next_power / (power + next_power)):
                    yield [*features[:k], single, *features[k + 2 :]]

    def _walk(self, steps: int) -> None:
        for _ in range(steps // WEIGHING):
            for _ in range(WEIGHING):
                self._step()
            log = self._evidence.of_weights(self._columns)
            probability = np.exp(log - log.max())
            self._weight = int(self._rng.choice(len(log), p=probability / probability.sum()))
            self._log = float(log[self._weight])

    def _step(self) -> None:
        kind = self._rng.random()
        if kind < BIRTH:
            self._birth()
        elif not self._features:
            return
        elif kind < BIRTH + DEATH:
            self._death()
        elif kind < BIRTH + DEATH + RESHAPING:
            self._reshape()
        else:
            self._move()

    def _accept(self, columns: FloatArray, log_prior: float = 0.0) -> bool:
        log = self._evidence.of_weight(columns, self._weight)
        if np.log(self._rng.random()) >= log - self._log + log_prior:
            return False
        self._columns, self._log = columns, log
        return True

    def _birth(self) -> None:
        count = len(self._features)
        if count == MOST_FEATURES:
            return
        new = self._any_shape(
            float(self._rng.uniform(*self._evidence.range_nm)),
            float(np.exp(self._rng.uniform(*self._log_width))),
        )
        if not new.is_allowed:
            return
        columns = np.vstack([self._columns, self._evidence.columns([new])])
        if self._accept(columns, float(np.log(FURTHER if count else FIRST))):
            self._features.append(new)

    def _death(self) -> None:
        count = len(self._features)
        chosen = int(self._rng.integers(count))
        columns = np.delete(self._columns, chosen, axis=0)
        if self._accept(columns, -float(np.log(FURTHER if count > 1 else FIRST))):
            del self._features[chosen]

    def _any_shape(self, wavelength_nm: float, width_nm: float) -> Feature:
        kind = self._rng.random()
        if kind < GAUSSIAN:
            return Feature(wavelength_nm, width_nm)
        fraction = float(self._rng.random())
        if kind < GAUSSIAN + PAIR:
            share = float(self._rng.uniform(WEAKEST, 1 - WEAKEST))
            return Feature(wavelength_nm, width_nm, apart=fraction, share=share)
        return Feature(wavelength_nm, width_nm, wings=fraction)

    def _reshape(self) -> None:
        """Change a feature's shape, every other time its place and width with it."""
        chosen = int(self._rng.integers(len(self._features)))
        one = self._features[chosen]
        step = self._small_steps(2) if self._rng.random() < 0.5 else [0.0, 0.0]
        new = self._any_shape(
            one.wavelength_nm + STEP_NM * step[0],
            one.width_nm * float(np.exp(STEP_LOG * step[1])),
        )
        self._replace(chosen, new)

    def _move(self) -> None:
        chosen = int(self._rng.integers(len(self._features)))
        one = self._features[chosen]
        step = self._small_steps(5)
        moved = Feature(
            one.wavelength_nm + STEP_NM * step[0],
            one.width_nm * float(np.exp(STEP_LOG * step[1])),
            one.apart + STEP_FRACTION * step[2] if one.apart else 0.0,
            one.share + STEP_FRACTION * step[3] if one.apart else 0.5,
            one.wings + STEP_FRACTION * step[4] if one.wings else 0.0,
        )
        self._replace(chosen, moved)

    def _small_steps(self, count: int) -> list[float]:
        size = 10 ** -self._rng.uniform(0, SMALLER)
        steps: list[float] = (size * self._rng.standard_normal(count)).tolist()
        return steps

    def _replace(self, chosen: int, new: Feature) -> None:
        low_nm, high_nm = self._evidence.range_nm
        if not (low_nm < new.wavelength_nm < high_nm and new.is_allowed):
            return
        columns = self._columns.copy()
        columns[chosen] = self._evidence.columns([new])[0]
        if self._accept(columns):
            self._features[chosen] = new
