"""Hypotheses about a surface, and how well each explains the values.

A hypothesis is a set of fluorophores, each with the shape of its emission and the amplitude of its
excitation, how much the reflectance varies, and how much light nothing explains. Given one, all
that is unknown is linear in the values and normal before them, so that the values are normal, too:
their log-density under each of thousands of hypotheses (the evidence, which punishes what needs no
explanation) is one Cholesky factorisation of a matrix as large as there are values (C. E.
Rasmussen, C. K. I. Williams, *Gaussian Processes for Machine Learning*, 2006, equation 2.30).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np
from scipy.special import logsumexp

from labrig.fit.fluorescence.surface_prior import (
    BACKGROUND_SIGMAS,
    EXCITATION_SIGMAS,
    REFLECTANCE,
    REFLECTANCE_SIGMAS,
    EmissionShapes,
    Unknowns,
    deviation_correlation,
    emission_modes,
    excitation_covariance,
    reflectance_covariance,
    stokes_edge,
)
from labrig.fit.fluorescence.system import FluorescenceSystem
from labrig.foundation.arrays import FloatArray

MAX_FLUOROPHORES = 3
#: Prior probability that a surface does not fluoresce, and that it has one fluorophore more.
NOT_FLUORESCENT, ONE_MORE = 0.5, 0.1
#: Number of pairs of fluorophores that are adjusted, and to which a third one is added.
PAIRED, TRIPLED = 6, 2
#: Amplitudes with which all pairs are tried, and how far peaks are then moved, in nm.
ROUGH_SIGMAS, NEAR_NM = (0.1, 0.5), 20.0
#: Number of hypotheses with each number of fluorophores that are looked at more closely.
REFINED = 12
#: Number of shapes that are tried with all variations of reflectance and background.
SHORTLISTED = 80
#: Variance of an emission's deviations in the search, relative to that of surfaces.
SEARCHED_DEVIATION = 0.1
#: Number of independent deviations of an emission from its shape.
MODES = 10
#: Number of independent courses of an excitation in which errors of lights and curves are summed.
COURSES = 8
#: Number of shapes whose designs and priors are kept for the next hypothesis.
KEPT = 128
#: Larger than any squared length of whitened values.
_HUGE = 1e300


@dataclass(frozen=True)
class Fluorophore:
    """One dye of a hypothesis: index of its emission's shape, and its excitation's amplitude."""

    shape: int
    amplitude: float


@dataclass(frozen=True)
class Hypothesis:
    """Fluorophores, none for a surface that only reflects; variation of reflectance, background."""

    fluorophores: tuple[Fluorophore, ...]
    reflectance_sigma: float
    background_sigma: float


@dataclass(frozen=True, eq=False)
class Measured:
    """Values of a surface, with errors.

    Attributes
    ----------
    value, noise
        Values per brightness (n,) and the covariance (n, n) of their own errors.
    reflected_noise
        Covariance (n, n) from errors of lights and curves, as far as the surface reflects.
    misfit
        Factor of all covariances.
    """

    value: FloatArray
    noise: FloatArray
    reflected_noise: FloatArray
    misfit: float = 1.0

    @property
    def total(self) -> FloatArray:
        """Covariance (n, n) of the values of a surface that does not fluoresce."""
        return self.misfit * (self.noise + self.reflected_noise)


@dataclass(frozen=True)
class Scored:
    """A hypothesis with the logarithm of its prior probability times its evidence."""

    hypothesis: Hypothesis
    log_posterior: float


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Factors that all surfaces under the lights of one system have in common, computed once.

    Attributes
    ----------
    system
        Lights and camera, n = m · k values per brightness.
    shapes
        Shapes of emissions.
    """

    system: FluorescenceSystem
    shapes: EmissionShapes

    @cached_property
    def reflectance_design(self) -> FloatArray:
        """Values per reflectance, shape (n, o)."""
        reflected = self.system.response.reflected
        return reflected.reshape(-1, reflected.shape[-1])

    @cached_property
    def excitation_designs(self) -> FloatArray:
        """Values per excitation of a dye of each shape, shape (s, n, i)."""
        return self.designs(self.shapes.value)

    @cached_property
    def edge(self) -> FloatArray:
        """Part of an emission that light of each wavelength excites, shape (o, i)."""
        return stokes_edge(self.system.input_nm, self.system.output_nm)

    def designs(self, emissions: FloatArray) -> FloatArray:
        """Return the values per excitation of dyes of some emissions (s, o), shape (s, n, i)."""
        response = self.system.response
        # Emission that a light cannot excite is cut off at its wavelength.
        emitted = emissions[:, :, np.newaxis] * response.seen
        seen = np.tensordot(emitted, self.edge, axes=(1, 0))
        designs = response.absorbed[np.newaxis, :, np.newaxis, :] * seen[:, np.newaxis]
        return np.asarray(designs.reshape(len(emissions), -1, designs.shape[-1]))

    @cached_property
    def modes(self) -> FloatArray:
        """Deviations of the emission of each shape, shape (s, MODES, o)."""
        nm = self.system.output_nm
        count = min(MODES, len(nm))
        return np.array([emission_modes(nm, emission, count) for emission in self.shapes.value])

    @cached_property
    def deviation_designs(self) -> Callable[[int], FloatArray]:
        """Function that returns values per excitation of a shape's deviations, (MODES, n, i)."""
        return lru_cache(KEPT)(lambda shape: self.designs(self.modes[shape]))

    @cached_property
    def reflectance_part(self) -> Callable[[float], Unknowns]:
        """Function that returns the reflectance of some variation before the values."""

        def part(sigma: float) -> Unknowns:
            covariance = reflectance_covariance(self.system.output_nm, sigma)
            return Unknowns.normal(self.reflectance_design, REFLECTANCE, covariance)

        return lru_cache(KEPT)(part)

    @cached_property
    def dye_part(self) -> Callable[[int], Unknowns]:
        """Function that returns the excitation of a dye of a shape and amplitude 1."""

        def part(shape: int) -> Unknowns:
            covariance = self.excitation_covariance(shape)
            return Unknowns.normal(self.excitation_designs[shape], 0.0, covariance)

        return lru_cache(KEPT)(part)

    @cached_property
    def reflectance_variance(self) -> dict[float, FloatArray]:
        """Covariance (n, n) of the values from the reflectance, for each of its variations."""
        design = self.reflectance_design
        return {
            sigma: design @ reflectance_covariance(self.system.output_nm, sigma) @ design.T
            for sigma in REFLECTANCE_SIGMAS
        }

    @cached_property
    def background_variance(self) -> FloatArray:
        """Covariance (n, n) of the values from a background of 1/nm."""
        curve = self.system.response.seen.sum(axis=0)
        return np.asarray(np.kron(np.eye(self.system.shape[0]), np.outer(curve, curve)), np.float64)

    @cached_property
    def _excitation_covariances(self) -> dict[float, FloatArray]:
        return {
            peak: excitation_covariance(self.system.input_nm, peak)
            for peak in set(self.shapes.peak_nm.tolist())
        }

    def excitation_covariance(self, shape: int) -> FloatArray:
        """Return the covariance (i, i) of the excitation of a dye with amplitude 1."""
        return self._excitation_covariances[float(self.shapes.peak_nm[shape])]

    @cached_property
    def shape_variance(self) -> FloatArray:
        """Covariance of the values from a dye of each shape with amplitude 1, shape (s, n, n)."""
        return np.array(
            [
                design @ self.excitation_covariance(shape) @ design.T
                for shape, design in enumerate(self.excitation_designs)
            ]
        )

    @cached_property
    def deviation_variance(self) -> FloatArray:
        """The same from the deviations of its emission, shape (s, n, n)."""
        variance = np.zeros_like(self.shape_variance)
        for shape, modes in enumerate(self.modes):
            designs = self.designs(modes)
            spread = designs @ self.excitation_covariance(shape)
            variance[shape] = np.tensordot(spread, designs, axes=((0, 2), (0, 2)))
        return variance

    @cached_property
    def error_variance(self) -> FloatArray:
        """The same from errors of lights and curves, shape (s, n, n)."""
        modes = self.system.modes
        variance = np.zeros_like(self.shape_variance)
        if not len(modes.absorbed):
            return variance
        response = self.system.response
        courses_of = {
            peak: _courses(covariance) for peak, covariance in self._excitation_covariances.items()
        }
        for shape, emission in enumerate(self.shapes.value):
            courses = courses_of[float(self.shapes.peak_nm[shape])]
            # What a dye emits under unit light in each band (i, o); what is seen of it (…, i, k).
            emitted = (emission[:, np.newaxis] * self.edge).T
            seen, seen_changes = emitted @ response.seen, emitted @ modes.seen
            # By courses (c, i) of excitation, changes of the lights (z, m, i) and of the curves.
            change = modes.absorbed @ (courses[:, :, np.newaxis] * seen)[:, np.newaxis]
            change += (response.absorbed * courses[:, np.newaxis])[:, np.newaxis] @ seen_changes
            flat = change.reshape(-1, variance.shape[-1])
            variance[shape] = flat.T @ flat
        return variance

    @cached_property
    def _searched_variance(self) -> FloatArray:
        deviation = SEARCHED_DEVIATION * self.deviation_variance
        return self.shape_variance + deviation + self.error_variance

    @cached_property
    def deviation_correlation(self) -> FloatArray:
        """Correlation (i, i) of an emission's deviations when light of two wavelengths excites."""
        return deviation_correlation(self.system.input_nm)

    def scored(self, measured: Measured, most: int = MAX_FLUOROPHORES) -> list[Scored]:
        """Return the best hypotheses of each number of fluorophores.

        Unlike surfaces they are not bounded here, so that emissions deviate less from their shapes:
        else deviations of either sign stand for what a second fluorophore should explain.

        Parameters
        ----------
        measured
            Values with errors.
        most
            Largest number of fluorophores.
        """
        residual = measured.value - self.reflectance_design @ np.full(
            self.reflectance_design.shape[1], REFLECTANCE
        )
        bases = {}
        for sigma, background in product(REFLECTANCE_SIGMAS, BACKGROUND_SIGMAS):
            hypothesis = Hypothesis((), sigma, background)
            bases[hypothesis] = self.variance(hypothesis)
        none = _log_densities(measured.total + np.array(list(bases.values())), residual)
        tried = [
            Scored(hypothesis, float(density) + self.log_prior(hypothesis))
            for hypothesis, density in zip(bases, none, strict=True)
        ]
        if most == 0:
            return tried
        tried += self._with_one_more(bases, measured, residual)
        pairs = self._pairs(bases, measured, residual)
        best_single = max(candidate.log_posterior for candidate in tried)
        tried += pairs
        if pairs and pairs[0].log_posterior > best_single:
            bases = {
                candidate.hypothesis: self.variance(candidate.hypothesis)
                for candidate in pairs[:TRIPLED]
            }
            tried += self._with_one_more(bases, measured, residual)
        return tried

    def _pairs(
        self, bases: dict[Hypothesis, FloatArray], measured: Measured, residual: FloatArray
    ) -> list[Scored]:
        """Return the best hypotheses with two fluorophores.

        The best one alone is often neither of two, so that all pairs of usual shapes are tried, and
        the best of them adjusted.
        """
        usual = self._usual_shapes
        first, second = np.triu_indices(len(usual), 1)
        if not len(first):
            return []
        parts = self._searched_variance[usual]
        rough: list[tuple[float, Hypothesis]] = []
        # All reflectances come after: they hardly change which pairs are good.
        for base in list(bases)[: len(BACKGROUND_SIGMAS)]:
            for amplitudes in product(ROUGH_SIGMAS, repeat=2):
                covariance = amplitudes[0] ** 2 * parts[first] + amplitudes[1] ** 2 * parts[second]
                covariance += measured.total + bases[base]
                density = _log_densities(covariance, residual)
                for index in np.argsort(-density)[:PAIRED].tolist():
                    shapes = int(usual[first[index]]), int(usual[second[index]])
                    dyes = tuple(map(Fluorophore, shapes, amplitudes))
                    rough.append((float(density[index]), replace(base, fluorophores=dyes)))
        rough.sort(key=lambda pair: -pair[0])
        found: dict[Hypothesis, Scored] = {}
        for _, hypothesis in rough[:PAIRED]:
            for dye in hypothesis.fluorophores:
                near = self._with_another(hypothesis, dye, measured, residual)
                found.update({candidate.hypothesis: candidate for candidate in near})
                hypothesis = near[0].hypothesis
        best = sorted(found.values(), key=lambda candidate: -candidate.log_posterior)[:REFINED]
        for candidate in best:
            for base in bases:
                hypothesis = replace(base, fluorophores=candidate.hypothesis.fluorophores)
                total = measured.total + self.variance(hypothesis)
                log_posterior = float(_log_densities(total[np.newaxis], residual)[0])
                log_posterior += self.log_prior(hypothesis)
                found[hypothesis] = Scored(hypothesis, log_posterior)
        return sorted(found.values(), key=lambda candidate: -candidate.log_posterior)

    @cached_property
    def _usual_shapes(self) -> np.ndarray:
        """The most probable shape of each peak, indices (p,); a library may have none that fits."""
        free = ~self.shapes.is_measured
        peaks, log_prior = self.shapes.peak_nm[free], self.shapes.log_prior[free]
        return np.array(
            [
                np.flatnonzero(peaks == peak)[np.argmax(log_prior[peaks == peak])]
                for peak in np.unique(peaks)
            ]
        )

    def _with_another(
        self, hypothesis: Hypothesis, dye: Fluorophore, measured: Measured, residual: FloatArray
    ) -> list[Scored]:
        """Return the best hypotheses in which `dye` is another one with a near peak."""
        others = list(hypothesis.fluorophores)
        others.remove(dye)
        base = replace(hypothesis, fluorophores=tuple(others))
        away_nm = np.abs(self.shapes.peak_nm - self.shapes.peak_nm[dye.shape])
        shapes = np.flatnonzero(away_nm <= NEAR_NM)
        covariance = measured.total + self.variance(base)
        found = self._added(base, covariance, shapes, residual)[0]
        return sorted(found, key=lambda candidate: -candidate.log_posterior)

    def variance(self, hypothesis: Hypothesis) -> FloatArray:
        """Return the covariance (n, n) of the values under a hypothesis, without noise."""
        total = self.reflectance_variance[hypothesis.reflectance_sigma].copy()
        total += hypothesis.background_sigma**2 * self.background_variance
        for dye in hypothesis.fluorophores:
            total += dye.amplitude**2 * self._searched_variance[dye.shape]
        return total

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Return the logarithm of the prior probability of a hypothesis."""
        number = len(hypothesis.fluorophores)
        total = log_prior_of(number) - math.log(len(REFLECTANCE_SIGMAS) * len(BACKGROUND_SIGMAS))
        for dye in hypothesis.fluorophores:
            total += float(self.shapes.log_prior[dye.shape]) - math.log(len(EXCITATION_SIGMAS))
        # Any order of the fluorophores is the same hypothesis.
        return total + math.lgamma(number + 1)

    def _with_one_more(
        self, bases: dict[Hypothesis, FloatArray], measured: Measured, residual: FloatArray
    ) -> list[Scored]:
        """Return the best hypotheses with one fluorophore more than one of `bases`."""
        found: dict[Hypothesis, Scored] = {}
        shapes = np.arange(len(self.shapes.value))
        for base, covariance in bases.items():
            best, log_posterior = self._added(base, measured.total + covariance, shapes, residual)
            found.update({candidate.hypothesis: candidate for candidate in best})
            # The shapes that do best under the first base do best under the others.
            shapes = shapes[np.argsort(-log_posterior)[:SHORTLISTED]]
        return sorted(found.values(), key=lambda candidate: -candidate.log_posterior)

    def _added(
        self, base: Hypothesis, covariance: FloatArray, shapes: np.ndarray, residual: FloatArray
    ) -> tuple[list[Scored], FloatArray]:
        """Return the best of `base` with a fluorophore of some shapes, and how good each shape is.

        Parameters
        ----------
        base, covariance
            Hypothesis without it, and covariance (n, n) of the values under that.
        shapes
            Indices of shapes, shape (s,).
        residual
            Values minus their mean before them, shape (n,).
        """
        parts, log_prior = self._searched_variance[shapes], self.shapes.log_prior[shapes]
        density = np.array(
            [
                _log_densities(covariance + amplitude**2 * parts, residual)
                for amplitude in EXCITATION_SIGMAS
            ]
        )
        found = []
        for index in np.argsort(-(density + log_prior), axis=None)[:REFINED].tolist():
            amplitude, column = divmod(index, len(shapes))
            dye = Fluorophore(int(shapes[column]), EXCITATION_SIGMAS[amplitude])
            dyes = sorted((*base.fluorophores, dye), key=lambda fluorophore: fluorophore.shape)
            hypothesis = replace(base, fluorophores=tuple(dyes))
            log_posterior = float(density.flat[index]) + self.log_prior(hypothesis)
            found.append(Scored(hypothesis, log_posterior))
        return found, (density + log_prior).max(axis=0)


def _courses(covariance: FloatArray) -> FloatArray:
    """Return the strongest courses (c, i) of an excitation with that covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors[:, -COURSES:] * np.sqrt(np.maximum(values[-COURSES:], 0.0))).T)


def log_prior_of(fluorophores: int) -> float:
    """Return the logarithm of the prior probability of some number of fluorophores."""
    if fluorophores == 0:
        return math.log(NOT_FLUORESCENT)
    return math.log((1 - NOT_FLUORESCENT) * (1 - ONE_MORE)) + (fluorophores - 1) * math.log(
        ONE_MORE
    )


def log_sum(values: list[float]) -> float:
    """Return the logarithm of a sum of exponentials; −∞ of none."""
    return float(logsumexp(values)) if values else -math.inf


def _log_densities(covariances: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the log-density of a normal vector (n,) for each of some covariances (c, n, n)."""
    count, n = len(covariances), len(residual)
    # The last row of the factor of [[K, r], [rᵀ, ∞]] is r whitened.
    bordered = np.empty((count, n + 1, n + 1))
    bordered[:, :n, :n] = covariances
    bordered[:, n, :n] = bordered[:, :n, n] = residual
    bordered[:, n, n] = _HUGE
    lower = np.linalg.cholesky(bordered)
    whitened = lower[:, n, :n]
    log_root = np.log(np.diagonal(lower, axis1=1, axis2=2)[:, :n]).sum(axis=1)
    return np.asarray(
        -np.einsum("ci,ci->c", whitened, whitened) / 2 - log_root - n / 2 * math.log(2 * math.pi)
    )
