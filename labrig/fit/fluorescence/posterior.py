"""A surface under one hypothesis: most likely, drawn at random, and summarised.

Reflectance and excitation are not negative. Draws are those of A. Bardsley and P. C. Hansen (*MCMC
algorithms for computational UQ of nonnegativity constrained linear inverse problems*, SIAM J. Sci.
Comput. 42, 2020), as in `labrig.fit.spectrum`: values and prior are drawn anew, and every draw is
the non-negative surface nearest to them. The deviations of an emission from its shape count as
noise of the values there, and are drawn afterwards.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, lapack

from labrig.fit.fluorescence.hypotheses import (
    Hypotheses,
    Hypothesis,
    Measured,
)
from labrig.fit.fluorescence.result import (
    EstimatedFluorophore,
    EstimateFact,
    ExtrapolatedExcitation,
    MoreThanWhite,
    Surfaces,
    UnexplainedValues,
    UnknownBrightness,
)
from labrig.fit.fluorescence.surface_prior import covariance_root
from labrig.fit.fluorescence.system import FluorescenceSystem
from labrig.fit.spectrum import nonnegative_minimum
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum, edges_from_centres

#: Iterations in which the deviations of an emission follow its excitation.
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Draws:
    """Surfaces drawn under one hypothesis.

    Attributes
    ----------
    reflectance
        ρ, shape (d, o).
    reradiation
        Φ of each fluorophore at all wavelengths, in 1/nm, shape (d, j, o, i); what lies on the
        anti-Stokes side does not come back.
    """

    reflectance: FloatArray
    reradiation: FloatArray


class Posterior:
    """The density of surfaces under a hypothesis, given values.

    Parameters
    ----------
    common
        What all hypotheses share.
    hypothesis
        The hypothesis.
    measured
        Values with errors.
    """

    def __init__(self, common: Hypotheses, hypothesis: Hypothesis, measured: Measured) -> None:
        self._common, self._hypothesis = common, hypothesis
        self._value, self._noise = measured.value, measured.total
        self._parts = [common.reflectance_part(hypothesis.reflectance_sigma)]
        self._parts += [
            common.dye_part(dye.shape).of_amplitude(dye.amplitude)
            for dye in hypothesis.fluorophores
        ]
        self._design = np.concatenate([part.design for part in self._parts], axis=1)
        self._mean = np.concatenate([part.mean for part in self._parts])
        self._most_likely = np.ones_like(self._mean)
        self._precision_root = _block_diagonal([part.precision_root for part in self._parts])
        self._precision = self._precision_root @ self._precision_root.T
        self._deviation_designs = [
            common.deviation_designs(dye.shape) for dye in hypothesis.fluorophores
        ]
        self._deviations = [
            dye.amplitude**2 * common.excitation_covariance(dye.shape)
            for dye in hypothesis.fluorophores
        ]
        background = hypothesis.background_sigma**2 * common.background_variance
        self._background = background
        for dye in hypothesis.fluorophores:
            variance = common.error_variance[dye.shape]
            self._noise = self._noise + measured.misfit * dye.amplitude**2 * variance
        self._solve()
        for _ in range(ROUNDS if hypothesis.fluorophores else 0):
            errors = common.system.covariance(*self.most_likely())
            self._noise = measured.misfit * (measured.noise + errors)
            self._deviations = [
                np.outer(excitation, excitation) * common.deviation_correlation
                for excitation in self._excitations(self._most_likely)
            ]
            self._solve()

    def _solve(self) -> None:
        """Find the most likely surface, with deviations of some covariance as noise."""
        deviation = np.zeros_like(self._noise)
        for design, covariance in zip(self._deviation_designs, self._deviations, strict=True):
            deviation += np.tensordot(design @ covariance, design, axes=((0, 2), (0, 2)))
        self._deviation = deviation
        self._lower = np.linalg.cholesky(self._noise + self._background + deviation)
        columns = np.column_stack([self._design, self._value])
        # SciPy's own function takes several times as long to call as such a system to solve.
        whitened = np.asarray(lapack.dtrtrs(self._lower, columns, lower=1)[0])
        self._whitened, self._target = whitened[:, :-1], whitened[:, -1]
        self._curvature = self._whitened.T @ self._whitened + self._precision
        self._linear = self._whitened.T @ self._target + self._precision @ self._mean
        self._most_likely = nonnegative_minimum(
            self._curvature, self._linear, self._most_likely > 0
        )

    def _excitations(self, unknowns: FloatArray) -> list[FloatArray]:
        """Return the excitation (…, i) of each dye."""
        start, found = len(self._common.system.output_nm), []
        for part in self._parts[1:]:
            excitation = np.zeros((*unknowns.shape[:-1], len(self._common.system.input_nm)))
            excitation[..., part.used] = unknowns[..., start : start + len(part.mean)]
            start += len(part.mean)
            found.append(excitation)
        return found

    def _variance(self) -> FloatArray:
        """Return the covariance (n, n) of the values without noise."""
        total = self._common.reflectance_variance[self._hypothesis.reflectance_sigma].copy()
        total += self._deviation + self._background
        for dye in self._hypothesis.fluorophores:
            total += dye.amplitude**2 * self._common.shape_variance[dye.shape]
        return total

    def log_evidence(self) -> float:
        """Return the log-evidence by the most likely non-negative surface.

        It is that of the unbounded normal density where no bound is active.
        """
        x = self._most_likely
        residual = self._target - self._whitened @ x
        away = self._precision_root.T @ (x - self._mean)
        lower = np.linalg.cholesky(self._noise + self._variance())
        log_root = np.log(np.diag(lower)).sum()
        n = len(self._value)
        return float(
            -(residual @ residual + away @ away) / 2 - log_root - n / 2 * np.log(2 * np.pi)
        )

    def most_likely(self) -> tuple[FloatArray, FloatArray]:
        """Return ρ (o,) and Φ (o, i) at the maximum, emissions as their shapes."""
        system = self._common.system
        reradiation = np.zeros((len(system.output_nm), len(system.input_nm)))
        for dye, excitation in zip(
            self._hypothesis.fluorophores, self._excitations(self._most_likely), strict=True
        ):
            reradiation += np.outer(self._common.shapes.value[dye.shape], excitation)
        return self._most_likely[: len(system.output_nm)], reradiation * self._common.edge

    @property
    def sigma(self) -> FloatArray:
        """Return σ of the values about the most likely surface, shape (n,)."""
        return np.asarray(np.sqrt(np.square(self._lower).sum(axis=1)))

    def reduced_chi2(self) -> float:
        """Return χ² of the values per degree of freedom that the surface leaves."""
        residual = self._target - self._whitened @ self._most_likely
        free = self._most_likely > 0
        curvature, whitened = self._curvature[np.ix_(free, free)], self._whitened[:, free]
        taken = np.trace(np.linalg.solve(curvature, whitened.T @ whitened))
        dof = float(len(residual) - taken)
        return float(residual @ residual) / dof if dof > 0 else math.nan

    def draw(self, count: int, rng: np.random.Generator) -> Draws:
        """Return some surfaces drawn at random."""
        n, p = self._design.shape
        linear = (
            self._linear[:, np.newaxis]
            + self._whitened.T @ rng.standard_normal((n, count))
            + self._precision_root @ rng.standard_normal((p, count))
        )
        solution, free = np.empty((count, p)), self._most_likely > 0
        for number in range(count):
            solution[number] = nonnegative_minimum(self._curvature, linear[:, number], free)
        residual = self._value - solution @ self._design.T
        outputs, inputs = len(self._common.system.output_nm), len(self._common.system.input_nm)
        dyes = self._hypothesis.fluorophores
        reradiation = np.empty((count, len(dyes), outputs, inputs))
        deviations = self._draw_deviations(residual, rng)
        for number, excitation in enumerate(self._excitations(solution)):
            shape = dyes[number].shape
            emission = self._common.shapes.value[shape]
            drawn = emission[:, np.newaxis] * excitation[:, np.newaxis]
            drawn += np.einsum("ro,dri->doi", self._common.modes[shape], deviations[number])
            bounded = np.maximum(drawn, 0.0)
            # What is cut off below 0 is taken from the rest: the light was told by the values.
            light, bounded_light = drawn.sum(axis=1), bounded.sum(axis=1)
            kept = np.clip(light / np.maximum(bounded_light, 1e-300), 0.0, 1.0)
            reradiation[:, number] = kept[:, np.newaxis] * bounded
        return Draws(solution[:, :outputs], reradiation)

    def _draw_deviations(self, residual: FloatArray, rng: np.random.Generator) -> list[FloatArray]:
        """Return excitations (d, modes, i) of each dye's deviations, given what is left to them.

        Drawn before the values, then moved by what they say (Matheron's rule).
        """
        count, modes = len(residual), self._common.modes.shape[1]
        noise = (
            rng.standard_normal(residual.shape)
            @ np.linalg.cholesky(self._noise + self._background).T
        )
        before, seen = [], residual - noise
        for design, covariance in zip(self._deviation_designs, self._deviations, strict=True):
            drawn = (
                rng.standard_normal((count, modes, len(covariance))) @ covariance_root(covariance).T
            )
            before.append(drawn)
            seen = seen - np.tensordot(drawn, design, axes=((1, 2), (0, 2)))
        pulled = cho_solve((self._lower, True), seen.T)
        return [
            drawn + np.tensordot(pulled, design, axes=(0, 1)) @ covariance
            for design, drawn, covariance in zip(
                self._deviation_designs, before, self._deviations, strict=True
            )
        ]


def _block_diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    # SciPy's own function takes ten times as long.
    ends = np.cumsum([len(block) for block in blocks])
    matrix = np.zeros((ends[-1], ends[-1]))
    for block, end in zip(blocks, ends, strict=True):
        own = slice(end - len(block), end)
        matrix[own, own] = block
    return matrix


#: Part of the re-radiation excited in bands without light from which that is a fact to know.
MUCH = 0.1
#: Reduced χ² that is a fact to know: of few degrees of freedom it scatters.
LARGE_CHI2 = 3.0
#: Fraction of light that may come back, as `labrig.material.physical_warnings` has it.
MAX_FRACTION, SIGMAS = 1.1, 3.0


def fluorophores_of(
    system: FluorescenceSystem, draws: Sequence[Draws]
) -> tuple[EstimatedFluorophore, ...]:
    """Return the dyes of draws with the same number of them, by rising emission."""
    reradiation = np.concatenate([draw.reradiation for draw in draws])
    reflectance = np.concatenate([draw.reflectance for draw in draws])
    widths = np.diff(edges_from_centres(system.output_nm))
    excitation = np.einsum("o,djoi->dji", widths, reradiation)
    emitted = reradiation.sum(axis=3)
    light = np.einsum("o,djo->dj", widths, emitted)
    emission = emitted / np.where(light > 0, light, 1.0)[:, :, np.newaxis]
    centre = np.einsum("o,djo->dj", widths * system.output_nm, emission)
    order = np.argsort(centre, axis=1)
    rows = np.arange(len(order))[:, np.newaxis]
    emission, excitation = emission[rows, order], excitation[rows, order]
    reradiation = reradiation[rows, order] * system.is_stokes
    found = []
    for number in range(emission.shape[1]):
        quantum_yield = _quantum_yield(system, reflectance, reradiation[:, number])
        found.append(
            EstimatedFluorophore(
                _spectrum(f"emission {number + 1}", system.output_nm, emission[:, number]),
                _spectrum(f"excitation {number + 1}", system.input_nm, excitation[:, number]),
                *quantum_yield,
            )
        )
    return tuple(found)


def _quantum_yield(
    system: FluorescenceSystem, reflectance: FloatArray, reradiation: FloatArray
) -> tuple[float, float]:
    """Return the photons emitted per photon not reflected, and σ."""
    covered = system.is_lit & (system.input_nm >= system.output_nm[0])
    if not covered.any():
        return math.nan, math.nan
    photons = np.diff(edges_from_centres(system.output_nm)) * system.output_nm
    emitted = np.einsum("o,doi->di", photons, reradiation) / system.input_nm
    band = int(np.argmax(np.where(covered, emitted.mean(axis=0), -1.0)))
    nm = system.input_nm[band]
    reflected = np.array([np.interp(nm, system.output_nm, row) for row in reflectance])
    absorbed = 1 - reflected
    if absorbed.mean() < 2 * absorbed.std():
        return math.nan, math.nan
    ratio = emitted[:, band] / np.maximum(absorbed, 1e-3)
    return float(ratio.mean()), float(ratio.std(ddof=1))


def _spectrum(name: str, nm: FloatArray, draws: FloatArray) -> Spectrum:
    sigma = draws.std(axis=0, ddof=1) if len(draws) > 1 else None
    return Spectrum(name, nm, draws.mean(axis=0), sigma)


def facts_of(
    system: FluorescenceSystem,
    matrix: ReradiationMatrix,
    surfaces: Surfaces,
    pull: FloatArray,
    reduced_chi2: float,
) -> tuple[EstimateFact, ...]:
    facts: list[EstimateFact] = []
    names = [exposure.light.name for exposure in system.exposures]
    if system.is_loose.any():
        facts.append(UnknownBrightness(tuple(np.array(names)[system.is_loose].tolist())))
    excited = matrix.reradiated_fraction * matrix.input_width_nm
    dark = ~system.is_lit & (excited > 0)
    share = float(excited[dark].sum() / max(float(excited.sum()), 1e-300))
    if share > MUCH:
        facts.append(ExtrapolatedExcitation(tuple(system.input_nm[dark].tolist()), share))
    if reduced_chi2 > LARGE_CHI2:
        light, channel = np.unravel_index(int(np.abs(pull).argmax()), pull.shape)
        facts.append(
            UnexplainedValues(reduced_chi2, names[light], int(channel), float(pull[light, channel]))
        )
    fractions = _total_fractions(matrix, surfaces)
    mean, sigma = fractions.mean(axis=0), fractions.std(axis=0, ddof=1)
    worst = int(np.argmax(mean - SIGMAS * sigma))
    if mean[worst] > MAX_FRACTION + SIGMAS * sigma[worst]:
        facts.append(
            MoreThanWhite(float(matrix.input_nm[worst]), float(mean[worst]), float(sigma[worst]))
        )
    return tuple(facts)


def _total_fractions(matrix: ReradiationMatrix, surfaces: Surfaces) -> FloatArray:
    """Return the fraction of light that comes back at all from each drawn surface, shape (d, i)."""
    stokes = np.where(matrix.is_stokes, surfaces.reradiation, 0.0)
    reradiated = np.einsum("o,doi->di", matrix.output_width_nm, stokes)
    nm = matrix.input_nm
    reflected = [
        np.interp(nm, matrix.output_nm, reflectance, left=0.0, right=0.0)
        for reflectance in surfaces.reflectance
    ]
    return np.asarray(reradiated + np.array(reflected))
