"""Analysis of an emission spectrum, from its frames to Λ* of each patch."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labrig.analyse.combined_frames import (
    CombinedFrame,
    combined,
    compared,
    differ,
    over_time,
    visible,
)
from labrig.analyse.forward_model import ForwardModel, forward_models, with_white_reference
from labrig.analyse.frames import (
    intact_frames,
    require_calibrated_camera,
    steady_frames,
    timing_warnings,
    without_stray_light,
)
from labrig.analyse.inputs import Part
from labrig.analyse.place_reduction import PatchReduction, reduce_places
from labrig.analyse.strip import StripPatch, for_each_patch
from labrig.calibration import BLANK_KIND, CAMERA_KIND
from labrig.fit.spectrum import DECISIVE, SpectrumFit, fit_spectrum
from labrig.foundation.errors import DataError
from labrig.protocols.emission_spectrum.analysis.camera_filters import (
    filter_models,
    glow_through_filters,
    repeat_warnings,
    white_through_filters,
    with_repeats,
)
from labrig.protocols.emission_spectrum.protocol import (
    CameraFilters,
    SpectrumFrames,
    glow_unit,
    lamp_of,
    white_unit,
)
from labrig.protocols.emission_spectrum.result import (
    ChargeSpectrum,
    EmissionSpectrumResult,
    PatchSpectrum,
)
from labrig.reduce import SeriesFrame
from labrig.results import EmissionSpectrum, FilterFrames, is_usable

#: Evidence of lines that is asked for where no grey card tells how far the camera's curves are off:
#: broad emissions reach 7000.
DECISIVE_WITHOUT_CARD = 2e4
#: Largest weight of smoothness with filters before the camera, which cannot tell how smooth a
#: spectrum is between them: emissions have peaks and shoulders of 25 nm.
STIFFEST = 3.0
#: Number of draws of the spectrum, and of those that are only shown.
SAMPLES, FEW_SAMPLES = 400, 60
#: Least brightness after another lamp relative to the glow left of the previous charge.
CHARGED_ANEW = 1.05


@dataclass(frozen=True, eq=False)
class _Charge:
    """The glow after one charge: its frames, and all of them combined."""

    lamp: str
    frames: FilterFrames
    combined: CombinedFrame


def analyse(part: Part) -> EmissionSpectrumResult:
    """Measure Λ* of every patch, and test whether it depends on time and on the lamp.

    Raises
    ------
    UsageError
        There is no calibrated LVF, or no file of a filter, or there are no camera curves.
    DataError
        No spectrum is complete, frames are damaged, nothing glows in them, or no patch lies below
        the filter.
    FitError
        Too many values clip.
    """
    intact = intact_frames(part.run, part.overrides, SpectrumFrames.GLOW)
    frames, stray = without_stray_light(intact, part.inputs[BLANK_KIND])
    require_calibrated_camera(
        part.inputs[CAMERA_KIND], part.run, part.run.frames(SpectrumFrames.GLOW)
    )
    models, refused = _models(part, frames.decay[0])
    white = steady_frames(part.run, part.overrides, SpectrumFrames.WHITE)
    reductions = reduce_places(
        [*frames.decay, *white],
        frames.dark,
        {patch: model.slices for patch, model in models.items()},
        part.inputs[CAMERA_KIND],
        next(iter(models.values())).holder,
    )
    patches, warnings = for_each_patch(
        list(models),
        lambda patch: _patch_spectrum(
            part, patch, models[patch], reductions[patch], frames.decay, white=bool(white)
        ),
    )
    return EmissionSpectrumResult(
        patches=patches,
        warnings=(*timing_warnings(part.run, "spectrum"), *stray, *refused, *warnings),
    )


def _models(
    part: Part, frame: SeriesFrame
) -> tuple[Mapping[StripPatch, ForwardModel], tuple[str, ...]]:
    """Return the model of every patch, and the reasons for patches without one."""
    if part.protocol.select is not None:
        return filter_models(part, part.protocol.select, frame), ()
    return forward_models(part, frame)


def _patch_spectrum(
    part: Part,
    patch: StripPatch,
    model: ForwardModel,
    reduction: PatchReduction,
    frames: Sequence[SeriesFrame],
    *,
    white: bool,
) -> tuple[PatchSpectrum, list[str]]:
    """Return the patch's spectrum, and warnings."""
    select = part.protocol.select
    charging_lamps = list(dict.fromkeys(lamp_of(frame.unit) for frame in frames))
    card = _card(reduction, select) if white else None
    model, warnings = with_white_reference(model, part, card)
    if select is None:
        glows = {lamp: reduction.of_unit(glow_unit(lamp)) for lamp in charging_lamps}
        decisive = DECISIVE if model.white_reference else DECISIVE_WITHOUT_CARD
        stiffest = np.inf
    else:
        through = {lamp: glow_through_filters(reduction, lamp, select) for lamp in charging_lamps}
        glows = {lamp: glow.frames for lamp, glow in through.items()}
        warnings = (*warnings, *repeat_warnings(through))
        model = with_repeats(model, max(glow.repeated_sigma for glow in through.values()))
        # Filters are too few and too broad to tell a line.
        decisive, stiffest = np.inf, STIFFEST
    charges, dead = _charges(glows)

    run = part.run.name

    def fitted(frame: CombinedFrame, samples: int) -> SpectrumFit:
        return fit_spectrum(
            frame.value,
            frame.sigma,
            model.system,
            samples=samples,
            decisive=decisive,
            stiffest=stiffest,
        )

    def spectrum_by(fit: SpectrumFit, lamp: str) -> EmissionSpectrum:
        return EmissionSpectrum.from_draws(
            fit.knots_nm, fit.value, fit.samples, sample=patch.material, lamp=lamp, run=run
        )

    first = charges[0]
    first_fit = fitted(first.combined, SAMPLES)
    times = over_time(first.frames, model.centre_nm) if len(first.frames) > 1 else []
    lamps = [
        compared(
            f"{charge.lamp} against {first.lamp}", charge.frames, first.combined, model.centre_nm
        )
        for charge in charges[1:]
    ]
    spectrum = PatchSpectrum(
        spectrum=spectrum_by(first_fit, first.lamp),
        channels=model.camera.channels,
        centre_nm=model.centre_nm,
        filters=() if select is None else select.filters,
        white_reference=model.white_reference,
        charges=tuple(
            ChargeSpectrum(
                charge.lamp,
                charge.frames,
                spectrum_by(fitted(charge.combined, FEW_SAMPLES), charge.lamp),
            )
            for charge in charges
        ),
        times=tuple(times),
        at_times=tuple(
            spectrum_by(fitted(combined(first.frames.take([row])), FEW_SAMPLES), first.lamp)
            for row in range(len(first.frames))
        ),
        lamps=tuple(lamps),
        changes_with_time=differ(times),
        depends_on_lamp=differ(lamps),
    )
    return spectrum, [
        *warnings,
        *_clipping_warnings(first.frames),
        *_faint_warnings(len(first.frames), frames),
        *_difference_warnings(spectrum),
        *_line_warnings(first_fit),
        *_uncharged_warnings(charges),
        *dead,
    ]


def _card(reduction: PatchReduction, select: CameraFilters | None) -> FilterFrames:
    if select is None:
        return reduction.of_unit(white_unit())
    return white_through_filters(reduction, select)


def _charges(glows: Mapping[str, FilterFrames]) -> tuple[list[_Charge], list[str]]:
    """Return the charges after which something glows, and a warning for each of the others.

    Raises
    ------
    DataError
        Nothing glows after the first charge.
    """
    charges: list[_Charge] = []
    dead: list[str] = []
    for lamp, frames in glows.items():
        try:
            visible_frames = visible(frames)
        except DataError:
            if not charges:
                raise
            dead.append(f"after charging with the {lamp} lamp nothing glows: it did not light")
            continue
        charges.append(_Charge(lamp, visible_frames, combined(visible_frames)))
    return charges, dead


def _difference_warnings(spectrum: PatchSpectrum) -> Iterator[str]:
    if spectrum.changes_with_time:
        worst = max(spectrum.times, key=lambda comparison: comparison.beyond_noise)
        yield (
            f"the spectrum changes with time: at {worst.what} it differs by "
            f"{worst.beyond_noise:.1%} (rms, beyond noise) from the other times; states emit in "
            "different colours, or another light comes in, so that one Λ* does not describe them"
        )
    if spectrum.depends_on_lamp:
        worst = max(spectrum.lamps, key=lambda comparison: comparison.beyond_noise)
        yield (
            f"the spectrum depends on the lamp: {worst.what} it differs by "
            f"{worst.beyond_noise:.1%} (rms, beyond noise); is it the same sample, in its place?"
        )


def _line_warnings(fit: SpectrumFit) -> Iterator[str]:
    if fit.lines_nm:
        places = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in fit.lines_nm)
        yield (
            f"light in lines much narrower than the filter's band, at {places} nm: how much light "
            "is near each of them is measured, how it is divided between neighbouring wavelengths "
            "is not, and σ is large there; if the shape matters, use a spectrometer"
        )


def _uncharged_warnings(charges: Sequence[_Charge]) -> Iterator[str]:
    """Warn of lamps after which the glow continued to fade as if they had not been lit."""
    for before, after in pairwise(charges):
        is_finite = np.isfinite(before.combined.value) & np.isfinite(after.combined.value)
        remaining_glow = before.combined.value[is_finite] * before.combined.brightness[-1]
        new_glow = after.combined.value[is_finite]
        if float(new_glow @ remaining_glow) < CHARGED_ANEW * float(remaining_glow @ remaining_glow):
            yield (
                f"after charging with the {after.lamp} lamp the glow is no brighter than what was "
                f"left before: the {after.lamp} lamp did not light, or hardly excites this sample"
            )


def _faint_warnings(count: int, frames: Sequence[SeriesFrame]) -> Iterator[str]:
    usable = sum(frame.unit == frames[0].unit and is_usable(frame.flag) for frame in frames)
    if count != usable:
        yield (
            f"{usable - count} of {usable} frames show no light above the noise and are left out; "
            "photograph earlier (times:), or charge for longer"
        )


def _clipping_warnings(frames: FilterFrames) -> Iterator[str]:
    clipped = np.isnan(frames.value_dn_per_s)
    if clipped.any():
        clipped_everywhere = int(clipped.all(axis=0).sum())
        yield (
            f"{clipped.mean():.0%} of the values clip and are left out, {clipped_everywhere} of "
            f"{clipped.shape[1]} in every frame; expose for less or lower the ISO"
        )
