"""Analysis of an emission spectrum, from its frames to Λ* of each patch.

Filters and channels are broad, so that they tell a smooth spectrum only. What else differs from
filter to filter is the brightness: every filter is seen after a charge of its own. It is taken from
the glow without a filter, before the filters and after them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
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
from labrig.analyse.exciting_lights import FILTER_NM, FILTER_SIGMA
from labrig.analyse.forward_model import (
    KNOTS_NM,
    ForwardModel,
    channel_curves,
    forward_models,
    with_white_reference,
)
from labrig.analyse.frame_times import timing_warnings
from labrig.analyse.frames import (
    intact_frames,
    require_calibrated_camera,
    steady_frames,
    without_stray_light,
)
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.place_reduction import PatchReduction, reduce_places
from labrig.analyse.strip import StripPatch, for_each_patch, strip_regions
from labrig.bench_optics import filter_transmittances
from labrig.calibration import BLANK_KIND, CAMERA_KIND
from labrig.fit.spectrum import (
    DECISIVE,
    CurveError,
    SpectralSystem,
    SpectrumFit,
    camera_modes,
    fit_spectrum,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    ResultWarning,
    Undetermined,
    Unmeasured,
)
from labrig.optics import Spectrum, Transmittance, hat_functions, quadrature
from labrig.protocols.emission_spectrum.protocol import (
    AFTERWARDS,
    BEFORE,
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
from labrig.reduce import FLICKER, SeriesFrame, sensor_layout
from labrig.results import EmissionSpectrum, FilterFrames, is_usable

#: Name of the only place of a patch.
PLACE = "sample"
#: σ of what a filter lets through far from its own band.
LEAKAGE = 1e-4
#: Least relative σ of the glow after one charge over that after another.
REPEATED = 0.01
#: Change of the glow from the first charge to the last that causes a warning.
NOTABLE = 0.05
#: Relative difference of times at which photographs belong together.
SAME_TIME = 0.2


@dataclass(frozen=True, eq=False)
class CameraFilterModel(ForwardModel):
    """Model of the values of the glow without a filter and with each, by channel.

    Attributes
    ----------
    filters
        Transmittances of the filters; None where there is none.
    """

    filters: tuple[Transmittance | None, ...] = ()

    @property
    def centre_nm(self) -> FloatArray:
        """Mean wavelength of filter and channel in nm, shape (filters · channels,)."""
        design = self.system.design
        return np.asarray(design @ self.system.knots_nm / design.sum(axis=1))

    def expected_of(self, light: Spectrum) -> FloatArray:
        """Return the values of a light by the model, shape (filters · channels,)."""
        camera = self.camera
        low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
        knots = [one.wavelength_nm for one in self.filters if one is not None]
        nodes, weights = quadrature(low, high, camera.wavelength_nm, light.wavelength_nm, *knots)
        seen = (weights * light.at(nodes))[:, np.newaxis] * camera.at(nodes)
        return np.concatenate([_passed(each, nodes) @ seen for each in self.filters])


def filter_models(
    context: AnalysisContext, select: CameraFilters, frame: SeriesFrame
) -> dict[StripPatch, ForwardModel]:
    """Return the model of every patch of a part.

    Parameters
    ----------
    part
        Part of a run.
    select
        Filters of the part's protocol.
    frame
        Any of the part's frames, for the camera's channels.

    Raises
    ------
    UsageError
        There is no file of a filter, or there are no camera curves.
    """
    camera = channel_curves(context, sensor_layout(frame).channels)
    filters = (None, *filter_transmittances(context.rig, select.filters))
    knots = [one.wavelength_nm for one in filters if one is not None]
    nodes, weights = quadrature(
        float(KNOTS_NM[0]), float(KNOTS_NM[-1]), camera.wavelength_nm, KNOTS_NM, *knots
    )
    onto_knots = weights[:, np.newaxis] * hat_functions(KNOTS_NM, nodes)
    sensitivity = camera.at(nodes)
    passed = np.array([_passed(each, nodes) for each in filters])

    def design(transmission: FloatArray, curves: FloatArray) -> FloatArray:
        """Return the design matrix (filters · channels, knots)."""
        seen = transmission[:, np.newaxis] * curves.T
        return np.asarray(seen.reshape(-1, len(nodes)) @ onto_knots)

    modes = [design(passed, error) for error in camera_modes(camera, nodes, CurveError())]
    for number, each in enumerate(filters):
        if each is not None:
            modes += [
                design(change, sensitivity) for change in _changes(number, each, passed, nodes)
            ]
    system = SpectralSystem(KNOTS_NM, design(passed, sensitivity), np.array(modes))
    return {
        patch: CameraFilterModel(
            slices={PLACE: patch.region or context.protocol.region},
            holder={},
            camera=camera,
            system=system,
            filters=filters,
        )
        for patch in strip_regions(context)
    }


def _passed(transmittance: Transmittance | None, nodes: FloatArray) -> FloatArray:
    return np.ones(len(nodes)) if transmittance is None else transmittance.at(nodes)


def _changes(
    number: int, transmittance: Transmittance, passed: FloatArray, nodes: FloatArray
) -> list[FloatArray]:
    """Return changes (filters, q) by one σ of a filter's height, wavelengths and leakage."""
    own = passed[number]
    moved = transmittance.at(nodes - FILTER_NM) - own
    changes = []
    for change in (FILTER_SIGMA * own, moved, np.full(len(nodes), LEAKAGE)):
        changes.append(np.zeros_like(passed))
        changes[-1][number] = change
    return changes


@dataclass(frozen=True, eq=False)
class GlowThroughFilters:
    """The glow after the charges by one lamp.

    Attributes
    ----------
    frames
        Values without a filter and with each, at one brightness, a row for each time.
    change
        Brightness after the last charge over that after the first, less 1.
    """

    frames: FilterFrames
    change: float

    @property
    def repeated_sigma(self) -> float:
        """Relative σ of the brightness from filter to filter."""
        return float(np.hypot(REPEATED, self.change / 2))


def glow_through_filters(
    reduction: PatchReduction, lamp: str, select: CameraFilters
) -> GlowThroughFilters:
    """Return the glow after the charges by a lamp.

    What changes from charge to charge, since something is left of those before or the lamp warms
    up, is taken to change evenly.

    Raises
    ------
    DataError
        The frames of a filter are missing.
    """
    scenes = {scene: reduction.of_unit(glow_unit(lamp, scene)) for scene in select.scenes()}
    first, last = scenes[BEFORE], scenes.pop(AFTERWARDS)
    both = combined(_side_by_side([first, _at_times(last, first.t_s)]))
    channels = len(both.value) // 2
    before, after = both.value[:channels], both.value[channels:]
    weight = np.nan_to_num(before / both.sigma[:channels] ** 2)
    change = float(weight @ np.nan_to_num(after) / (weight @ np.nan_to_num(before))) - 1
    brightness = {
        scene: 1 + change * number / (len(select.filters) + 1)
        for number, scene in enumerate(scenes)
    }
    columns = [
        _scaled(_at_times(frames, first.t_s), 1 / brightness[scene])
        for scene, frames in scenes.items()
    ]
    return GlowThroughFilters(_side_by_side(columns), change)


def white_through_filters(reduction: PatchReduction, select: CameraFilters) -> FilterFrames:
    """Return the light of the card without a filter and with each, one row of all exposures.

    Raises
    ------
    DataError
        The frames of a filter are missing.
    """
    scenes = [reduction.of_unit(white_unit(name)) for name in (BEFORE, *select.filters)]
    value, sigma = np.concatenate([_steady(frames) for frames in scenes], axis=1)
    no_common = np.zeros((1, len(value)))
    return FilterFrames(np.zeros(1), value[np.newaxis], sigma[np.newaxis], no_common)


def _steady(frames: FilterFrames) -> FloatArray:
    """Return the weighted mean of frames of a steady light and its σ, (2, m); NaN if all clip."""
    variance = frames.sigma_dn_per_s**2 + frames.dark_dn_per_s_sigma**2
    is_known = np.isfinite(variance) & np.isfinite(frames.value_dn_per_s)
    weight = np.where(is_known, 1 / np.where(is_known, variance, 1.0), 0.0)
    total = weight.sum(axis=0)
    none = total == 0
    total[none] = np.nan
    mean = (weight * np.nan_to_num(frames.value_dn_per_s)).sum(axis=0) / total
    return np.stack([mean, 1 / np.sqrt(total)])


def with_repeats(model: ForwardModel, sigma: float) -> ForwardModel:
    """Return the model with errors of the brightness from filter to filter.

    Parameters
    ----------
    model
        Model of the values through filters.
    sigma
        Relative σ of the brightness after one charge over that after another.
    """
    system = model.system
    channels = len(model.camera.channels)
    modes = []
    for begin in range(0, len(system.design), channels):
        mode = np.zeros_like(system.design)
        mode[begin : begin + channels] = sigma * system.design[begin : begin + channels]
        modes.append(mode)
    return replace(model, system=replace(system, modes=np.concatenate([system.modes, modes])))


def repeat_warnings(glows: Mapping[str, GlowThroughFilters]) -> list[ResultWarning]:
    """Return a warning of each lamp after whose charges the glow changed much."""
    return [
        Disturbance(
            "glow-not-repeated",
            "after the last charge by the {lamp} lamp the sample glowed {change_percent:+.0f} % as "
            "compared with the first: filters are compared by a brightness between; charge for "
            "longer, or let the sample rest until it is dark",
            lamp=lamp,
            change_percent=100 * glow.change,
        )
        for lamp, glow in glows.items()
        if abs(glow.change) > NOTABLE
    ]


def _at_times(frames: FilterFrames, t_s: FloatArray) -> FilterFrames:
    """Return the frame at each of some times; NaN where there is none.

    Raises
    ------
    DataError
        There is none at all.
    """
    rows = [int(np.argmin(np.abs(frames.t_s - each))) for each in t_s.tolist()]
    found = frames.take(rows)
    is_there = np.abs(found.t_s - t_s) < SAME_TIME * t_s
    if not is_there.any():
        raise DataError(
            "expected photographs through every filter at the times of those without, got others; "
            "was the run changed?"
        )
    value = np.where(is_there[:, np.newaxis], found.value_dn_per_s, np.nan)
    # The lamp flickers while it charges, and so does the shutter.
    sigma = np.hypot(found.sigma_dn_per_s, FLICKER * np.nan_to_num(value))
    return replace(found, t_s=t_s, value_dn_per_s=value, sigma_dn_per_s=sigma)


def _scaled(frames: FilterFrames, factor: float) -> FilterFrames:
    return replace(
        frames,
        value_dn_per_s=factor * frames.value_dn_per_s,
        sigma_dn_per_s=factor * frames.sigma_dn_per_s,
        dark_dn_per_s_sigma=factor * frames.dark_dn_per_s_sigma,
    )


def _side_by_side(parts: Sequence[FilterFrames]) -> FilterFrames:
    """Return frames of the same times as frames with the values of all."""
    columns = [
        np.concatenate([getattr(part, name) for part in parts], axis=1)
        for name in ("value_dn_per_s", "sigma_dn_per_s", "dark_dn_per_s_sigma")
    ]
    return FilterFrames(parts[0].t_s, *columns)


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


def analyse(context: AnalysisContext) -> EmissionSpectrumResult:
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
    intact = intact_frames(context.run, context.overrides, SpectrumFrames.GLOW)
    frames, stray = without_stray_light(intact, context.inputs[BLANK_KIND])
    require_calibrated_camera(
        context.inputs[CAMERA_KIND], context.run, context.run.frames(SpectrumFrames.GLOW)
    )
    models, refused = _models(context, frames.decay[0])
    white = steady_frames(context.run, context.overrides, SpectrumFrames.WHITE)
    reductions = reduce_places(
        [*frames.decay, *white],
        frames.dark,
        {patch: model.slices for patch, model in models.items()},
        context.inputs[CAMERA_KIND],
        next(iter(models.values())).holder,
    )
    patches, warnings = for_each_patch(
        list(models),
        lambda patch: _patch_spectrum(
            context, patch, models[patch], reductions[patch], frames.decay, white=bool(white)
        ),
    )
    return EmissionSpectrumResult(
        patches=patches,
        warnings=(*timing_warnings(context.run, "spectrum"), *stray, *refused, *warnings),
    )


def _models(
    context: AnalysisContext, frame: SeriesFrame
) -> tuple[Mapping[StripPatch, ForwardModel], tuple[ResultWarning, ...]]:
    """Return the model of every patch, and warnings of patches without one."""
    if context.protocol.select is not None:
        return filter_models(context, context.protocol.select, frame), ()
    return forward_models(context, frame)


def _patch_spectrum(
    context: AnalysisContext,
    patch: StripPatch,
    model: ForwardModel,
    reduction: PatchReduction,
    frames: Sequence[SeriesFrame],
    *,
    white: bool,
) -> tuple[PatchSpectrum, list[ResultWarning]]:
    """Return the patch's spectrum, and warnings."""
    select = context.protocol.select
    charging_lamps = list(dict.fromkeys(lamp_of(frame.unit) for frame in frames))
    card = _card(reduction, select) if white else None
    model, warnings = with_white_reference(model, context, card)
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

    run = context.run.name

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


def _charges(glows: Mapping[str, FilterFrames]) -> tuple[list[_Charge], list[ResultWarning]]:
    """Return the charges after which something glows, and a warning for each of the others.

    Raises
    ------
    DataError
        Nothing glows after the first charge.
    """
    charges: list[_Charge] = []
    dead: list[ResultWarning] = []
    for lamp, frames in glows.items():
        try:
            visible_frames = visible(frames)
        except DataError:
            if not charges:
                raise
            dead.append(
                Unmeasured(
                    "lamp-unlit",
                    "after charging with the {lamp} lamp nothing glows: it did not light",
                    lamp=lamp,
                )
            )
            continue
        charges.append(_Charge(lamp, visible_frames, combined(visible_frames)))
    return charges, dead


def _difference_warnings(spectrum: PatchSpectrum) -> Iterator[ResultWarning]:
    if spectrum.changes_with_time:
        worst = max(spectrum.times, key=lambda comparison: comparison.beyond_noise)
        yield Contradiction(
            "spectrum-changes",
            "the spectrum changes with time: at {time} it differs by {difference:.1%} (rms, beyond "
            "noise) from the other times; states emit in different colours, or another light comes "
            "in, so that one Λ* does not describe them",
            time=worst.what,
            difference=worst.beyond_noise,
        )
    if spectrum.depends_on_lamp:
        worst = max(spectrum.lamps, key=lambda comparison: comparison.beyond_noise)
        yield Contradiction(
            "spectrum-depends-on-lamp",
            "the spectrum depends on the lamp: {lamps} it differs by {difference:.1%} (rms, beyond "
            "noise); is it the same sample, in its place?",
            lamps=worst.what,
            difference=worst.beyond_noise,
        )


def _line_warnings(fit: SpectrumFit) -> Iterator[ResultWarning]:
    if fit.lines_nm:
        yield Undetermined(
            "narrow-lines",
            "light in lines much narrower than the filter's band, at {places_nm} nm: how much "
            "light is within 50 nm of each of them is measured, how it is divided between "
            "neighbouring wavelengths is not: a mean over 10 nm there may be wrong by 3 σ; if the "
            "shape matters, use a spectrometer",
            places_nm=tuple(f"{low:.0f} to {high:.0f}" for low, high in fit.lines_nm),
        )


def _uncharged_warnings(charges: Sequence[_Charge]) -> Iterator[ResultWarning]:
    """Warn of lamps after which the glow continued to fade as if they had not been lit."""
    for before, after in pairwise(charges):
        is_finite = np.isfinite(before.combined.value) & np.isfinite(after.combined.value)
        remaining_glow = before.combined.value[is_finite] * before.combined.brightness[-1]
        new_glow = after.combined.value[is_finite]
        if float(new_glow @ remaining_glow) < CHARGED_ANEW * float(remaining_glow @ remaining_glow):
            yield Unmeasured(
                "lamp-excites-nothing",
                "after charging with the {lamp} lamp the glow is no brighter than "
                "before: the {lamp} lamp did not light, or hardly excites this sample",
                lamp=after.lamp,
            )


def _faint_warnings(count: int, frames: Sequence[SeriesFrame]) -> Iterator[ResultWarning]:
    usable = sum(frame.unit == frames[0].unit and is_usable(frame.flag) for frame in frames)
    if count != usable:
        yield Undetermined(
            "frames-faint",
            "{faint} of {frames} frames show no light above the noise and are left out; photograph "
            "earlier (times:), or charge for longer",
            faint=usable - count,
            frames=usable,
        )


def _clipping_warnings(frames: FilterFrames) -> Iterator[ResultWarning]:
    clipped = np.isnan(frames.value_dn_per_s)
    if clipped.any():
        yield Disturbance(
            "values-clipped",
            "{clipped:.0%} of the values clip and are left out, {clipped_everywhere} of {places} "
            "in every frame; expose for less or lower the ISO",
            clipped=clipped.mean(),
            clipped_everywhere=int(clipped.all(axis=0).sum()),
            places=clipped.shape[1],
        )
