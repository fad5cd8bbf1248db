"""Photographs of samples under lamps beside what their matrices predict."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from labrig.analyse.card_checks import UsableLights, left_warnings, usable_lights
from labrig.analyse.chart_scene import camera_matrix
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.lit_patches import LitPatch, lit_patches
from labrig.bench_optics import (
    LightSource,
    camera_curves,
    card_reflectance,
    illuminant_sources,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import Contradiction, ResultWarning
from labrig.optics import CameraResponse, is_narrow
from labrig.protocols.steps.led_scenes import CARD
from labrig.protocols.validate_illuminants.analysis.colours import (
    ODD_CHART,
    ColourScale,
    chart_matrix,
    chart_values,
    difference,
)
from labrig.protocols.validate_illuminants.analysis.prediction import (
    PredictedValues,
    matrices_of,
    predicted_values,
    with_scales_of_samples,
)
from labrig.protocols.validate_illuminants.protocol import SAMPLE, IlluminantFrames
from labrig.protocols.validate_illuminants.result import ValidateIlluminantsResult
from labrig.results import LampComparison, LampPatch, MatrixOnBands, SeenColour, ValidatedSample

#: Mean χ² per channel and pull from which photographs differ from their predictions.
ODD_CHI2, ODD_PULL = 2.0, 4.0


def analyse(context: AnalysisContext) -> ValidateIlluminantsResult:
    """Compare photographs under each lamp with predictions.

    Raises
    ------
    UsageError
        The rig file lacks a lamp, or the curves of camera or card; or the protocol names no
        matrices, or those of other patches.
    DataError
        Frames are missing or damaged, no lamp can be used, or there is no colour chart where one is
        expected.
    """
    protocol, names = context.protocol, context.protocol.lamps
    matrices = matrices_of(protocol)
    lights = illuminant_sources(context.rig, "rig.yaml")
    if unknown := [lamp for lamp in names if lamp not in lights]:
        raise UsageError(f"rig.yaml: expected lamps called {', '.join(unknown)}, got none")
    camera, white = (
        camera_curves(context.rig, context.overrides.camera),
        card_reflectance(context.rig),
    )
    cards = lit_patches(context, IlluminantFrames.CARD, CARD, names)
    samples = lit_patches(context, IlluminantFrames.SAMPLE, SAMPLE, names)
    spectra = {name: lights[name].light for name in names}
    usable = usable_lights(names, spectra, camera, white, cards, samples, "lamp")
    warnings = usable.warnings
    warnings += left_warnings("card", cards, names, "lamp")
    warnings += left_warnings("samples", samples, names, "lamp")
    if not usable.by_row:
        reasons = "; ".join(map(str, usable.left_out))
        raise DataError(f"expected a lamp that can be used, got none: {reasons}")
    rows, used = list(usable.by_row), list(usable.by_row.values())
    cards = {name: card.under(rows).without_rest() for name, card in cards.items()}
    samples = {name: sample.under(rows).without_rest() for name, sample in samples.items()}
    lamps = [lights[name] for name in used]
    predicted = with_scales_of_samples(
        {
            name: predicted_values(matrix, lamps, camera, white, cards[name])
            for name, matrix in matrices.items()
        },
        samples,
        cards,
    )
    colours = _colours(context, lights, camera, usable, next(iter(predicted.values())).white)
    warnings += _chart_warnings(colours)
    compared = {
        lamp: _lamp(row, lamps[row], samples, cards, predicted, colours)
        for row, lamp in enumerate(used)
    }
    warnings += _verdict_warnings(compared)
    regions = context.overrides.patches(protocol)
    without_sigma = tuple(
        name
        for name, matrix in matrices.items()
        if matrix.reflectance_sigma is None or matrix.reradiation_sigma is None
    )
    return ValidateIlluminantsResult(
        channels=camera.channels,
        fluorescence=_origin(protocol.fluorescence),
        without_matrix_sigma=without_sigma,
        samples={
            name: ValidatedSample(regions[name], MatrixOnBands.of(matrix))
            for name, matrix in matrices.items()
        },
        balance=colours.balance,
        colours_from=colours.source,
        chart_delta_e=colours.chart_delta_e,
        lamps=compared,
        warnings=tuple(warnings),
    )


@dataclass(frozen=True, eq=False)
class _Colours:
    """Conversion of the camera's values into colours.

    `matrices` are those by lamp; `balance` is the lamp whose white is white, with X, Y, Z
    `white_xyz` on the scale of its matrix.
    """

    balance: str
    white_xyz: FloatArray
    matrices: Mapping[str, FloatArray]
    source: Literal["curves", "chart"]
    chart_delta_e: tuple[float, float] | None


def _colours(
    context: AnalysisContext,
    lights: Mapping[str, LightSource],
    camera: CameraResponse,
    usable: UsableLights,
    white: FloatArray,
) -> _Colours:
    named, used = context.protocol.balanced, list(usable.by_row.values())
    # A chart shows the light in which it was photographed, whatever its name.
    balance = usable.light_of.get(named, named) if context.protocol.chart else named
    if balance not in used:
        raise DataError(
            f"the lamp '{balance}', in whose light white is to be white, cannot be used; name "
            f"another one as 'balance' ({', '.join(used)})"
        )
    light = lights[balance].light
    if is_narrow(light):
        raise UsageError(
            f"the lamp '{balance}' has no white; name a lamp of white light as 'balance'"
        )
    if context.protocol.chart:
        matrix, off = chart_matrix(chart_values(context, named), light)
        white_xyz = matrix @ white[used.index(balance)]
        return _Colours(balance, white_xyz, dict.fromkeys(used, matrix), "chart", off)
    matrices = {
        lamp: camera_matrix(camera, None if is_narrow(lights[lamp].light) else lights[lamp].light)
        for lamp in used
    }
    white_xyz = matrices[balance] @ white[used.index(balance)]
    return _Colours(balance, white_xyz, matrices, "curves", None)


def _lamp(
    row: int,
    lamp: LightSource,
    samples: Mapping[str, LitPatch],
    cards: Mapping[str, LitPatch],
    predicted: Mapping[str, PredictedValues],
    colours: _Colours,
) -> LampComparison:
    has_white = bool(next(iter(predicted.values())).is_scaled[row]) and not is_narrow(lamp.light)
    matrix = colours.matrices[lamp.light.name]
    every = np.array([values.whole[row] for values in predicted.values()])
    exposed = ColourScale.exposed(matrix, every, colours.white_xyz)
    patches = {}
    for number, (name, values) in enumerate(predicted.items()):
        scale = (
            ColourScale.under(matrix, values.white[row], colours.white_xyz)
            if has_white
            else exposed
        )
        patches[name] = _patch(row, samples[name], cards[name], values, scale, (row, number))
    chi2 = float(np.mean([patch.reduced_chi2 for patch in patches.values()]))
    pulls = np.concatenate([patch.pull for patch in patches.values()])
    largest = float(pulls[np.abs(pulls).argmax()])
    first = next(iter(predicted.values()))
    return LampComparison(
        spectrum_nm=lamp.light.wavelength_nm,
        spectrum=lamp.light.value,
        brightness=float(first.brightness[row]),
        scale="card" if first.is_scaled[row] else "samples",
        white="lamp" if has_white else "D65",
        reduced_chi2=chi2,
        largest_pull=largest,
        verdict="differs" if chi2 > ODD_CHI2 or abs(largest) > ODD_PULL else "agrees",
        patches=patches,
    )


def _patch(
    row: int,
    sample: LitPatch,
    card: LitPatch,
    predicted: PredictedValues,
    scale: ColourScale,
    seed: tuple[int, int],
) -> LampPatch:
    value, variance = sample.value[row], sample.variance[row]
    whole, reflected = predicted.whole[row], predicted.reflected[row]
    covariance = predicted.covariance[row] + sample.covariance[row]
    residual = value - whole
    delta, by_errors = difference(scale, value, whole, covariance, seed)
    without, _ = difference(scale, value, reflected, covariance, (*seed, 1))

    def colour(values: FloatArray) -> SeenColour:
        return SeenColour(scale.lab(values), scale.picture_xyz(values))

    return LampPatch(
        value=value,
        sigma=np.sqrt(variance),
        card=card.value[row],
        card_sigma=np.sqrt(card.variance[row]),
        predicted=whole,
        predicted_sigma=np.sqrt(np.diagonal(predicted.covariance[row])),
        reflected=reflected,
        pull=residual / np.sqrt(np.diagonal(covariance)),
        reduced_chi2=float(residual @ np.linalg.solve(covariance, residual)) / len(value),
        measured=colour(value),
        whole=colour(whole),
        reflected_only=colour(reflected),
        reradiated_only=colour(predicted.reradiated[row]),
        delta_e=delta,
        delta_e_by_errors=by_errors,
        delta_e_reflected=without,
    )


def _chart_warnings(colours: _Colours) -> Iterator[ResultWarning]:
    """Yield a warning if what was taken for a colour chart has other colours."""
    off = colours.chart_delta_e
    if off is not None and off[0] > ODD_CHART:
        yield Contradiction(
            "chart-unusual",
            "its patches are {delta_e:.1f} off in ΔE2000 on average; it is no ColorChecker of 24 "
            "patches or unevenly lit, or '{lamp}' is not the rig file's lamp",
            subject="chart",
            delta_e=off[0],
            lamp=colours.balance,
        )


def _verdict_warnings(lamps: Mapping[str, LampComparison]) -> Iterator[ResultWarning]:
    """Yield a warning for each lamp under which photographs differ from their predictions."""
    for lamp, comparison in lamps.items():
        if comparison.verdict == "differs":
            patches = comparison.patches
            worst = max(patches, key=lambda name: float(np.abs(patches[name].pull).max()))
            yield Contradiction(
                "photographs-differ",
                "photographs differ from their predictions by more than their errors (mean χ² per "
                "channel {reduced_chi2:.1f}); most does {worst}, by {most_sigmas:.1f} σ",
                subject=lamp,
                reduced_chi2=comparison.reduced_chi2,
                worst=worst,
                most_sigmas=abs(comparison.largest_pull),
            )


def _origin(named: str | dict[str, str]) -> str:
    if isinstance(named, str):
        return f"run {Path(named).name}"
    return "materials " + ", ".join(f"{Path(file).stem} ({name})" for name, file in named.items())
