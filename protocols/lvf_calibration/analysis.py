"""Analysis of the calibration of a variable filter, from its frames to its result."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import StripFrames
from labrig.bench_optics import (
    camera_curves,
    card_reflectance,
    filter_transmittances,
    lamp_spectrum,
)
from labrig.calibration import CAMERA_KIND, BandColumns, CurveColumns, LvfFile, WavelengthColumns
from labrig.fit.lvf import (
    LvfCalibration,
    WavelengthFit,
    calibrate_lvf,
    fit_wavelengths,
    locate_lines,
)
from labrig.fit.spectrum import CurveError
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning
from labrig.optics import (
    CameraResponse,
    Lvf,
    Spectrum,
    Strip,
    Transmittance,
    WavelengthMap,
    nominal_lvf,
    quadrature,
)
from labrig.protocols.lvf_calibration.result import (
    CameraCurves,
    FilterMisfit,
    LvfCalibrationResult,
    PlacedStrip,
    Stripes,
    StripLines,
)
from labrig.protocols.steps.strip_scenes import LvfFrames, filter_unit
from labrig.reduce import FLICKER, slice_values, strip_profile_in
from labrig.results import SliceValues, StripProfile

#: Root mean square error expected of transmittances along a strip: by the map, bands of another
#: shape, a filter that differs from its table.
EXPECTED = 0.05
#: Factor by which another filter must explain a frame better to be taken for the one in place.
BETTER = 3.0
#: Root mean square error beyond which no known filter is in place.
FAR_OFF = 0.15
#: Light of the places that identify a filter, as a fraction of the brightest one's.
BRIGHT = 0.25
#: Relative deviation of a gel from its table, and of a table of few points from the curve.
TABLE = 0.02
#: Error model of the camera's curves, which are worst at the ends of the spectrum and where a
#: channel is nearly blind; neighbouring bands constrain these errors if they are allowed for. A
#: tenth of a curve is 0.04 rms over the visible, as three laboratories disagree.
CURVES = CurveError(relative=0.1, added=0.03)
#: Significance in σ of a place's value without a filter from which its transmittance is defined.
CLEAR = 30.0

NO_FILTER = Transmittance("none", np.array([300.0, 900.0]), np.ones(2))


@dataclass(frozen=True, eq=False)
class FilterScenes:
    """Frames through the strip with each filter.

    Attributes
    ----------
    position
        Positions along the strip, rising, shape (p,).
    filters
        Transmittances of the f filters; the first is `NO_FILTER`.
    values
        Slice values with each filter, in the same order.
    card
        Slice values of the card at the same places without the strip.
    """

    position: FloatArray
    filters: Sequence[Transmittance]
    values: Sequence[SliceValues]
    card: SliceValues

    def without(self, names: set[str]) -> "FilterScenes":
        """Return the scenes without the filters of these names."""
        kept = [
            number
            for number, transmittance in enumerate(self.filters)
            if transmittance.name not in names
        ]
        return replace(
            self,
            filters=[self.filters[number] for number in kept],
            values=[self.values[number] for number in kept],
        )


@dataclass(frozen=True)
class Bench:
    """Known spectra on the light's path.

    Attributes
    ----------
    lamp
        Spectrum of the lamp.
    card
        Reflectance of the card.
    camera
        Curves of the camera.
    """

    lamp: Spectrum
    card: Transmittance
    camera: CameraResponse

    def card_values(self) -> FloatArray:
        """Return ∫ L R S_c dλ, the signal of the card itself, shape (channels,)."""
        nodes, light = self._light()
        values: FloatArray = light @ self.camera.at(nodes)
        return values

    def relative(self, lvf: Lvf, filters: Sequence[Transmittance]) -> FloatArray:
        """Return values relative to those without a filter, shape (filters, p, channels)."""
        nodes, light = self._light(*(transmittance.wavelength_nm for transmittance in filters))
        through_strip = lvf.transmission(nodes) * light
        sensitivity = self.camera.at(nodes)
        unfiltered = through_strip @ sensitivity
        transmitted = [
            (through_strip * transmittance.at(nodes)) @ sensitivity for transmittance in filters
        ]
        relative: FloatArray = np.stack(transmitted) / np.maximum(
            unfiltered, 1e-12 * unfiltered.max()
        )
        return relative

    def _light(self, *knots: FloatArray) -> tuple[FloatArray, FloatArray]:
        curves = (self.camera.wavelength_nm, self.lamp.wavelength_nm, self.card.wavelength_nm)
        low, high = float(curves[0][0]), float(curves[0][-1])
        nodes, weights = quadrature(low, high, *curves, *knots)
        return nodes, weights * self.lamp.at(nodes) * self.card.at(nodes)


def misfits(scenes: FilterScenes, bench: Bench, wavelengths: WavelengthMap) -> list[FilterMisfit]:
    """Return the misfit of every filter but the first.

    The nominal bands of the maker suffice: the test is where along the strip a filter absorbs, and
    the camera's curves cancel in the ratio to the frame without it.
    """
    lvf = nominal_lvf(wavelengths, wavelengths.wavelength_nm(scenes.position))
    expected = bench.relative(lvf, scenes.filters)
    unfiltered = scenes.values[0].value
    # In its brightest colour a place sees its band, in the others and at dim ends what leaks.
    fraction = np.nan_to_num(unfiltered / scenes.card.value)
    brightest = np.argmax(fraction, axis=1)
    bright = fraction.max(axis=1) > BRIGHT * fraction.max()
    places = np.flatnonzero(bright), brightest[bright]
    filter_misfits = []
    for number, scene in enumerate(scenes.values[1:], start=1):
        ratio = scene.value[places] / unfiltered[places]
        deviation = np.sqrt(np.nanmean((expected[:, *places] - ratio) ** 2, axis=1))
        best = int(np.argmin(deviation))
        name = scenes.filters[number].name
        best_name = scenes.filters[best].name
        is_other_filter = best_name != name and deviation[number] > BETTER * deviation[best]
        is_left_out = deviation[number] > FAR_OFF or (
            deviation[number] > EXPECTED and is_other_filter
        )
        filter_misfits.append(
            FilterMisfit(
                name, float(deviation[number]), float(deviation[best]), best_name, bool(is_left_out)
            )
        )
    return filter_misfits


def left_out_warning(misfit: FilterMisfit) -> ResultWarning:
    """Return a warning about a filter that was not in its place."""
    likeness = "it looks like none of the others"
    if misfit.like != misfit.name and misfit.own > BETTER * misfit.best:
        best_name = "no filter" if misfit.like == NO_FILTER.name else misfit.like
        likeness = f"it looks like {best_name} ({misfit.best:.3f})"
    return Contradiction(
        "filter-misplaced",
        "its picture is off its transmittance by {rms:.3f} (rms along the strip), {likeness}; it "
        "was not in its place, and is left out (put it in and take its unit again, or correct its "
        "file)",
        subject=f"colour filter {misfit.name}",
        rms=misfit.own,
        likeness=likeness,
    )


def fit_bands(scenes: FilterScenes, bench: Bench, wavelengths: WavelengthMap) -> LvfCalibration:
    """Fit T_p(λ) at every position, in units of the card seen without the strip.

    The effect of lens, lamp and card on a place is divided out by the frame of the card itself, and
    so is the ratio of the camera's channels under this lamp.
    """
    reference = bench.card_values() / scenes.card.value
    value = np.stack([scene.value * reference for scene in scenes.values], axis=1)
    sigma = [
        np.hypot(scene.sigma, (FLICKER if transmittance is NO_FILTER else TABLE) * scene.value)
        * reference
        for transmittance, scene in zip(scenes.filters, scenes.values, strict=True)
    ]
    calibration = calibrate_lvf(
        scenes.position,
        value,
        np.stack(sigma, axis=1),
        filters=scenes.filters,
        lamp=bench.lamp,
        card=bench.card,
        camera=bench.camera,
        wavelengths=wavelengths,
        curve_error=CURVES,
    )
    return replace(calibration, camera=_balanced(calibration.camera, bench, scenes.card))


def _balanced(camera: CameraResponse, bench: Bench, card: SliceValues) -> CameraResponse:
    """Return the curves in the ratios in which this camera's channels see the card.

    The fit is in units of the card, channel by channel, so that its curves keep the ratios of those
    it began with: another camera's, by which a glow would be up to a tenth too blue or too red.
    """
    is_known = np.isfinite(card.value).all(axis=1)
    if not is_known.any():
        return camera
    seen = replace(bench, camera=camera).card_values()
    # A place is as bright in all channels as lens and lamp make it.
    places = card.value[is_known] / card.value[is_known].mean(axis=1, keepdims=True)
    sensitivity = camera.sensitivity * (places.mean(axis=0) / seen)
    return replace(camera, sensitivity=sensitivity / sensitivity.max())


def residuals(scenes: FilterScenes, bench: Bench, lvf: Lvf) -> FloatArray:
    """Return measured transmittance minus that of the calibrated strip, shape (filters, p).

    It is the mean of the channels weighted by their light; NaN where it is undetermined.
    """
    expected = bench.relative(lvf, scenes.filters)
    unfiltered = scenes.values[0]
    is_clear = unfiltered.value > CLEAR * unfiltered.sigma
    weight = np.where(is_clear, unfiltered.value, 0.0)
    total = weight.sum(axis=1)
    rows = []
    for scene, expected_ratio in zip(scenes.values, expected, strict=True):
        residual = np.where(
            is_clear, scene.value / np.where(is_clear, unfiltered.value, 1.0) - expected_ratio, 0.0
        )
        mean = (weight * np.nan_to_num(residual)).sum(axis=1) / np.where(total > 0, total, 1.0)
        rows.append(np.where(total > 0, mean, np.nan))
    return np.array(rows)


#: Range of positions, from the blue end to the red end.
WHOLE = (0.0, 1.0)
#: Mercury lines in nm that excite phosphors; those of longer wavelength seldom do.
EXCITING_NM = (365.02, 404.6565, 407.7837, 435.8335, 546.0750)
#: Largest shift of the sample by the door, as a fraction of the strip's length.
MAX_SHIFT = 0.08
#: Fraction of the variance along the strip that detected stripes explain at least.
MIN_EXPLAINED = 0.7


def strip_lines(profile: StripProfile, strip: Strip, rising: bool | None) -> StripLines:
    """Locate the lines.

    Parameters
    ----------
    profile
        Light of the mercury lamp along the strip.
    strip
        Place of the strip; the direction of its wavelengths does not matter.
    rising
        Whether wavelengths are expected to rise from left to right; None accepts both directions.

    Raises
    ------
    FitError
        There are no lines, or the strip is the wrong way round.
    """
    lines = locate_lines(profile.position, profile.value_dn_per_s, rising=rising)
    position = lines.position if lines.rising else 1 - lines.position
    return StripLines(
        strip.model_copy(update={"rising": lines.rising}),
        profile,
        replace(lines, position=position),
    )


def wavelengths_along(lamp_strip: StripLines) -> WavelengthFit:
    """Fit the wavelength by the position from the blue end to the red end."""
    return fit_wavelengths(lamp_strip.lines, WHOLE)


def place_on_sample(lamp_strip: StripLines, wavelengths: WavelengthMap) -> PlacedStrip:
    """Move the ends of a strip until its lines agree with the filter's map.

    The lamp's light is oblique and the camera sees the strip from another distance: it is shifted
    and stretched, but the filter is the same.

    Raises
    ------
    DataError
        The strip would leave the frame.
    """
    lines = lamp_strip.lines
    slope = np.abs(np.gradient(wavelengths.wavelength_nm(np.linspace(*WHOLE, 201)), 0.005)).mean()
    sigma = np.hypot(lines.sigma, 0.1 / slope)
    map_position = wavelengths.position(lines.wavelength_nm)
    (stretch, shift), covariance = np.polyfit(
        map_position, lines.position, 1, w=1 / sigma, cov="unscaled"
    )
    strip = _move_ends(lamp_strip.strip, float(shift), float(shift + stretch))
    position = (lines.position - shift) / stretch
    terms = np.array([map_position.mean(), 1.0])
    return PlacedStrip(
        strip,
        wavelengths.wavelength_nm(position) - lines.wavelength_nm,
        float(slope * np.sqrt(terms @ covariance @ terms)),
    )


def _move_ends(strip: Strip, blue: float, red: float) -> Strip:
    """Return the strip whose blue and red ends are at these positions along the old one."""
    start, end = (blue, red) if strip.rising else (1 - red, 1 - blue)
    left, right = np.array(strip.left), np.array(strip.right)
    ends = [left + fraction * (right - left) for fraction in (start, end)]
    # What leaves the frame at an end does so by a pixel or two of a strip that fills it.
    (x0, y0), (x1, y1) = (np.clip(point, 0.0, 1.0).tolist() for point in ends)
    try:
        return Strip(left=(x0, y0), right=(x1, y1), height=strip.height, rising=strip.rising)
    except ValueError:
        raise DataError(
            "by its mercury lines the strip on the sample would leave the frame; aim the camera so "
            "that all of it is seen"
        ) from None


def shifted_by_stripes(
    profile: StripProfile, strip: Strip, lvf: Lvf, nm_per_strip: float
) -> Stripes:
    """Shift the strip until the stripes of glow lie where the filter transmits mercury lines.

    Heights of the lines are free: how strongly each of them excites is unknown here.

    Raises
    ------
    FitError
        No stripes are detected.
    """
    position = profile.position if strip.rising else 1 - profile.position
    glow = profile.value_dn_per_s.sum(axis=1)
    shapes = lvf.transmission(np.array(EXCITING_NM)).T
    variation = float(((glow - glow.mean()) ** 2).sum())

    def residual_square(shift: float) -> float:
        unshifted = np.clip(position - shift, lvf.position[0], lvf.position[-1])
        columns = [np.interp(unshifted, lvf.position, shape) for shape in shapes]
        design = np.column_stack([*columns, np.ones_like(unshifted)])
        residual = glow - design @ nonnegative_least_squares(design, glow)
        return float(residual @ residual)

    coarse = np.linspace(-MAX_SHIFT, MAX_SHIFT, 33)
    best = coarse[np.argmin([residual_square(shift) for shift in coarse])]
    step = coarse[1] - coarse[0]
    # Least squares, but of curves with a kink at every position of the filter: without slopes.
    result = minimize_scalar(residual_square, bounds=(best - step, best + step), method="bounded")
    if not variation or result.fun > (1 - MIN_EXPLAINED) * variation:
        raise FitError("no stripes of mercury lines are seen on the sample")
    shift = float(result.x)
    curvature = (
        residual_square(shift + step) + residual_square(shift - step) - 2 * result.fun
    ) / step**2
    noise = result.fun / max(len(glow) - len(EXCITING_NM) - 2, 1)
    sigma = float(np.sqrt(2 * noise / curvature)) if curvature > 0 else MAX_SHIFT
    return Stripes(_move_ends(strip, shift, 1 + shift), shift * nm_per_strip, sigma * nm_per_strip)


#: Misfit of the filters in σ beyond which a warning is given.
BAD_MISFIT = 3.0
#: Shift of the sample in nm beyond which a warning is given.
SHIFTED_NM = 2.0


def analyse(context: AnalysisContext) -> LvfCalibrationResult:
    """Locate the strip and its lines, then fit its bands to the frames of the colour filters.

    Raises
    ------
    DataError
        Frames are missing or damaged, or show no strip, or one that is tilted.
    FitError
        There are no mercury lines, the filter is the wrong way round, or there are too few colour
        filters.
    """
    protocol, frames = context.protocol, StripFrames(context)
    strip = frames.find_strip(LvfFrames.FILTER, filter_unit(None)).strip(rising=True)
    before_camera = strip_lines(frames.profile(LvfFrames.LINES, strip), strip, protocol.rising)
    fit = wavelengths_along(before_camera)
    strip = frames.find_strip(LvfFrames.STRIP_ON_SAMPLE).strip(rising=True)
    on_sample = strip_lines(
        frames.profile(LvfFrames.LINES_ON_SAMPLE, strip), strip, protocol.rising_on_sample
    )
    placed = place_on_sample(on_sample, fit.map)
    bench = Bench(
        lamp_spectrum(context.rig),
        card_reflectance(context.rig),
        camera_curves(context.rig, context.overrides.camera),
    )
    all_scenes = _scenes(context, frames, before_camera.strip)
    filter_misfits = tuple(misfits(all_scenes, bench, fit.map))
    scenes = all_scenes.without({misfit.name for misfit in filter_misfits if misfit.left_out})
    lvf_fit = fit_bands(scenes, bench, fit.map)
    stripes, no_stripes_reason = _stripes(context, frames, placed.strip, lvf_fit, fit.map)
    filters = tuple(transmittance.name for transmittance in scenes.filters[1:])
    assert lvf_fit.lvf.sigma is not None, "a calibration tells its σ"
    file = LvfFile(
        position=tuple(lvf_fit.lvf.position.tolist()),
        bands=BandColumns.of(lvf_fit.lvf.bands),
        sigma=BandColumns.of(lvf_fit.lvf.sigma),
        remainder_nm=tuple(lvf_fit.lvf.remainder_nm.tolist()),
        remainder=tuple(tuple(row) for row in lvf_fit.lvf.remainder.tolist()),
        wavelengths=WavelengthColumns.of(fit.map),
        before_camera=before_camera.strip,
        on_sample=stripes.strip if stripes else placed.strip,
        camera=CurveColumns.of(lvf_fit.camera),
        source=f"{len(filters)} colour filters and mercury lines, measured with labrig",
        run=context.run.name,
    )
    return LvfCalibrationResult(
        calibration=file,
        before_camera=before_camera,
        on_sample=on_sample,
        map_residual_nm=fit.residual_nm,
        map_order=fit.order,
        placed=placed,
        stripes=stripes,
        no_stripes_reason=no_stripes_reason,
        card=all_scenes.card,
        through_filters={
            transmittance.name: values
            for transmittance, values in zip(all_scenes.filters, all_scenes.values, strict=True)
        },
        filter_misfits=filter_misfits,
        filters=filters,
        transmittance_residual=residuals(scenes, replace(bench, camera=lvf_fit.camera), file.lvf)[
            1:
        ],
        band_misfit=lvf_fit.misfit,
        camera_before=CameraCurves(bench.camera.wavelength_nm, bench.camera.sensitivity),
        warnings=tuple(_warnings(filter_misfits, lvf_fit.misfit, stripes)),
    )


def _scenes(context: AnalysisContext, frames: StripFrames, strip: Strip) -> FilterScenes:
    completed = context.run.completed()
    names = [name for name in context.protocol.filter_names() if f"filter-{name}" in completed]
    lit = [*frames.of(LvfFrames.CARD), *frames.of(LvfFrames.FILTER)]
    values = slice_values(lit, strip, frames.dark, context.inputs[CAMERA_KIND])
    return FilterScenes(
        np.array(strip.positions(*frames.size)),
        [NO_FILTER, *filter_transmittances(context.rig, names)],
        [values[f"filter-{name}"] for name in (NO_FILTER.name, *names)],
        values["card"],
    )


def _stripes(
    context: AnalysisContext,
    frames: StripFrames,
    strip: Strip,
    lvf_fit: LvfCalibration,
    wavelengths: WavelengthMap,
) -> tuple[Stripes | None, str]:
    """Locate the stripes that glow, or return the reason why there are none."""
    if context.protocol.stripes == "none":
        return None, "no stripes were asked for"
    nm = wavelengths.wavelength_nm([0.0, 1.0])
    reason = "no stripes were photographed"
    # A glow fades while it is photographed: one frame, the fullest that does not clip.
    for frame in sorted(frames.of(LvfFrames.STRIPES), key=lambda frame: -frame.exposure_s):
        try:
            profile = strip_profile_in([frame], strip, frames.hot)
            return shifted_by_stripes(profile, strip, lvf_fit.lvf, float(abs(nm[1] - nm[0]))), ""
        except DataError as error:  # it clips, or nothing is seen
            reason = str(error)
    return None, reason


def _warnings(
    filter_misfits: tuple[FilterMisfit, ...], misfit: FloatArray, stripes: Stripes | None
) -> Iterator[ResultWarning]:
    yield from (
        left_out_warning(filter_misfit)
        for filter_misfit in filter_misfits
        if filter_misfit.left_out
    )
    if np.median(misfit) > BAD_MISFIT:
        yield Contradiction(
            "filters-contradict",
            "the filters contradict one another (misfit {misfit:.1f}, 1 is expected): check the "
            "curves of lamp, camera and filters; σ was raised by as much",
            misfit=np.median(misfit),
        )
    if stripes and abs(stripes.shift_nm) > SHIFTED_NM:
        yield Disturbance(
            "strip-shifted",
            "the sample is seen {shift_nm:+.1f} nm along the strip from where the card was lit: "
            "the card lay higher, or the door does not open to the same place; the map on the "
            "sample was shifted by that",
            shift_nm=stripes.shift_nm,
        )
