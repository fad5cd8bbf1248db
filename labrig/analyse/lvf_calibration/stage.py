"""The part of an LVF's calibration: its file, its figures, what it says."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from labrig.analyse.lvf_calibration import figures
from labrig.analyse.lvf_calibration.calibrating import Calibrated, calibrate
from labrig.analyse.lvf_calibration.filters import residuals
from labrig.analyse.lvf_calibration.lines import Stripes, told
from labrig.analyse.part import Part, StageResult
from labrig.calibration import write_lvf_file
from labrig.report import Picture, Section, Table
from labrig.written_numbers import plus_minus, rounded

#: Rows of the table of positions; the file has them all.
_ROWS = 11
#: Misfit of the filters beyond which the curves are worth a look.
BAD_MISFIT = 3.0
#: Shift of the sample that is worth a word.
SHIFTED_NM = 2.0


def process(part: Part) -> StageResult:
    """Write lvf.yaml.

    Raises
    ------
    DataError, FitError
        As `calibrate`.
    """
    made = calibrate(part)
    write_lvf_file(part.folder / "lvf.yaml", made.file)
    return StageResult(
        known=replace(part.inputs, lvf=made.file),
        sections=(_map_section(made), _band_section(made)),
        lines=tuple(_lines(made)),
        warnings=tuple(_warnings(made)),
    )


def _lines(made: Calibrated) -> Iterator[str]:
    lines, bands = made.before_camera.lines, made.file.bands
    yield (
        f"mercury lines {told(lines)}; the map leaves {rounded(made.fit.rms_nm, 2)} nm rms "
        f"({'straight' if made.fit.order == 1 else 'bent'})"
    )
    yield (
        f"{len(made.scenes.filters) - 1} colour filters: {len(bands.centre_nm)} bands from "
        f"{_at(made, 0)} to {_at(made, -1)} nm"
    )
    middle = len(bands.centre_nm) // 2
    width = plus_minus(bands.fwhm_nm[middle], made.file.sigma.fwhm_nm[middle])
    yield f"width {width} nm at {_at(made, middle)} nm"
    yield f"on the sample: lines {told(made.on_sample.lines)}; {_stripes_text(made)}"


def _at(made: Calibrated, number: int) -> str:
    return plus_minus(made.file.bands.centre_nm[number], made.file.sigma.centre_nm[number])


def _stripes_text(made: Calibrated) -> str:
    if isinstance(made.stripes, str):
        return f"its place as on the card ± {rounded(made.placed.sigma_nm, 2)} nm ({made.stripes})"
    shift = plus_minus(made.stripes.shift_nm, made.stripes.sigma_nm)
    return f"its glow is {shift} nm from where the card was lit"


def _warnings(made: Calibrated) -> Iterator[str]:
    yield from map(str, made.wrong)
    if np.median(made.found.misfit) > BAD_MISFIT:
        yield (
            f"the filters contradict one another (misfit {np.median(made.found.misfit):.1f}, 1 is "
            "expected): check the curves of lamp, camera and filters; σ was raised by as much"
        )
    if isinstance(made.stripes, Stripes) and abs(made.stripes.shift_nm) > SHIFTED_NM:
        yield (
            f"the sample is seen {made.stripes.shift_nm:+.1f} nm along the strip from where the "
            "card was lit: the card lay higher, or the door does not open to the same place; the "
            "map on the sample was shifted by that"
        )


def _map_section(made: Calibrated) -> Section:
    before, on = made.before_camera, made.on_sample
    wavelengths = made.fit.map
    fits = {
        "before the camera": figures.line_residuals(before.lines, made.fit.residual_nm),
        "on the sample": figures.line_residuals(on.lines, made.placed.residual_nm),
    }
    return Section(
        "Wavelength along the strip",
        (
            f"Lines found before the camera: {told(before.lines)}; on the sample: "
            f"{told(on.lines)}. {_stripes_text(made).capitalize()}.",
        ),
        (
            Picture(
                "lines",
                figures.profile_figure(before, wavelengths),
                "The strip under the mercury lamp, looked through; dashed: the lines as located. "
                "Of a blend, its first line.",
            ),
            Picture(
                "lines-on-sample",
                figures.profile_figure(on, wavelengths),
                "The strip on the sample under the mercury lamp, seen on the grey card.",
            ),
            Picture(
                "line-residuals",
                figures.line_residual_figure(fits),
                "Wavelength of the map minus that of each line, with 1 σ of its place.",
            ),
        ),
    )


def _band_section(made: Calibrated) -> Section:
    file, lvf = made.file, made.file.lvf
    left = residuals(made.scenes, replace(made.bench, camera=made.found.camera), lvf)[1:]
    names = tuple(one.name for one in made.scenes.filters[1:])
    return Section(
        "What the strip lets through",
        (
            f"From {len(names)} colour filters over the grey card, in units of the card seen "
            f"without the strip. Misfit per value {figures.misfit_text(made.found)}; where it is "
            "above 1, σ was raised by it. Positions at the ends rest on few and faint values: "
            "their σ is larger. The camera's curves were fitted along, since they are wrong in the "
            "same way at every position.",
            "Widths are those of skewed Gaussians: of bands that are flatter on top they may be "
            "4-5 % too small, beyond σ.",
        ),
        (
            Picture(
                "transmission",
                figures.transmission_figure(file),
                "Transmission at every position along the strip.",
            ),
            Picture(
                "along",
                figures.along_figure(file),
                "Centre minus a straight line (grey: the map by the lines alone) and full width at "
                "half maximum of the bands, with 1 σ.",
            ),
            Picture(
                "camera-curves",
                figures.camera_figure(made.bench.camera, made.found.camera),
                "The camera's curves as the filters tell them; dashed: as their file has them.",
            ),
            Picture(
                "filter-residuals",
                figures.filter_residual_figure(left, names, lvf.bands.centre_nm),
                "Transmittance of every colour filter along the strip, measured minus expected, "
                "in per cent.",
            ),
        ),
        (_table(made),),
    )


def _table(made: Calibrated) -> Table:
    bands, sigma = made.file.bands, made.file.sigma
    count = len(made.file.position)
    chosen = sorted({round(row) for row in np.linspace(0, count - 1, _ROWS)})
    rows = [
        (
            f"p{k:02d}",
            plus_minus(bands.centre_nm[k], sigma.centre_nm[k]),
            plus_minus(bands.fwhm_nm[k], sigma.fwhm_nm[k]),
            plus_minus(100 * bands.peak[k], 100 * sigma.peak[k]),
            plus_minus(100 * bands.leakage[k], 100 * sigma.leakage[k]),
        )
        for k in chosen
    ]
    head = ("Position", "Centre / nm", "Width / nm", "Peak / %", "Leakage / %")
    return Table(head, tuple(rows), "Some of the positions; all are in lvf.yaml.")
