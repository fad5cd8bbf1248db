"""Analysis of the calibration of a variable filter, from its frames to its result."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from labrig.analyse.inputs import Part
from labrig.analyse.strip import StripFrames
from labrig.bench_optics import (
    camera_curves,
    card_reflectance,
    filter_transmittances,
    lamp_spectrum,
)
from labrig.calibration import CAMERA_KIND, BandColumns, CurveColumns, LvfFile, WavelengthColumns
from labrig.fit.lvf import LvfCalibration
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import Strip, WavelengthMap
from labrig.protocols.lvf_calibration.analysis.filters import (
    NO_FILTER,
    Bench,
    FilterScenes,
    fit_bands,
    left_out_text,
    misfits,
    residuals,
)
from labrig.protocols.lvf_calibration.analysis.lines import (
    place_on_sample,
    shifted_by_stripes,
    strip_lines,
    wavelengths_along,
)
from labrig.protocols.lvf_calibration.result import (
    CameraCurves,
    FilterMisfit,
    LvfCalibrationResult,
    Stripes,
)
from labrig.protocols.steps.strip_scenes import LvfFrames, filter_unit
from labrig.reduce import slice_values, strip_profile_in

#: Misfit of the filters in σ beyond which a warning is given.
BAD_MISFIT = 3.0
#: Shift of the sample in nm beyond which a warning is given.
SHIFTED_NM = 2.0


def analyse(part: Part) -> LvfCalibrationResult:
    """Locate the strip and its lines, then fit its bands to the frames of the colour filters.

    Raises
    ------
    DataError
        Frames are missing or damaged, or show no strip, or one that is tilted.
    FitError
        There are no mercury lines, the filter is the wrong way round, or there are too few colour
        filters.
    """
    protocol, frames = part.protocol, StripFrames(part)
    strip = frames.find_strip(LvfFrames.FILTER, filter_unit(None)).strip(rising=True)
    before_camera = strip_lines(frames.profile(LvfFrames.LINES, strip), strip, protocol.rising)
    fit = wavelengths_along(before_camera)
    strip = frames.find_strip(LvfFrames.STRIP_ON_SAMPLE).strip(rising=True)
    on_sample = strip_lines(
        frames.profile(LvfFrames.LINES_ON_SAMPLE, strip), strip, protocol.rising_on_sample
    )
    placed = place_on_sample(on_sample, fit.map)
    bench = Bench(
        lamp_spectrum(part.rig),
        card_reflectance(part.rig),
        camera_curves(part.rig, part.overrides.camera),
    )
    all_scenes = _scenes(part, frames, before_camera.strip)
    filter_misfits = tuple(misfits(all_scenes, bench, fit.map))
    scenes = all_scenes.without({misfit.name for misfit in filter_misfits if misfit.left_out})
    lvf_fit = fit_bands(scenes, bench, fit.map)
    stripes, no_stripes_reason = _stripes(part, frames, placed.strip, lvf_fit, fit.map)
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
        run=part.run.name,
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


def _scenes(part: Part, frames: StripFrames, strip: Strip) -> FilterScenes:
    completed = part.run.completed()
    names = [name for name in part.protocol.filter_names() if f"filter-{name}" in completed]
    lit = [*frames.of(LvfFrames.CARD), *frames.of(LvfFrames.FILTER)]
    values = slice_values(lit, strip, frames.dark, part.inputs[CAMERA_KIND])
    return FilterScenes(
        np.array(strip.positions(*frames.size)),
        [NO_FILTER, *filter_transmittances(part.rig, names)],
        [values[f"filter-{name}"] for name in (NO_FILTER.name, *names)],
        values["card"],
    )


def _stripes(
    part: Part,
    frames: StripFrames,
    strip: Strip,
    lvf_fit: LvfCalibration,
    wavelengths: WavelengthMap,
) -> tuple[Stripes | None, str]:
    """Locate the stripes that glow, or return the reason why there are none."""
    if part.protocol.stripes == "none":
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
) -> Iterator[str]:
    yield from (
        left_out_text(filter_misfit) for filter_misfit in filter_misfits if filter_misfit.left_out
    )
    if np.median(misfit) > BAD_MISFIT:
        yield (
            f"the filters contradict one another (misfit {np.median(misfit):.1f}, 1 is "
            "expected): check the curves of lamp, camera and filters; σ was raised by as much"
        )
    if stripes and abs(stripes.shift_nm) > SHIFTED_NM:
        yield (
            f"the sample is seen {stripes.shift_nm:+.1f} nm along the strip from where the "
            "card was lit: the card lay higher, or the door does not open to the same place; the "
            "map on the sample was shifted by that"
        )
