"""Prediction of what a camera sees of a sample's matrix under lamps, and its errors.

Errors are those of the system (lamps' spectra, camera's curves, card), as the card leaves them, and
of the matrix. A result keeps σ of each number of the matrix only; neighbouring numbers are taken to
err together, over the distances below, as their estimates do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labrig.analyse.lit_patches import CARD_COURSE, CARD_SIGMA, LitPatch, exposure_of
from labrig.bench_optics import LightSource
from labrig.fit.fluorescence import FluorescenceSystem, fluorescence_system
from labrig.fit.leds import CURVES_OF_MODEL
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, read_any_material
from labrig.optics import CameraResponse, Transmittance
from labrig.results import read_result

#: Least light of the card, over that under the brightest lamp, each per power of the lamp, from
#: which the card tells how bright a lamp is. A dark one shows the tails of its spectrum.
VISIBLE = 0.01
#: Distances in nm at which errors of the matrix' numbers are independent.
REFLECTANCE_NM, EMISSION_NM, EXCITATION_NM = 60.0, 40.0, 60.0
#: Relative σ of the reflected light of a lamp of which the camera sees the tails only.
TAIL_SIGMA = 0.3
#: Variance, relative to the largest value's square, that stands for "not measured".
UNMEASURED = 1e6


@dataclass(frozen=True, eq=False)
class PredictedValues:
    """Values of a sample under m lamps, in k channels.

    Attributes
    ----------
    reflected, reradiated
        What is reflected and what is re-radiated, in DN/s, shape (m, k); under a lamp that the card
        does not show, the latter per brightness.
    covariance
        Covariance of their sum under each lamp, shape (m, k, k).
    white
        Values of a perfect white, shape (m, k).
    brightness
        Brightness of each lamp; 1 where it is not known, shape (m,).
    is_scaled
        Whether the card tells the brightness, shape (m,), bool.
    """

    reflected: FloatArray
    reradiated: FloatArray
    covariance: FloatArray
    white: FloatArray
    brightness: FloatArray
    is_scaled: np.ndarray

    @property
    def whole(self) -> FloatArray:
        """All of the light, shape (m, k)."""
        return self.reflected + self.reradiated


def predicted_values(
    matrix: ReradiationMatrix,
    lamps: Sequence[LightSource],
    camera: CameraResponse,
    white: Transmittance,
    card: LitPatch,
) -> PredictedValues:
    """Return the values of a matrix where a card was photographed under the same lamps.

    Parameters
    ----------
    matrix
        The sample's matrix; what was not measured of its re-radiation counts as 0.
    lamps
        The lamps.
    camera, white
        Curves of the camera, and reflectance of the card.
    card
        Values of the card in the sample's place.
    """
    exposures = [exposure_of(lamp) for lamp in lamps]
    bare = fluorescence_system(
        exposures, camera, CURVES_OF_MODEL, matrix.input_nm, matrix.output_nm
    )
    of_card = (bare.response.reflected @ white.at(bare.output_nm)).max(axis=1)
    is_scaled = np.asarray(of_card > VISIBLE * of_card.max())
    unmeasured = UNMEASURED * max(float(np.square(card.value).max()), 1e-12)
    variance = np.where(is_scaled[:, np.newaxis], card.variance, unmeasured)
    informed = bare.informed_by_white(card.value, variance, white, CARD_SIGMA, CARD_COURSE)
    system = informed.with_drift(card.flicker)
    reflectance, reradiation = _measured(matrix)
    dark = np.zeros_like(reradiation)
    scale = np.where(is_scaled, system.brightness, 1.0)[:, np.newaxis]
    reflected = scale * system.values(reflectance, dark)
    reradiated = scale * system.values(np.zeros_like(reflectance), reradiation)
    m, k = system.shape
    both = system.covariance(reflectance, reradiation) + _of_reflectance(matrix, system)
    alone = system.covariance(np.zeros_like(reflectance), reradiation)
    # What is reflected of tails of a spectrum has another error, see `with_scales_of_samples`.
    kinds = [
        np.einsum("mkml->mkl", (kind + _of_reradiation(matrix, system)).reshape(m, k, m, k))
        for kind in (both, alone)
    ]
    by_lamp = np.where(is_scaled[:, np.newaxis, np.newaxis], *kinds)
    covariance = by_lamp * scale[:, :, np.newaxis] ** 2
    tails = _tails(system, reflectance, white) * card.value
    reflected = np.where(is_scaled[:, np.newaxis], reflected, tails)
    seen_white = scale * (system.response.reflected @ np.ones_like(reflectance))
    return PredictedValues(reflected, reradiated, covariance, seen_white, scale[:, 0], is_scaled)


def with_scales_of_samples(
    predicted: Mapping[str, PredictedValues],
    samples: Mapping[str, LitPatch],
    cards: Mapping[str, LitPatch],
) -> dict[str, PredictedValues]:
    """Return predictions in which lamps that the card does not show have one scale for all samples.

    The scale is the most likely one; an even lamp is taken to shine as unevenly as the others.
    """
    first = next(iter(predicted.values()))
    evenness = _evenness(cards, first.is_scaled)
    found = {name: _copied(values) for name, values in predicted.items()}
    for row in np.flatnonzero(~first.is_scaled).tolist():
        weighted = []
        for name, values in predicted.items():
            unit = evenness[name] * values.reradiated[row]
            left = samples[name].value[row] - values.reflected[row]
            variance = samples[name].variance[row] + np.square(TAIL_SIGMA * values.reflected[row])
            spread = evenness[name] ** 2 * np.diagonal(values.covariance[row])
            weighted.append((unit, left, variance, spread))
        brightness = _scale(weighted)
        for name, values in found.items():
            factor = brightness * evenness[name]
            values.reradiated[row] *= factor
            values.brightness[row] = brightness
            values.covariance[row] *= factor**2
            values.covariance[row] += np.diag(np.square(TAIL_SIGMA * values.reflected[row]))
    return found


def _scale(weighted: Sequence[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]) -> float:
    """Return the scale of unit values, with their own errors, that explains what is left."""
    brightness = 0.0
    for _ in range(5):
        numerator = denominator = 0.0
        for unit, left, variance, spread in weighted:
            weight = 1 / (variance + brightness**2 * spread)
            numerator += float((weight * unit * left).sum())
            denominator += float((weight * unit * unit).sum())
        brightness = max(numerator / denominator, 0.0) if denominator > 0 else 0.0
    return brightness


def _copied(values: PredictedValues) -> PredictedValues:
    return PredictedValues(
        values.reflected,
        values.reradiated.copy(),
        values.covariance.copy(),
        values.white,
        values.brightness.copy(),
        values.is_scaled,
    )


def _evenness(cards: Mapping[str, LitPatch], is_scaled: np.ndarray) -> dict[str, float]:
    """Return the light at each patch over that at all of them, by the lamps that the card shows."""
    if not is_scaled.any():
        return dict.fromkeys(cards, 1.0)
    light = {name: card.value[is_scaled].sum(axis=1) for name, card in cards.items()}
    mean = np.mean(list(light.values()), axis=0)
    return {name: float(np.median(each / mean)) for name, each in light.items()}


def _measured(matrix: ReradiationMatrix) -> tuple[FloatArray, FloatArray]:
    """Return reflectance and re-radiation with values where they were not measured."""
    known = ~np.isnan(matrix.reflectance)
    reflectance = np.interp(matrix.output_nm, matrix.output_nm[known], matrix.reflectance[known])
    reradiation = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation), 0.0)
    return reflectance, reradiation


def _tails(system: FluorescenceSystem, reflectance: FloatArray, white: Transmittance) -> FloatArray:
    """Return what a sample reflects of unknown visible light over what the card does, (k,)."""
    seen = system.response.seen
    return np.asarray((reflectance @ seen) / (white.at(system.output_nm) @ seen))


def _of_reflectance(matrix: ReradiationMatrix, system: FluorescenceSystem) -> FloatArray:
    """Return the covariance (mk, mk) of the values per brightness by errors of the reflectance."""
    m, k = system.shape
    if matrix.reflectance_sigma is None:
        return np.zeros((m * k, m * k))
    sigma = np.nan_to_num(matrix.reflectance_sigma)[:, np.newaxis]
    root = sigma * _root(matrix.output_nm, REFLECTANCE_NM)
    change = (system.response.reflected @ root).reshape(m * k, -1)
    return np.asarray(change @ change.T)


def _of_reradiation(matrix: ReradiationMatrix, system: FluorescenceSystem) -> FloatArray:
    """Return the covariance (mk, mk) of the values per brightness by errors of re-radiation."""
    m, k = system.shape
    if matrix.reradiation_sigma is None:
        return np.zeros((m * k, m * k))
    sigma = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation_sigma), 0.0)
    by_output = _root(matrix.output_nm, EMISSION_NM)
    by_input = _root(matrix.input_nm, EXCITATION_NM)
    seen = system.response.seen[:, np.newaxis, :] * by_output[:, :, np.newaxis]
    absorbed = system.response.absorbed[:, :, np.newaxis] * by_input
    change = np.einsum("oak,oi,mib->mkab", seen, sigma, absorbed, optimize=True)
    change = change.reshape(m * k, -1)
    return np.asarray(change @ change.T)


def _root(nm: FloatArray, correlation_nm: float) -> FloatArray:
    """Return a root (n, r) of the correlation between wavelengths."""
    off = (nm[:, np.newaxis] - nm) / correlation_nm
    values, vectors = np.linalg.eigh(np.exp(-(off**2) / 2))
    kept = values > 1e-6 * values.max()
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


def matrices_of(protocol: Any) -> dict[str, ReradiationMatrix]:
    """Return the matrix of each patch that the protocol's key `fluorescence` names.

    Raises
    ------
    UsageError
        None is named, the run is none of led_fluorescence or has other patches, or a material does
        not fluoresce or is relative.
    """
    named = protocol.fluorescence
    if named is None:
        raise UsageError(
            "expected 'fluorescence:' in the protocol, a run of led_fluorescence or a material for "
            "each patch; add it to the run's protocol.yaml, then process the run again"
        )
    if isinstance(named, str):
        return _of_run(named, list(protocol.patches))
    return {name: _of_material(named[name]) for name in protocol.patches}


def _of_run(run: str, patches: list[str]) -> dict[str, ReradiationMatrix]:
    result = read_result(Path(run))
    matrices = result.provides().get("matrices")
    if matrices is None:
        raise UsageError(f"{run}: expected a run of led_fluorescence, got one of {result.kind}")
    if missing := [name for name in patches if name not in matrices]:
        raise UsageError(
            f"{run}: expected a patch '{missing[0]}', got {', '.join(matrices) or 'none'}; "
            "give the patches the names that they had there"
        )
    return {name: matrices[name].named(name) for name in patches}


def _of_material(named: str) -> ReradiationMatrix:
    material = read_any_material(named)
    if not isinstance(material, ReradiationMatrix):
        raise UsageError(f"{named}: expected a fluorescent material, got a phosphor")
    if material.unit == "relative":
        raise UsageError(
            f"{named}: its re-radiation is relative, so that nothing can be predicted; expected "
            "fractions of the incident light"
        )
    return material
