"""Re-radiation matrices of the patches of a fluorescence run."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from labrig.analyse.inputs import Part
from labrig.analyse.led_fluorescence.card_checks import UnusedLed, unused_leds
from labrig.analyse.led_fluorescence.lit_patches import (
    LitPatch,
    lit_patches,
    mean_of,
    without_rest,
)
from labrig.analyse.led_fluorescence.lit_system import lit_system
from labrig.analyse.led_fluorescence.warnings import (
    SEEN_SIGMA,
    bleaching_warnings,
    fact_warnings,
    left_warnings,
)
from labrig.bench_optics import (
    LedExposure,
    camera_curves,
    card_reflectance,
    illuminant_exposures,
    led_exposures,
)
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
from labrig.optics import CameraResponse, Spectrum, Transmittance, delta_e, read_light
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
        Frames are missing or damaged, LEDs are named in another order than they light, or fewer
        than two of them can be used.
    """
    leds = [*part.protocol.leds, *part.protocol.lamps]
    lights = _lights(part)
    spectra = {led: replace(lights[led].light, name=led) for led in leds}
    peak_nm = {
        led: float(light.wavelength_nm[light.value.argmax()]) for led, light in spectra.items()
    }
    camera, white = camera_curves(part.rig, part.overrides.camera), card_reflectance(part.rig)
    first = part.protocol.shuffled()[0]
    cards = lit_patches(part, LedFrames.CARD, CARD, leds)
    samples = lit_patches(part, LedFrames.SAMPLE, SAMPLE, leds, first)
    left_out = list(_unused(part, spectra, camera, white, mean_of(cards)))
    warnings = [unused.reason for unused in left_out]
    warnings += [*left_warnings("card", cards, leds), *left_warnings("sample", samples, leds)]
    used = [led for led in leds if led not in {unused.led for unused in left_out}]
    used.sort(key=lambda led: (lights[led].is_lamp, peak_nm[led]))
    by_led = [row for row, led in enumerate(used) if not lights[led].is_lamp]
    if len(by_led) < 2:
        raise DataError(f"expected two LEDs that can be used, got {len(by_led)} ({warnings[0]})")
    rows = [leds.index(led) for led in used]
    cards = {name: without_rest(card.under(rows)) for name, card in cards.items()}
    card = mean_of(cards)
    system = lit_system([lights[led] for led in used], camera, white, card)
    only_leds = lit_system([lights[used[row]] for row in by_led], camera, white, card.under(by_led))
    estimator, patches = JointEstimator(system), {}
    for number, name in enumerate(samples):
        sample = without_rest(samples[name].under(rows))
        if sample.is_clipped.any():
            which = ", ".join(np.array(used)[sample.is_clipped])
            raise DataError(f"{name}: clips at the shortest exposure under {which}; dim the LEDs")
        even = sample.times(*_evenness(cards[name], card, system))
        fit = estimator.fit(name, even.value, even.variance, seed=number)
        per_led = fit_per_led(name, even.value[by_led], even.variance[by_led], only_leds)
        patches[name] = _patch(fit, per_led, even, system)
        warnings += fact_warnings(name, fit, camera.channels)
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
        warnings=tuple(warnings),
    )


def _unused(
    part: Part,
    spectra: Mapping[str, Spectrum],
    camera: CameraResponse,
    white: Transmittance,
    card: LitPatch,
) -> Iterator[UnusedLed]:
    """Yield LEDs and lamps that cannot be used."""
    leds, lamps = part.protocol.leds, part.protocol.lamps
    rows = range(len(leds)), range(len(leds), len(leds) + len(lamps))
    for names, own, kind in zip((leds, lamps), rows, ("LED", "lamp"), strict=True):
        if names:
            among = {name: spectra[name] for name in names}
            yield from unused_leds(names, among, camera, white, card.under(own), kind)


def _lights(part: Part) -> dict[str, LedExposure]:
    """Return the lights of the protocol by name, LEDs and lamps.

    Raises
    ------
    UsageError
        The rig file lacks one of them.
    """
    protocol = part.protocol
    lights = led_exposures(part.rig, "rig.yaml", part.inputs.leds)
    if unknown := [led for led in protocol.leds if led not in lights]:
        raise UsageError(f"rig.yaml: expected LEDs called {', '.join(unknown)}, got none")
    if not protocol.lamps:
        return lights
    lamps = illuminant_exposures(part.rig, "rig.yaml")
    if unknown := [lamp for lamp in protocol.lamps if lamp not in lamps]:
        raise UsageError(f"rig.yaml: expected lamps called {', '.join(unknown)}, got none")
    return lights | {lamp: lamps[lamp] for lamp in protocol.lamps}


def _evenness(
    here: LitPatch, mean: LitPatch, system: FluorescenceSystem
) -> tuple[FloatArray, FloatArray]:
    """Return the card's mean light over that at a patch, and its relative variance, (m,) each.

    LEDs that the camera does not see are taken to shine like the others do in the middle.
    """
    weight = mean.value / mean.variance
    at_patch = (weight * here.value).sum(axis=1)
    factor = (weight * mean.value).sum(axis=1) / at_patch
    variance = (weight**2 * here.variance).sum(axis=1) / at_patch**2
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
    """Return which input bands no LED of known brightness lit, shape (i,).

    A lamp lights all of them, and tells their sum only.
    """
    is_lamp = [exposure.spectrum_error is not None for exposure in system.exposures]
    known = system.response.absorbed[~system.is_loose & ~np.array(is_lamp)]
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
    depends = False
    if excitable.any():
        emission = fit.fluorophores[0].emission.value[:, np.newaxis]
        reradiation = np.where(excitable, EXCITED * emission, fit.matrix.reradiation)
        brighter = appearance(replace(fit.matrix, reradiation=reradiation), light)
        depends = float(delta_e(brighter.lab, colour.lab)) > DEPENDS
    lightness, a, b = colour.lab.tolist()
    return ColourUnderLight(
        light.name, (lightness, a, b), tuple(colour.lab_sigma.tolist()), depends
    )


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
