"""The estimate of a re-radiation matrix, by either method.

The joint one takes all lights at once: one to three dyes, each with one emission that all lights
excite alike. Hypotheses are weighed by their evidence, the best of them again with surfaces bounded
to what is not negative, and the estimate is the mean of surfaces drawn from all that are left. In
159 estimates of 53 measured surfaces that only reflect, no fluorescence was found
(`tests/acceptance/led_matrices.py --dark`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from labrig.fit.fluorescence.hypotheses import (
    REFINED,
    Hypotheses,
    Hypothesis,
    Measured,
    Scored,
    log_prior_of,
    log_sum,
)
from labrig.fit.fluorescence.per_led import fit_per_led
from labrig.fit.fluorescence.posterior import Draws, Posterior, facts_of, fluorophores_of
from labrig.fit.fluorescence.result import (
    FluorescenceFit,
    FluorophoreNumber,
    Method,
    Surfaces,
)
from labrig.fit.fluorescence.surface_prior import (
    EDGE_NM,
    LOG_EDGE_SIGMA,
    emission_shapes,
    stokes_edge,
)
from labrig.fit.fluorescence.system import (
    UNKNOWN,
    FluorescenceSystem,
    checked_values,
    require_scale,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum

DRAWS = 200
#: Log-probability below the best at which a hypothesis is dropped.
HOPELESS = 9.0
#: Number of hypotheses with each likely number of fluorophores that are drawn from.
SCATTERED = 60
#: Power of the evidence by which hypotheses with fluorophores are weighed. It rests on shapes that
#: no dye has exactly, and would choose too surely among those that are about as good.
TEMPER = 0.5
#: Least part of the draws that have fluorophores: photographs that show none allow for faint ones,
#: and the evidence against them rests on their prior's strength.
UNSEEN_DYES = 0.03
#: Part of the largest re-radiation that any entry may have beside all shapes: measured emissions
#: have 1 to 2 % of their maximum far from it.
UNSHAPED = 0.02
#: What bands of 10 nm leave out: relative error of a value, and relative to the largest.
RELATIVE_ERROR, ABSOLUTE_ERROR = 1e-3, 2e-4
#: Reduced χ² that correct errors hardly exceed, and how often errors are made larger where it does.
LARGE_CHI2, ROUNDS = 2.0, 2
#: Relative error of a value under a light of unknown brightness: of camera curves that were not
#: measured on this body, and of an emission that is only like its shape.
LOOSE_COLOUR = 0.1
#: Relative error of a value before the errors of lights and curves are known for a surface.
CRUDE_ERROR = 0.03


class JointEstimator:
    """Estimates of many surfaces under the same lights, which share most of the work.

    Parameters
    ----------
    system
        Lights and camera.
    library
        Measured emissions of dyes, on any scale: the surface may have one of them.

    Raises
    ------
    UsageError
        No light has a known brightness, or an emission is not positive or lies outside of the
        output bands.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import Exposure, JointEstimator, fluorescence_system
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(f"{nm}nm")) for nm in (405, 450, 475, 500, 520, 560, 620)]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> emission = np.exp(-(((system.output_nm - 520) / 25) ** 2) / 2)
    >>> excitation = np.exp(-(((system.input_nm - 460) / 40) ** 2) / 2)
    >>> dye = 0.005 * np.outer(emission, excitation) * system.is_stokes
    >>> value = system.values(np.full(41, 0.3), dye)
    >>> fit = JointEstimator(system).fit("dye", value, (0.002 * value) ** 2 + 1e-12)
    >>> max(fit.numbers, key=lambda one: one.probability).fluorophores
    1
    >>> peak = fit.fluorophores[0].emission
    >>> float(peak.wavelength_nm[peak.value.argmax()])
    520.0
    """

    def __init__(self, system: FluorescenceSystem, library: Sequence[Spectrum] = ()) -> None:
        require_scale(system)
        self._common = Hypotheses(system, emission_shapes(system.output_nm, library))

    def fit(
        self, name: str, value: ArrayLike, variance: ArrayLike, seed: int = 0
    ) -> FluorescenceFit:
        """Estimate the matrix of a surface.

        Parameters
        ----------
        name
            Name of the surface.
        value, variance
            Values under each light and their variances, shape (m, k).
        seed
            Seed of the draws: the same values give the same matrix.

        Returns
        -------
        FluorescenceFit
            The matrix with its uncertainty.

        Raises
        ------
        UsageError
            Shapes disagree, a value is not finite, or a variance is not above 0.
        """
        system = self._common.system
        values, variances = checked_values(system, value, variance)
        scale = system.brightness[:, np.newaxis]
        target = (values / scale).ravel()
        measured = self._measured(target, (variances / scale**2).ravel())
        weighted = self._refined(measured)
        reduced = weighted[0].posterior.reduced_chi2()
        misfit = reduced
        for _ in range(ROUNDS):
            if not misfit > LARGE_CHI2:
                break
            # No surface explains the values: their errors must be larger than is known.
            measured = replace(measured, misfit=measured.misfit * misfit)
            weighted = self._refined(measured)
            misfit = weighted[0].posterior.reduced_chi2()
        rng = np.random.default_rng(seed)
        drawn = self._drawn(weighted, rng)
        numbers = self._numbers(weighted)
        likely = max(numbers, key=lambda number: number.probability).fluorophores

        reradiation = np.concatenate([draws.reradiation.sum(axis=1) for _, draws in drawn])
        edge_nm = EDGE_NM * np.exp(LOG_EDGE_SIGMA * rng.standard_normal(len(reradiation)))
        for surface, nm in zip(reradiation, edge_nm, strict=True):
            surface *= stokes_edge(system.input_nm, system.output_nm, float(nm))
        surfaces = Surfaces(
            np.concatenate([draws.reflectance for _, draws in drawn]),
            reradiation.astype(np.float32),
        )
        matrix = ReradiationMatrix(
            name,
            system.input_nm,
            system.output_nm,
            surfaces.reflectance.mean(axis=0),
            reradiation.mean(axis=0),
            surfaces.reflectance.std(axis=0, ddof=1),
            np.hypot(
                reradiation.std(axis=0, ddof=1),
                UNSHAPED * reradiation.mean(axis=0).max() * system.is_stokes,
            ),
        )
        predicted = system.values(matrix.reflectance, matrix.reradiation)
        residual = target - predicted.ravel()
        pull = (residual / weighted[0].posterior.sigma).reshape(system.shape)
        is_extrapolated = ~system.is_lit
        dyes = [draws for hypothesis, draws in drawn if len(hypothesis.fluorophores) == likely]
        return FluorescenceFit(
            method="joint",
            matrix=matrix,
            is_extrapolated=is_extrapolated,
            fluorophores=fluorophores_of(system, dyes) if likely else (),
            numbers=numbers,
            predicted=predicted * scale,
            pull=pull,
            reduced_chi2=reduced,
            facts=facts_of(system, matrix, surfaces, pull, reduced),
            surfaces=surfaces,
        )

    def _measured(self, target: FloatArray, variance: FloatArray) -> Measured:
        """Return values per brightness (n,) with all errors that do not depend on the dyes."""
        system = self._common.system
        floor = (RELATIVE_ERROR * target) ** 2 + (ABSOLUTE_ERROR * np.abs(target).max()) ** 2
        noise = np.diag(variance + floor)
        channels = system.shape[1]
        for light in np.flatnonzero(system.is_loose).tolist():
            # Any multiple of its values is as probable, and of their errors by curves and emission,
            # which are added here: those of a surface that is hardly excited would hold it there.
            seen = np.zeros_like(target)
            seen[light * channels : (light + 1) * channels] = 1.0
            seen *= target
            noise += UNKNOWN**2 * np.outer(seen, seen) + np.diag((LOOSE_COLOUR * seen) ** 2)
        measured = Measured(target, noise, np.zeros_like(noise))
        if not len(system.modes.reflected):
            return measured
        crude = replace(measured, noise=noise + np.diag((CRUDE_ERROR * target) ** 2))
        best = max(self._common.scored(crude, 0), key=lambda candidate: candidate.log_posterior)
        surface = Posterior(self._common, best.hypothesis, crude).most_likely()
        return replace(measured, reflected_noise=system.covariance(*surface))

    def _refined(self, measured: Measured) -> "list[_Weighted]":
        """Return the best hypotheses, the most probable one first."""
        by_number: dict[int, list[Scored]] = {}
        for candidate in self._common.scored(measured):
            by_number.setdefault(len(candidate.hypothesis.fluorophores), []).append(candidate)
        ranked = {
            number: sorted(scored, key=lambda candidate: -candidate.log_posterior)
            for number, scored in by_number.items()
        }
        found = {
            number: [self._weighted(candidate, measured) for candidate in scored[:REFINED]]
            for number, scored in ranked.items()
        }
        best = {n: max(each.log_posterior for each in those) for n, those in found.items()}
        for number, scored in ranked.items():
            # The scatter of all that are about as good is the error of the shapes.
            if best[number] > max(best.values()) - HOPELESS:
                others = scored[REFINED:SCATTERED]
                found[number] += [self._weighted(candidate, measured) for candidate in others]
        every = [candidate for those in found.values() for candidate in those]
        return sorted(every, key=lambda candidate: -candidate.log_posterior)

    def _weighted(self, candidate: Scored, measured: Measured) -> "_Weighted":
        posterior = Posterior(self._common, candidate.hypothesis, measured)
        log_prior = self._common.log_prior(candidate.hypothesis)
        return _Weighted(candidate.hypothesis, posterior, posterior.log_evidence(), log_prior)

    def _numbers(self, weighted: "Sequence[_Weighted]") -> tuple[FluorophoreNumber, ...]:
        total = log_sum([candidate.log_posterior for candidate in weighted])
        numbers = []
        for number in sorted({len(candidate.hypothesis.fluorophores) for candidate in weighted}):
            those = [
                candidate
                for candidate in weighted
                if len(candidate.hypothesis.fluorophores) == number
            ]
            posterior = log_sum([candidate.log_posterior for candidate in those])
            numbers.append(
                FluorophoreNumber(
                    number, posterior - log_prior_of(number), math.exp(posterior - total)
                )
            )
        return tuple(numbers)

    def _drawn(
        self,
        weighted: "Sequence[_Weighted]",
        rng: np.random.Generator,
    ) -> list[tuple[Hypothesis, Draws]]:
        kept: list[_Weighted] = []
        weight: list[float] = []
        least = -math.inf
        for has_dyes in (False, True):
            those = [each for each in weighted if bool(each.hypothesis.fluorophores) == has_dyes]
            whole = max(log_sum([each.log_posterior for each in those]), least)
            least = whole + math.log(UNSEEN_DYES)
            tempered = [TEMPER * each.log_posterior for each in those]
            kept += those
            weight += [whole + each - log_sum(tempered) for each in tempered]
        relative = np.array(weight) - max(weight)
        probability = np.where(relative > -HOPELESS, np.exp(relative), 0.0)
        counts = rng.multinomial(DRAWS, probability / probability.sum())
        return [
            (candidate.hypothesis, candidate.posterior.draw(int(count), rng))
            for candidate, count in zip(kept, counts, strict=True)
            if count
        ]


@dataclass(frozen=True, eq=False)
class _Weighted:
    hypothesis: Hypothesis
    posterior: Posterior
    log_evidence: float
    log_prior: float

    @property
    def log_posterior(self) -> float:
        return self.log_evidence + self.log_prior


def fit_fluorescence(
    name: str,
    value: ArrayLike,
    variance: ArrayLike,
    system: FluorescenceSystem,
    method: Method = "joint",
    library: Sequence[Spectrum] = (),
    seed: int = 0,
) -> FluorescenceFit:
    """Estimate the re-radiation matrix of a surface from its values under several lights.

    For many surfaces under the same lights, `JointEstimator` does the common work once.

    Parameters
    ----------
    name
        Name of the surface.
    value, variance
        Values of each channel under each light, without dark level and afterglow, and their
        variances, shape (m, k).
    system
        Lights and camera.
    method
        "joint" fits all lights at once and knows its uncertainty, "per-led" fits two Gaussians
        under each, as the thesis does.
    library
        Measured emissions that the surface may have; of the joint method.
    seed
        Seed of the draws of the joint method.

    Returns
    -------
    FluorescenceFit
        The matrix.

    Raises
    ------
    UsageError
        Shapes disagree, a value is not finite, a variance is not above 0, or there is no such
        method.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import Exposure, fit_fluorescence, fluorescence_system
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(f"{nm}nm")) for nm in (420, 450, 480, 520, 560, 600, 640)]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> value = system.values(np.full(41, 0.3), np.zeros((41, 49)))
    >>> fit = fit_fluorescence("grey", value, (0.001 * value) ** 2 + 1e-12, system)
    >>> fit.numbers[0].fluorophores, fit.numbers[0].probability > 0.9
    (0, True)
    >>> [round(float(rho), 2) for rho in fit.matrix.reflectance[5:26:10]]
    [0.3, 0.3, 0.3]
    """
    if method == "joint":
        return JointEstimator(system, library).fit(name, value, variance, seed)
    if method == "per-led":
        return fit_per_led(name, value, variance, system)
    raise UsageError(f"expected the method joint or per-led, got '{method}'")
