"""Luminance of a glow from its frames and those of a grey card under the bare lamp.

The radiance of the card is known, ρE/π by a meter's reading. The counts of the glow relative to the
card's, ∫ c S dλ / ∫ c L dλ in every channel c, give the glow's spectrum S its scale; its luminance
is 683 lm/W ∫ V S dλ.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from labrig.analyse.frame_times import switched_time, timing_warnings
from labrig.analyse.frames import (
    IntactFrames,
    glare_warning,
    intact_frames,
    require_calibrated_camera,
    steady_frames,
    without_stray_light,
)
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import (
    bare_lamp_spectrum,
    camera_curves,
    card_radiance,
    card_reflectance,
    illuminance_lx,
)
from labrig.calibration import BLANK_KIND, CAMERA_KIND, LVF_KIND, TYPICAL_SHUTTER_S
from labrig.fit import fit_luminance
from labrig.foundation.arrays import BoolArray, FloatArray, IntArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Disturbance, ResultWarning, Undetermined, Unmeasured
from labrig.optics import mesopic_adaptation, mesopic_ratio
from labrig.protocols.luminance.analysis.colour_of_glow import (
    ColourScale,
    card_error,
    colour_scale,
    emission_of,
)
from labrig.protocols.luminance.analysis.glow_ratios import GlowRatios, glow_ratios
from labrig.protocols.luminance.protocol import GlowUnit, LuminanceFrames
from labrig.protocols.luminance.result import (
    ExcitationState,
    LuminanceResult,
    PatchLuminance,
    ScaleFactor,
)
from labrig.record import PERSON, RunRecord, glow_temperature_c
from labrig.reduce import (
    WHOLE_FRAME,
    WHOLE_FRAME_NAME,
    reduce_patches,
    sensor_layout,
)
from labrig.results import MCD_PER_M2, VISIBLE_MCD_PER_M2, LuminanceDecay, Measured

#: Signal in σ from which a glow is seen.
SEEN = 5.0
#: Change of the colour that is told, in its σ and relative to the strongest channel.
COLOUR_SIGMAS, COLOUR_CHANGE = 6.0, 0.02
#: Luminance at the end over that at half of the time from which it hardly falls; the least time.
LINGERS, LINGERS_S = 0.95, 60.0
#: Light before the excitation, relative to 0.3 mcd/m², that is told, in σ of its own and at least.
AMBIENT, AMBIENT_SIGMAS = 0.1, 4.0


def analyse(context: AnalysisContext) -> LuminanceResult:
    """Measure luminances of all patches by the card under the bare lamp.

    Raises
    ------
    UsageError
        The rig file has no reading of a meter, or curves are missing.
    DataError
        Frames of card or glow are missing, damaged or clipped.
    FitError
        There are too few readings.
    """
    run, protocol = context.run, context.protocol
    frames, stray = without_stray_light(
        intact_frames(run, context.overrides, LuminanceFrames.GLOW), context.inputs[BLANK_KIND]
    )
    card = steady_frames(run, context.overrides, LuminanceFrames.CARD)
    if not card:
        raise DataError(f"{run.folder}: no card was photographed; go on with labrig resume")
    require_calibrated_camera(context.inputs[CAMERA_KIND], run, run.frames(LuminanceFrames.GLOW))
    excitation = _excitation(context)
    regions = context.overrides.patches(protocol)
    counts = {
        name: glow_ratios(
            name, region, frames.decay, card, frames.dark, context.inputs[CAMERA_KIND]
        )
        for name, region in regions.items()
    }
    patches: dict[str, PatchLuminance] = {}
    warnings: list[ResultWarning] = [*timing_warnings(run, LuminanceFrames.GLOW), *stray]
    if not frames.dark:
        warnings.append(
            Unmeasured(
                "no-dark-frames",
                "without dark frames the level without light is that of the files: its error, in "
                "no σ here, grows towards the dim end",
            )
        )
    camera = context.inputs[CAMERA_KIND]
    if camera is None or camera.glare is None:
        warnings += _veiled(frames, regions)
    for name, each in counts.items():
        if not _is_seen(each).any():
            warnings.append(
                Undetermined(
                    "no-glow", "no glow was seen in this patch, which is left out", subject=name
                )
            )
            continue
        patches[name], of_patch = _patch(each, name, excitation, context)
        warnings += [each.about(name if len(counts) > 1 else "") for each in of_patch]
    if not patches:
        raise DataError(
            f"{run.folder}: no glow was seen; raise iso_at_most, open the aperture, or excite for "
            "longer"
        )
    return LuminanceResult(
        patches=_with_ratios(patches),
        excitation=excitation,
        thickness_mm=protocol.sample.thickness,
        mass_per_area_g_per_m2=protocol.sample.mass_per_area,
        adaptation_mcd_per_m2=protocol.adaptation_mcd_per_m2,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def _patch(
    counts: GlowRatios, name: str, excitation: ExcitationState, context: AnalysisContext
) -> tuple[PatchLuminance, list[ResultWarning]]:
    """Return the luminances of a patch, and doubts about them."""
    rig, protocol = context.rig, context.protocol
    camera = camera_curves(rig, context.overrides.camera, context.inputs[LVF_KIND])
    known = emission_of(context, name)
    colour, noise = _colour(counts, np.flatnonzero(_is_seen(counts).any(axis=1)))
    # A channel that does not see the glow has a value all the same, of its noise.
    colour = np.maximum(colour, noise)
    scale = colour_scale(
        colour,
        noise,
        camera,
        card_radiance(rig),
        bare_lamp_spectrum(rig),
        card_reflectance(rig),
        known,
    )
    light = 1000 * counts.ratio @ scale.weights
    noise_sigma = 1000 * np.sqrt(np.square(counts.sigma) @ np.square(scale.weights))
    sigma = np.hypot(noise_sigma, counts.flicker * light)
    dark = 1000 * np.abs(counts.dark_sigma @ np.abs(scale.weights))
    factors = tuple(_factors(counts, scale, context))
    constant = math.sqrt(sum(factor.relative_sigma**2 for factor in factors))
    steps = np.sqrt(constant**2 + counts.iso_sigma**2 + np.square(dark / np.maximum(light, dark)))
    order = _one_a_time(counts.t_s)
    decay = fit_luminance(
        counts.t_s[order],
        light[order],
        sigma[order],
        scale_sigma=steps[order],
        required=protocol.requirements,
        colours=protocol.colours,
        excitation=_text(excitation),
        origin=context.run.name,
    )
    last = int(np.searchsorted(counts.t_s, decay.visible_s.value if decay.visible_s else np.inf))
    last = min(last, len(light) - 1)
    at_end = (
        ScaleFactor("sensitivity of the last frames", float(counts.iso_sigma[last]),
                    counts.iso_source, is_common=False),
        ScaleFactor("dark level at the end", float(dark[last] / max(light[last], dark[last])),
                    "dark frames before the excitation", is_common=False),
    )  # fmt: skip
    warnings = [*decay.warnings, *_warnings(counts, scale, context)]
    return (
        PatchLuminance(
            decay=decay,
            factors=(*factors, *at_end),
            wavelength_nm=scale.wavelength_nm,
            spectrum=scale.spectrum / scale.spectrum.max(),
            emission=scale.source,
            scotopic_ratio=scale.scotopic_ratio,
            mesopic_ratio=_mesopic(scale, protocol.adaptation_mcd_per_m2),
        ),
        warnings,
    )


def _is_seen(counts: GlowRatios) -> BoolArray:
    """Return whether a signal is clearly above noise and dark level, shape (n, channels)."""
    return np.asarray(counts.ratio > SEEN * np.hypot(counts.sigma, counts.dark_sigma))


def _colour(counts: GlowRatios, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean ratios to the card in some frames, that of the strongest 1, and their σ."""
    strongest = int(np.argmax((counts.ratio[rows] / counts.sigma[rows]).sum(axis=0)))
    reference = counts.ratio[rows, strongest, np.newaxis]
    relative = counts.ratio[rows] / reference
    sigma = counts.sigma[rows] / reference
    weight = 1 / (np.square(sigma) + np.square(relative * sigma[:, [strongest]]))
    weight[:, strongest] = 1.0
    total = weight.sum(axis=0)
    dark = (weight * counts.dark_sigma[rows] / reference).sum(axis=0) / total
    noise = np.hypot(1 / np.sqrt(total), dark)
    noise[strongest] = 0.0
    return (weight * relative).sum(axis=0) / total, noise


def _other_light(counts: GlowRatios) -> Iterator[ResultWarning]:
    """Yield a warning if the light changes its colour or stays at a level, as other light does."""
    halves = np.log(counts.t_s) > np.log(counts.t_s[[0, -1]]).mean()
    seen = _is_seen(counts).all(axis=1)
    early, late = (np.flatnonzero(seen & half) for half in (~halves, halves))
    if len(early) > 1 and len(late) > 1:
        (first, first_sigma), (last, last_sigma) = _colour(counts, early), _colour(counts, late)
        change, sigma = (
            np.abs(last / last.max() - first / first.max()),
            np.hypot(first_sigma, last_sigma),
        )
        if (change > np.maximum(COLOUR_SIGMAS * sigma, COLOUR_CHANGE)).any():
            yield Disturbance(
                "glow-colour-changes",
                "the colour of the glow changes by {change:.1%} with time: another light came on, "
                "the lamp glows on, or the emission depends on time; the luminances take it for "
                "the same",
                change=change.max(),
            )
    brightest = int(np.argmax(counts.ratio[0] * counts.card))
    signal = counts.ratio[:, brightest]
    half = int(np.argmin(np.abs(counts.t_s - counts.t_s[-1] / 2)))
    if counts.t_s[-1] > LINGERS_S and signal[-1] > LINGERS * signal[half] > 0:
        yield Undetermined(
            "slow-end",
            "at the end the luminance hardly falls: a light may have come on, or a state lives "
            "much longer than the run",
        )


def _veiled(frames: IntactFrames, regions: Mapping[str, Region]) -> tuple[ResultWarning, ...]:
    """Return a warning if the glare of a usual lens matters beside a bright patch."""
    iso = frames.decay[-1].iso
    last = [frame for frame in frames.decay if frame.iso == iso][:1]
    wanted = {**regions, WHOLE_FRAME_NAME: WHOLE_FRAME}
    series = reduce_patches(last, wanted, frames.dark)
    whole = series.pop(WHOLE_FRAME_NAME)
    return glare_warning(series, regions, whole, sensor_layout(last[0]))


def _one_a_time(t_s: FloatArray) -> IntArray:
    """Return the rows whose times rise."""
    return np.flatnonzero(np.concatenate([[True], np.diff(t_s) > 0]))


def _factors(
    counts: GlowRatios, scale: ColourScale, context: AnalysisContext
) -> Iterator[ScaleFactor]:
    """Yield the factors that all luminances have in common."""
    reading = context.rig.optics.luminance
    camera = context.inputs[CAMERA_KIND]
    assert reading is not None
    meter = "luxmeter at the sample" if reading.at == "sample plane" else "meter on the card"
    yield ScaleFactor(f"{meter}, {reading.value}", reading.sigma, "rig file")
    if reading.f1_prime is not None and reading.lamp != "halogen":
        # Meters are calibrated with illuminant A, which halogen lamps are close to.
        mismatch = reading.f1_prime / math.sqrt(3)
        yield ScaleFactor("meter's colour, f1′", mismatch, f"f1′ = {reading.f1_prime:.2g}, even")
    if reading.at == "sample plane":
        yield ScaleFactor("reflectance of the card", scale.card_sigma, scale.card_source)
    yield ScaleFactor("light of the card", counts.card_sigma, "its photographs, noise and flicker")
    calibrated = camera is not None and camera.shutter
    shutter = (
        "the camera's calibration" if calibrated else f"assumed: {1e3 * TYPICAL_SHUTTER_S:g} ms"
    )
    yield ScaleFactor("shutter times, card to glow", counts.shutter_sigma, shutter)
    yield ScaleFactor("aperture, card to glow", 0.0, "the same for all frames")
    colour = scale.relative_sigma
    yield ScaleFactor("colour: curves, lamp, emission", colour, scale.source, is_common=False)


def _warnings(
    counts: GlowRatios, scale: ColourScale, context: AnalysisContext
) -> Iterator[ResultWarning]:
    """Yield doubts about scale and darkness."""
    doubt = scale.card_doubt(counts.card, counts.card_sigma)
    if doubt is not None:
        yield doubt
    if scale.doubt is not None:
        yield scale.doubt
    yield from _other_light(counts)
    if context.rig.optics.luminance is not None and context.rig.optics.luminance.lamp is None:
        yield Unmeasured(
            "lamp-unnamed",
            "the rig file does not say which lamp it has (optics: luminance: lamp): the same lux "
            "of another lamp excite another glow",
        )
    ambient = 1000 * counts.ambient.value * float(scale.weights.sum())
    sigma = 1000 * counts.ambient.sigma * float(scale.weights.sum())
    if ambient > max(AMBIENT_SIGMAS * sigma, AMBIENT * VISIBLE_MCD_PER_M2):
        yield Disturbance(
            "not-dark-before",
            "the sample's place was not dark before the excitation, {ambient_mcd_per_m2:.2g} "
            "{unit} or more by the colour of the dark frames: a status LED, or an earlier glow; it "
            "is subtracted as long as it stays the same: cover LEDs, let the sample rest",
            ambient_mcd_per_m2=ambient,
            unit=MCD_PER_M2,
        )


def _mesopic(scale: ColourScale, adaptation_mcd_per_m2: float | None) -> Measured | None:
    """Return mesopic over photopic luminance, for eyes adapted to light of the glow's colour."""
    if adaptation_mcd_per_m2 is None:
        return None
    ratio = scale.scotopic_ratio

    def at(scotopic_over_photopic: float) -> float:
        m = mesopic_adaptation(adaptation_mcd_per_m2 / 1000, scotopic_over_photopic)
        return mesopic_ratio(m, scotopic_over_photopic)

    value = at(ratio.value)
    slope = (at(ratio.value * 1.01) - value) / (0.01 * ratio.value)
    return Measured(value, abs(slope) * ratio.sigma)


def _excitation(context: AnalysisContext) -> ExcitationState:
    """Return how the sample was excited."""
    protocol, reading = context.protocol, context.rig.optics.luminance
    lux = illuminance_lx(context.rig)
    assert reading is not None
    conditions, rested_s = protocol.excitation.conditions, protocol.excitation.rested
    charged_s = _charged_s(context.run)
    by_card = reading.at == "card"
    card_sigma = card_error(card_reflectance(context.rig))[0] if by_card else 0.0
    sigma = math.hypot(reading.sigma, card_sigma)
    return ExcitationState(
        standard=conditions.name,
        lamp=reading.lamp,
        illuminance=Measured(lux, sigma * lux, "lx"),
        charged_s=charged_s,
        rested_s=rested_s,
        temperature_c=glow_temperature_c(context.run, protocol.rate_frames),
        deviations=tuple(conditions.deviations(reading.lamp, lux, charged_s, rested_s)),
    )


def _charged_s(run: RunRecord) -> float:
    """Return how long the lamp shone on the uncovered sample, in seconds.

    It does so from the last of: lamp on, a step by hand, a door or shield that moved.
    """
    attempt = run.completed()[GlowUnit.name]
    first = next(frame for frame in attempt.frames if frame.role == LuminanceFrames.GLOW)
    off = switched_time(attempt, first, "off")
    begins = [
        action.end_time if action.device == PERSON else action.middle_time
        for action in attempt.actions
        if action.start_time < off
        and (action.device in (PERSON, "door", "shield") or action.action == "on")
    ]
    lit = [*begins, *([] if begins else [off])]
    return off - max(lit)


def _text(excitation: ExcitationState) -> str:
    parts = [
        f"{excitation.lamp} lamp" if excitation.lamp else "a lamp that is not stated",
        f"{excitation.illuminance.value:.4g} lx",
        f"{excitation.charged_s / 60:.3g} min",
    ]
    return f"{', '.join(parts)}; {excitation.accordance}"


def _with_ratios(patches: Mapping[str, PatchLuminance]) -> dict[str, PatchLuminance]:
    """Return the patches with their luminances relative to those of the first one."""
    names = list(patches)
    first = patches[names[0]]
    common = math.sqrt(sum(one.relative_sigma**2 for one in first.factors if one.is_common))
    result = {names[0]: first}
    for name in names[1:]:
        ratios = dict(_ratios(first.decay, patches[name].decay, common))
        result[name] = replace(patches[name], relative_to_first=ratios)
    return result


def _ratios(
    first: LuminanceDecay, other: LuminanceDecay, common: float
) -> Iterator[tuple[float, Measured]]:
    """Yield time and ratio, without the relative σ that both have in common."""
    for entries in zip(first.at, other.at, strict=True):
        mine, its = (entry.luminance for entry in entries)
        if mine is not None and its is not None:
            own = ((one.sigma / one.value) ** 2 - common**2 for one in (mine, its))
            ratio = its.value / mine.value
            relative = math.sqrt(sum(max(variance, 0.0) for variance in own))
            yield entries[0].t_s, Measured(ratio, relative * ratio)
