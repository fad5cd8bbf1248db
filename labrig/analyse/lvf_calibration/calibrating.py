"""From the frames of a calibration run to a calibrated filter."""

from dataclasses import dataclass

import numpy as np

from labrig.analyse.bench_curves import (
    camera_curves,
    card_reflectance,
    filter_transmittances,
    lamp_spectrum,
)
from labrig.analyse.lvf_calibration.filters import (
    NO_FILTER,
    Bench,
    FilterScenes,
    Misfit,
    calibrated,
    misfits,
)
from labrig.analyse.lvf_calibration.finder import find_strip
from labrig.analyse.lvf_calibration.lines import (
    Placed,
    Stripes,
    StripLines,
    place_on_sample,
    shifted_by_stripes,
    strip_lines,
    wavelengths_along,
)
from labrig.analyse.lvf_calibration.picture import read_picture
from labrig.analyse.lvf_calibration.slices import slice_values
from labrig.analyse.lvf_calibration.strip_frames import StripFrames
from labrig.analyse.part import Part
from labrig.calibration import LvfFile
from labrig.calibration.lvf_file import BandColumns, CurveColumns, Strip, WavelengthColumns
from labrig.errors import DataError
from labrig.fit.lvf import LvfCalibration, WavelengthFit


@dataclass(frozen=True, eq=False)
class Calibrated:
    """All that a calibration run gives.

    Attributes
    ----------
    file
        As it is written.
    before_camera, on_sample
        The strip under mercury, looked through and on the sample.
    fit
        The map by the lines, before the filters.
    placed, stripes
        The strip on the sample by its lines, and by what glows; why not, if there are no stripes.
    found, scenes, bench
        The fit of the filters, of what, with what.
    wrong
        Filters that were left out.
    """

    file: LvfFile
    before_camera: StripLines
    on_sample: StripLines
    fit: WavelengthFit
    placed: Placed
    stripes: Stripes | str
    found: LvfCalibration
    scenes: FilterScenes
    bench: Bench
    wrong: tuple[Misfit, ...]


def calibrate(part: Part) -> Calibrated:
    """Find strip and lines, then fit what the filters say.

    Raises
    ------
    DataError
        Frames are missing or damaged, or show no strip, or one that is tilted.
    FitError
        No mercury lines, the filter the wrong way round, or too few filters.
    """
    frames = StripFrames(part)
    strip = find_strip(frames.picture("lvf-filter", "filter-none")).strip(rising=True)
    before_camera = strip_lines(frames.picture("lvf-lines"), strip, part.protocol.rising)
    fit = wavelengths_along(before_camera)
    strip = find_strip(frames.picture("lvf-strip-on-sample")).strip(rising=True)
    on_sample = strip_lines(
        frames.picture("lvf-lines-on-sample"), strip, part.protocol.rising_on_sample
    )
    placed = place_on_sample(on_sample, fit.map)
    bench = Bench(
        lamp_spectrum(part.rig),
        card_reflectance(part.rig),
        camera_curves(part.rig, part.choices),
    )
    every = _scenes(part, frames, before_camera.strip)
    wrong = tuple(one for one in misfits(every, bench, fit.map) if one.is_wrong)
    scenes = every.without({one.name for one in wrong})
    found = calibrated(scenes, bench, fit.map)
    stripes = _stripes(part, frames, placed.strip, found, fit)
    seen = stripes.strip if isinstance(stripes, Stripes) else placed.strip
    file = _file(part, scenes, found, fit, (before_camera.strip, seen))
    return Calibrated(
        file, before_camera, on_sample, fit, placed, stripes, found, scenes, bench, wrong
    )


def _scenes(part: Part, frames: StripFrames, strip: Strip) -> FilterScenes:
    names = [name for name in part.protocol.filter_names() if _complete(part, name)]
    lit = [*frames.of("lvf-card"), *frames.of("lvf-filter")]
    values = slice_values(lit, strip, frames.dark, part.inputs.camera)
    return FilterScenes(
        np.array(strip.positions(*frames.size)),
        [NO_FILTER, *filter_transmittances(part.rig, names)],
        [values[f"filter-{name}"] for name in (NO_FILTER.name, *names)],
        values["card"],
    )


def _complete(part: Part, filter_name: str) -> bool:
    return f"filter-{filter_name}" in part.run.completed()


def _stripes(
    part: Part, frames: StripFrames, strip: Strip, found: LvfCalibration, fit: WavelengthFit
) -> Stripes | str:
    if part.protocol.stripes == "none":
        return "no stripes were asked for"
    nm = fit.map.wavelength_nm([0.0, 1.0])
    why = "no stripes were photographed"
    # A glow fades while it is photographed: one frame, the fullest that does not clip.
    for frame in sorted(frames.of("lvf-stripes"), key=lambda frame: -frame.exposure_s):
        try:
            picture = read_picture([frame], frames.hot)
            return shifted_by_stripes(picture, strip, found.lvf, float(abs(nm[1] - nm[0])))
        except DataError as error:  # it clips, or nothing is seen
            why = str(error)
    return why


def _file(
    part: Part,
    scenes: FilterScenes,
    found: LvfCalibration,
    fit: WavelengthFit,
    strips: tuple[Strip, Strip],
) -> LvfFile:
    lvf = found.lvf
    assert lvf.sigma is not None, "a calibration tells its σ"
    return LvfFile(
        position=tuple(lvf.position.tolist()),
        bands=BandColumns.of(lvf.bands),
        sigma=BandColumns.of(lvf.sigma),
        remainder_nm=tuple(lvf.remainder_nm.tolist()),
        remainder=tuple(tuple(row) for row in lvf.remainder.tolist()),
        wavelengths=WavelengthColumns.of(fit.map),
        before_camera=strips[0],
        on_sample=strips[1],
        camera=CurveColumns.of(found.camera),
        source=f"{len(scenes.filters) - 1} colour filters and mercury lines, measured with labrig",
        run=part.run.folder.resolve().name,
    )
