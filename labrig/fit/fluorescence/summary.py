"""Dyes of drawn surfaces, and what is to be known before an estimate is used."""

import math
from collections.abc import Sequence

import numpy as np

from labrig.fit.fluorescence.posterior import Draws
from labrig.fit.fluorescence.result import (
    EstimatedFluorophore,
    EstimateFact,
    ExtrapolatedExcitation,
    MoreThanWhite,
    Surfaces,
    UnexplainedValues,
    UnknownBrightness,
)
from labrig.fit.fluorescence.system import FluorescenceSystem
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum, edges_from_centres

#: Part of the re-radiation excited in bands without light from which that is a fact to know.
MUCH = 0.1
#: Reduced χ² that is a fact to know: of few degrees of freedom it scatters.
LARGE_CHI2 = 3.0
#: Fraction of light that may come back, as `labrig.material.physical_warnings` has it.
LARGEST_FRACTION, SIGMAS = 1.1, 3.0


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
    if mean[worst] > LARGEST_FRACTION + SIGMAS * sigma[worst]:
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
