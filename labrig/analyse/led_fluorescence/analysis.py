"""Re-radiation matrices of the patches of a fluorescence run."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from labrig.analyse.inputs import Part
from labrig.analyse.led_fluorescence.card_checks import exchanged, lines_of, unused_leds
from labrig.analyse.led_fluorescence.lit_patches import (
    SEEN_SIGMA,
    LitPatch,
    lit_patches,
    mean_of,
)
from labrig.analyse.led_fluorescence.lit_system import lit_system
from labrig.analyse.led_fluorescence.warnings import (
    bleaching_warnings,
    exchanged_warnings,
    fact_warnings,
    left_warnings,
)
from labrig.bench_optics import camera_curves, card_reflectance, led_exposures
from labrig.errors import DataError, UsageError
from labrig.fit.fluorescence import (
    EstimatedFluorophore,
    FluorescenceFit,
    FluorescenceSystem,
    JointEstimator,
    fit_per_led,
    predicted_colour,
)
from labrig.material import appearance
from labrig.optics import Spectrum, delta_e, read_light
from labrig.protocols.led_fluorescence import SAMPLE, LedFrames
from labrig.protocols.steps.led_scenes import CARD
from labrig.results import (
    BoolArray,
    ColourUnderLight,
    FloatArray,
    FluorescentPatch,
    LedFluorescenceResult,
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


def analyse(part: Part) -> LedFluorescenceResult:
    """Estimate the re-radiation matrix of each patch.

    Raises
    ------
    UsageError
        The rig file lacks an LED, or the curves of camera or card.
    DataError
        Frames are missing or damaged, or fewer than two LEDs can be used.
    """
    leds = part.protocol.leds
    lights = led_exposures(part.rig, "rig.yaml", part.inputs.leds)
    if unknown := [led for led in leds if led not in lights]:
        raise UsageError(f"rig.yaml: expected LEDs called {', '.join(unknown)}, got none")
    spectra = {led: replace(lights[led].light, name=led) for led in leds}
    peak_nm = {
        led: float(light.wavelength_nm[light.value.argmax()]) for led, light in spectra.items()
    }
    camera, white = camera_curves(part.rig, part.overrides.camera), card_reflectance(part.rig)
    cards = lit_patches(part, LedFrames.CARD, CARD)
    samples = lit_patches(part, LedFrames.SAMPLE, SAMPLE)
    left_out = list(unused_leds(leds, spectra, camera, white, cards, samples))
    places = exchanged(left_out)
    left_out = [unused for unused in left_out if unused.led not in places]
    warnings = [*lines_of(left_out), *exchanged_warnings(places)]
    if part.rig.optics.may_see_gloss:
        warnings.append(
            f"at {part.rig.optics.geometry_text} a surface's gloss reaches the camera, and is in "
            "the reflectance: light from 45°, or cross polarisers"
        )
    warnings += [*left_warnings("card", cards, leds), *left_warnings("samples", samples, leds)]
    # The LED whose light it is, by the row of its frames.
    light_of = {
        row: places.get(led, led)
        for row, led in enumerate(leds)
        if led not in {unused.led for unused in left_out}
    }
    if len(light_of) < 2:
        raise DataError(
            f"expected two LEDs or more that can be used, got {len(light_of)}: "
            f"{'; '.join(lines_of(left_out))}"
        )
    rows = sorted(light_of, key=lambda row: peak_nm[light_of[row]])
    used = [light_of[row] for row in rows]
    has_first = leds.index(part.protocol.shuffled()[0]) in rows
    cards = {name: card.under(rows).without_rest() for name, card in cards.items()}
    card = mean_of(cards)
    system = lit_system([lights[led] for led in used], camera, white, card)
    # Frames show all samples at once, but not the card.
    flicker = np.hypot(card.flicker, mean_of(samples).under(rows).flicker)
    estimator, patches = JointEstimator(system.with_drift(flicker)), {}
    for number, name in enumerate(samples):
        sample = samples[name].under(rows).without_rest()
        even = sample.times(*_evenness(cards[name], card, system))
        fit = estimator.fit(name, even.value, even.own_variance, seed=number)
        per_led = fit_per_led(name, even.value, even.variance, system)
        patches[name] = _patch(fit, per_led, even, system)
        warnings += fact_warnings(name, fit, camera.channels)
        if has_first:
            warnings += bleaching_warnings(name, even.bleaching)
    return LedFluorescenceResult(
        leds=tuple(used),
        led_peak_nm=np.array([peak_nm[led] for led in used]),
        channels=camera.channels,
        brightness=system.brightness,
        is_brightness_known=~system.is_loose,
        uv_scale=_uv_scale([peak_nm[led] for led in used], system),
        patches=patches,
        run=part.run.folder.resolve().name,
        geometry=part.rig.optics.geometry_text,
        warnings=tuple(warnings),
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


def _patch(
    fit: FluorescenceFit, per_led: FluorescenceFit, lit: LitPatch, system: FluorescenceSystem
) -> FluorescentPatch:
    excitable = _excitable(fit, lit, system)
    return FluorescentPatch(
        matrix=MatrixOnBands.of(fit.matrix),
        per_led=MatrixOnBands.of(per_led.matrix),
        is_extrapolated=_extrapolated(system),
        dyes=tuple(_dye(fluorophore) for fluorophore in fit.fluorophores),
        probability=tuple(number.probability for number in fit.numbers),
        value=lit.value,
        sigma=np.sqrt(lit.variance),
        predicted=fit.predicted,
        pull=fit.pull,
        reduced_chi2=fit.reduced_chi2,
        colours=tuple(_colour(fit, read_light(light), excitable) for light in LIGHTS),
        bleaching=lit.bleaching,
    )


def _extrapolated(system: FluorescenceSystem) -> BoolArray:
    """Return which input bands no LED of known brightness lit, shape (i,)."""
    known = system.response.absorbed[~system.is_loose]
    return np.asarray(~(known > LIT * known.max(axis=1, keepdims=True)).any(axis=0))


def _dye(fluorophore: EstimatedFluorophore) -> MeasuredDye:
    emission, excitation = fluorophore.emission, fluorophore.excitation
    assert emission.sigma is not None
    assert excitation.sigma is not None
    return MeasuredDye(
        emission.value,
        emission.sigma,
        excitation.value,
        excitation.sigma,
        Measured(fluorophore.quantum_yield, fluorophore.quantum_yield_sigma),
    )


def _colour(fit: FluorescenceFit, light: Spectrum, excitable: BoolArray) -> ColourUnderLight:
    colour = predicted_colour(fit, light)
    depends, sigma = False, colour.lab_sigma
    if excitable.any():
        emission = fit.fluorophores[0].emission.value[:, np.newaxis]
        reradiation = np.where(excitable, EXCITED * emission, fit.matrix.reradiation)
        brighter = appearance(replace(fit.matrix, reradiation=reradiation), light)
        depends = float(delta_e(brighter.lab, colour.lab)) > DEPENDS
        # Anything from the estimate to that strong a dye is as probable.
        sigma = np.hypot(sigma, (brighter.lab - colour.lab) / math.sqrt(3))
    lightness, a, b = colour.lab.tolist()
    return ColourUnderLight(light.name, (lightness, a, b), tuple(sigma.tolist()), depends)


def _excitable(fit: FluorescenceFit, lit: LitPatch, system: FluorescenceSystem) -> BoolArray:
    """Return in which input bands a sample is excited, but who knows how much, shape (i,).

    These are bands of lights of unknown brightness, under which it shows more than their own light.
    """
    loose = np.flatnonzero(system.is_loose)
    if not fit.fluorophores:
        return np.zeros(len(system.input_nm), dtype=np.bool_)
    known = system.response.absorbed[~system.is_loose].sum(axis=0)
    dark = np.zeros_like(fit.matrix.reradiation)
    reflected = system.values(fit.matrix.reflectance, dark) * system.brightness[:, np.newaxis]
    more = fit.predicted - reflected > SEEN_SIGMA * np.sqrt(lit.variance)
    unknown = system.response.absorbed[[row for row in loose if more[row].any()]].sum(axis=0)
    return np.asarray(unknown > known)


def _uv_scale(
    peaks_nm: Sequence[float], system: FluorescenceSystem
) -> Literal["measured", "unknown", "none"]:
    is_uv = np.array(peaks_nm) < ULTRAVIOLET_NM
    if not is_uv.any():
        return "none"
    return "unknown" if system.is_loose[is_uv].any() else "measured"
