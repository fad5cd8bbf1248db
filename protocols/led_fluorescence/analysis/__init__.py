"""Re-radiation matrices of the patches of a fluorescence run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from labrig.analyse.card_checks import (
    UsableLights,
    bleaching_warnings,
    fact_warnings,
    left_warnings,
    per_led_warnings,
    usable_lights,
)
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.lit_patches import LightKind, LitPatch, lit_patches, lit_system, mean_of
from labrig.bench_optics import (
    LightSource,
    camera_curves,
    card_reflectance,
    illuminant_sources,
    led_sources,
)
from labrig.calibration import LEDS_KIND
from labrig.fit.fluorescence import (
    EstimatedFluorophore,
    FluorescenceFit,
    FluorescenceSystem,
    JointEstimator,
    fit_per_led,
    predicted_colour,
)
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.material import appearance, read_emissions
from labrig.optics import CameraResponse, Spectrum, Transmittance, delta_e, read_light
from labrig.protocols.led_fluorescence.analysis.methods import (
    direct_measurement,
    method_differences,
    missing_samples,
    mixture_of,
    reradiation_under_lights,
)
from labrig.protocols.led_fluorescence.options import LedFluorescenceOptions
from labrig.protocols.led_fluorescence.protocol import SAMPLE, LedFrames
from labrig.protocols.led_fluorescence.result import LedFluorescenceResult
from labrig.protocols.steps.led_scenes import CARD
from labrig.results import (
    ColourUnderLight,
    DirectMeasurement,
    EstimateMethod,
    FluorescentPatch,
    MatrixOnBands,
    Measured,
    MeasuredDye,
)

#: Lights under which colours are told.
LIGHTS = ("D65", "A", "FL2")
#: Peak in nm below which light is ultraviolet.
ULTRAVIOLET_NM = 400.0
#: Part of an LED's strongest input band from which another one counts as lit by it.
LIT = 0.1
#: ΔE2000 from which a colour depends on what lights of unknown brightness excite, if they excite a
#: dye as much as a strong one would be.
DEPENDS, EXCITED = 0.5, 0.5


def analyse(context: AnalysisContext) -> LedFluorescenceResult:
    """Estimate the re-radiation matrix of each patch.

    Raises
    ------
    UsageError
        The rig file lacks an LED or a lamp, or the curves of camera or card, or names an emission
        library or a direct measurement that is none.
    DataError
        Frames are missing or damaged, or fewer than two LEDs can be used.
    """
    lights = _lights(context)
    camera, white = (
        camera_curves(context.rig, context.overrides.camera),
        card_reflectance(context.rig),
    )
    lit = _lit(context, lights, camera, white)
    warnings = list(lit.warnings)
    card = mean_of(lit.cards)
    system = lit_system([lights[led] for led in lit.used], camera, white, card)
    only_leds = system
    if lit.lamps:
        by_led = range(len(lit.used) - len(lit.lamps))
        of_leds = [lights[lit.used[row]] for row in by_led]
        only_leds = lit_system(of_leds, camera, white, card.under(by_led))
    # Frames show all samples at once, but not the card.
    flicker = np.hypot(card.flicker, mean_of(lit.samples).flicker)
    named = context.rig.optics.emission_library
    library = () if named is None else read_emissions(named)
    estimator = JointEstimator(system.with_drift(flicker), library)
    method: EstimateMethod = (
        context.options(LedFluorescenceOptions).method or context.protocol.method
    )
    direct = direct_measurement(context.rig)
    if direct is not None:
        warnings += missing_samples(direct, lit.samples)
    patches, chosen = {}, {}
    for number, (name, sample) in enumerate(lit.samples.items()):
        even = sample.times(*_evenness(lit.cards[name], card, system))
        estimates = _Estimates(
            estimator.fit(name, even.value, even.own_variance, seed=number),
            _per_led(name, even, system, only_leds),
            method,
        )
        patches[name] = _patch(estimates, even, system, direct)
        chosen[name] = estimates.chosen
        if method == "per-led":
            warnings += per_led_warnings(name, estimates.chosen)
        if lit.has_first:
            warnings += bleaching_warnings(name, even.bleaching)
    warnings += fact_warnings(chosen, system.input_nm, camera.channels)
    return LedFluorescenceResult(
        leds=lit.used,
        led_peak_nm=lit.peak_nm,
        channels=camera.channels,
        brightness=system.brightness,
        is_brightness_known=~system.is_loose,
        uv_scale=_uv_scale(lit.peak_nm, system),
        patches=patches,
        run=context.run.name,
        geometry=context.rig.optics.geometry_text,
        lamps=lit.lamps,
        warnings=tuple(warnings),
    )


@dataclass(frozen=True)
class _Lit:
    """Card and samples under the lights that can be used.

    Attributes
    ----------
    used, lamps
        Names of the lights, LEDs first, each by rising peak; and of the lamps among them.
    peak_nm
        Their peaks in nm, shape (m,).
    cards, samples
        Values of the card in the place of each sample, and of the samples, under these lights and
        without the light that is left when they are off.
    has_first
        Whether the LED is among them that was lit again at the end.
    warnings
        What is amiss with the light.
    """

    used: tuple[str, ...]
    lamps: tuple[str, ...]
    peak_nm: FloatArray
    cards: Mapping[str, LitPatch]
    samples: Mapping[str, LitPatch]
    has_first: bool
    warnings: tuple[ResultWarning, ...]


def _lit(
    context: AnalysisContext,
    lights: Mapping[str, LightSource],
    camera: CameraResponse,
    white: Transmittance,
) -> _Lit:
    """Return card and samples under the lights that can be used.

    Raises
    ------
    DataError
        Fewer than two LEDs can be used.
    """
    names = [*context.protocol.leds, *context.protocol.lamps]
    spectra = {led: replace(lights[led].light, name=led) for led in names}
    first = context.protocol.shuffled()[0]
    cards = lit_patches(context, LedFrames.CARD, CARD, names)
    samples = lit_patches(context, LedFrames.SAMPLE, SAMPLE, names, first)
    leds, lamps = _usable(context, spectra, camera, white, cards, samples)
    if len(leds.by_row) < 2:
        raise DataError(
            f"expected two LEDs or more that can be used, got {len(leds.by_row)}: "
            f"{'; '.join(map(str, leds.left_out))}"
        )
    warnings: list[ResultWarning] = [*leds.warnings, *lamps.warnings]
    if context.rig.optics.may_see_gloss:
        warnings.append(
            Disturbance(
                "gloss-in-reflectance",
                "at {geometry} a surface's gloss reaches the camera, and is in the reflectance: "
                "light from 45°, or cross polarisers",
                geometry=context.rig.optics.geometry_text,
            )
        )
    kind: LightKind = "light" if context.protocol.lamps else "LED"
    for what, patches in (("card", cards), ("samples", samples)):
        warnings += left_warnings(what, patches, names, kind)
    peak_nm = {
        led: float(light.wavelength_nm[light.value.argmax()]) for led, light in spectra.items()
    }
    rows = [
        row
        for each in (leds, lamps)
        for row in sorted(each.by_row, key=lambda row: peak_nm[each.by_row[row]])
    ]
    light_of = {**leds.by_row, **lamps.by_row}
    used = tuple(light_of[row] for row in rows)
    return _Lit(
        used=used,
        lamps=used[len(leds.by_row) :],
        peak_nm=np.array([peak_nm[led] for led in used]),
        cards={name: card.under(rows).without_rest() for name, card in cards.items()},
        samples={name: sample.under(rows).without_rest() for name, sample in samples.items()},
        has_first=names.index(first) in rows,
        warnings=tuple(warnings),
    )


def _usable(
    context: AnalysisContext,
    spectra: Mapping[str, Spectrum],
    camera: CameraResponse,
    white: Transmittance,
    cards: Mapping[str, LitPatch],
    samples: Mapping[str, LitPatch],
) -> tuple[UsableLights, UsableLights]:
    """Return the LEDs and the lamps that can be used, by the rows of all lights."""
    leds, lamps = context.protocol.leds, context.protocol.lamps

    def of(names: Sequence[str], begin: int, kind: LightKind) -> UsableLights:
        rows = range(begin, begin + len(names))
        among = {name: spectra[name] for name in names}
        own = [
            {name: patch.under(rows) for name, patch in each.items()} for each in (cards, samples)
        ]
        usable = usable_lights(names, among, camera, white, own[0], own[1], kind)
        return replace(usable, by_row={begin + row: name for row, name in usable.by_row.items()})

    usable = of(leds, 0, "LED")
    return usable, of(lamps, len(leds), "lamp") if lamps else UsableLights({}, (), (), {})


def _lights(context: AnalysisContext) -> dict[str, LightSource]:
    """Return the lights of the protocol by name, LEDs and lamps.

    Raises
    ------
    UsageError
        The rig file lacks one of them.
    """
    protocol = context.protocol
    lights = led_sources(context.rig, "rig.yaml", context.inputs[LEDS_KIND])
    if unknown := [led for led in protocol.leds if led not in lights]:
        raise UsageError(f"rig.yaml: expected LEDs called {', '.join(unknown)}, got none")
    if not protocol.lamps:
        return lights
    lamps = illuminant_sources(context.rig, "rig.yaml")
    if unknown := [lamp for lamp in protocol.lamps if lamp not in lamps]:
        raise UsageError(f"rig.yaml: expected lamps called {', '.join(unknown)}, got none")
    return lights | {lamp: lamps[lamp] for lamp in protocol.lamps}


def _per_led(
    name: str, lit: LitPatch, system: FluorescenceSystem, only_leds: FluorescenceSystem
) -> FluorescenceFit:
    """Estimate a matrix by one LED by itself, and what it predicts under lamps, which come last."""
    count = len(only_leds.exposures)
    by_led = lit.under(range(count))
    fit = fit_per_led(name, by_led.value, by_led.variance, only_leds)
    scale = system.brightness[:, np.newaxis]
    predicted = scale * system.values(fit.matrix.reflectance, fit.matrix.reradiation)
    pull = (lit.value - predicted) / np.sqrt(lit.variance)
    return replace(
        fit,
        predicted=np.concatenate([fit.predicted, predicted[count:]]),
        pull=np.concatenate([fit.pull, pull[count:]]),
    )


def _evenness(
    here: LitPatch, mean: LitPatch, system: FluorescenceSystem
) -> tuple[FloatArray, FloatArray]:
    """Return the card's mean light over that at a patch, and its relative variance, (m,) each.

    LEDs that the camera does not see are taken to shine like the others do in the middle.
    """
    weight = mean.value / mean.variance
    at_patch = (weight * here.value).sum(axis=1)
    factor = (weight * mean.value).sum(axis=1) / at_patch
    variance = (weight**2 * here.own_variance).sum(axis=1) / at_patch**2
    seen = ~system.is_loose
    if seen.any():
        scatter = np.var(factor[seen]) if seen.sum() > 1 else 0.0
        factor = np.where(seen, factor, np.median(factor[seen]))
        variance = np.where(seen, variance, scatter)
    return factor, variance


@dataclass(frozen=True, eq=False)
class _Estimates:
    """Estimates of one sample, and the method that is asked for."""

    joint: FluorescenceFit
    per_led: FluorescenceFit
    method: EstimateMethod

    @property
    def chosen(self) -> FluorescenceFit:
        return self.joint if self.method == "joint" else self.per_led

    @property
    def other(self) -> FluorescenceFit:
        return self.per_led if self.method == "joint" else self.joint


def _patch(
    estimates: _Estimates,
    lit: LitPatch,
    system: FluorescenceSystem,
    direct: DirectMeasurement | None,
) -> FluorescentPatch:
    fit, joint, per_led = estimates.chosen, estimates.joint, estimates.per_led
    excitable, is_extrapolated = _excitable(fit, lit, system), _extrapolated(system)
    columns = None if direct is None else direct.samples.get(fit.matrix.name)
    read = None if columns is None else columns.interpolated(fit.matrix.name)[0]
    return FluorescentPatch(
        method=estimates.method,
        matrix=MatrixOnBands.of(fit.matrix),
        other=MatrixOnBands.of(estimates.other.matrix),
        is_extrapolated=is_extrapolated,
        dyes=tuple(_dye(fluorophore) for fluorophore in fit.fluorophores),
        probability=tuple(number.probability for number in fit.numbers),
        value=lit.value,
        sigma=np.sqrt(lit.variance),
        predicted=fit.predicted,
        pull=fit.pull,
        reduced_chi2=fit.reduced_chi2,
        colours=tuple(_colour(fit, read_light(light), excitable) for light in LIGHTS),
        bleaching=lit.bleaching,
        mixture=mixture_of(fit.matrix, is_extrapolated) if fit.fluorophores else None,
        direct=None if read is None else MatrixOnBands.of(read),
        under_lights=reradiation_under_lights(
            joint, per_led, [each.light for each in system.exposures if not each.is_lamp], direct
        ),
        differences=method_differences(joint.matrix, per_led.matrix, read),
    )


def _extrapolated(system: FluorescenceSystem) -> BoolArray:
    """Return which input bands no LED of known brightness lit, shape (i,).

    A lamp lights all of them, and tells their sum only.
    """
    is_lamp = np.array([exposure.is_lamp for exposure in system.exposures])
    known = system.response.absorbed[~system.is_loose & ~is_lamp]
    return np.asarray(~(known > LIT * known.max(axis=1, keepdims=True)).any(axis=0))


def _dye(fluorophore: EstimatedFluorophore) -> MeasuredDye:
    emission, excitation = fluorophore.emission, fluorophore.excitation
    return MeasuredDye(
        emission.value,
        _sigma(emission),
        excitation.value,
        _sigma(excitation),
        Measured(fluorophore.quantum_yield, fluorophore.quantum_yield_sigma),
    )


def _sigma(spectrum: Spectrum) -> FloatArray:
    """Return σ of a spectrum, NaN where its method has none."""
    return np.full_like(spectrum.value, np.nan) if spectrum.sigma is None else spectrum.sigma


def _colour(fit: FluorescenceFit, light: Spectrum, excitable: BoolArray) -> ColourUnderLight:
    found, sigma = appearance(fit.matrix, light).lab, np.full(3, np.nan)
    if fit.surfaces is not None:
        sigma = predicted_colour(fit, light).lab_sigma
    depends = False
    if excitable.any():
        emission = fit.fluorophores[0].emission.value[:, np.newaxis]
        reradiation = np.where(excitable, EXCITED * emission, fit.matrix.reradiation)
        brighter = appearance(replace(fit.matrix, reradiation=reradiation), light)
        depends = float(delta_e(brighter.lab, found)) > DEPENDS
        # Anything from the estimate to that strong a dye is as probable.
        sigma = np.hypot(sigma, (brighter.lab - found) / math.sqrt(3))
    lightness, a, b = found.tolist()
    return ColourUnderLight(light.name, (lightness, a, b), tuple(sigma.tolist()), depends)


def _excitable(fit: FluorescenceFit, lit: LitPatch, system: FluorescenceSystem) -> BoolArray:
    """Return in which input bands a sample is excited, but who knows how much, shape (i,).

    These are bands of lights of unknown brightness, under which it shows more than their own light.
    """
    loose = np.flatnonzero(system.is_loose)
    if not (fit.fluorophores and len(loose)):
        return np.zeros(len(system.input_nm), dtype=np.bool_)
    # Measured spectra of LEDs have noise of either sign beside their light.
    known = np.maximum(system.response.absorbed[~system.is_loose].sum(axis=0), 0.0)
    dark = np.zeros_like(fit.matrix.reradiation)
    reflected = system.values(fit.matrix.reflectance, dark) * system.brightness[:, np.newaxis]
    more = fit.predicted - reflected > DETECTION_SIGMA * np.sqrt(lit.variance)
    unknown = system.response.absorbed[[row for row in loose if more[row].any()]].sum(axis=0)
    return np.asarray(unknown > known)


def _uv_scale(
    peaks_nm: FloatArray, system: FluorescenceSystem
) -> Literal["measured", "unknown", "none"]:
    is_uv = peaks_nm < ULTRAVIOLET_NM
    if not is_uv.any():
        return "none"
    return "unknown" if system.is_loose[is_uv].any() else "measured"
