"""A blank, from its run to blank.yaml."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from labrig.calibration import BlankFile, write_blank_file
from labrig.process.blank.pictures import section
from labrig.process.blank.stray_light import StrayLight, ambient, stray_light
from labrig.process.hot_pixels import hot_pixels_of
from labrig.process.stage import Stage, StageResult
from labrig.process.stage_frames import stage_frames, stage_region
from labrig.process.this_camera import insist_on_this_camera
from labrig.process.timed_frames import intact_frames, timing_warnings
from labrig.reduce import measure, read_raw, reduce_patches
from labrig.report.written_numbers import plus_minus, rounded


def process(stage: Stage) -> StageResult:
    """Write blank.yaml.

    Raises
    ------
    DataError
        No sequence is complete, or a frame is missing or was changed.
    """
    protocol, run, camera = stage.protocol, stage.run, stage.known.camera
    region = stage_region(stage, protocol.region)
    frames = intact_frames(run, stage.choices, "blank")
    insist_on_this_camera(camera, run, stage_frames(stage, "blank"))
    series = reduce_patches(frames.decay, {"blank": region}, frames.dark, camera=camera)["blank"]
    # Hot pixels are of one colour: left in, they look like light.
    hot = hot_pixels_of(frames.dark)
    darks = [
        replace(measure(read_raw(frame.path), region, hot), exposure_s=frame.exposure_s)
        for frame in frames.dark
    ]
    least_dn = protocol.clean.share * (darks[0].white - max(darks[0].black))
    found = stray_light(series, protocol.clean.sigmas, least_dn)
    leak, leak_sigma = ambient(darks)
    rows = _rows_worth_keeping(found)
    file = BlankFile(
        iso=protocol.camera.iso,
        f_number=protocol.camera.f_number,
        channels=series.channels,
        t_s=tuple(found.t_s[rows].tolist()),
        rate_dn_per_s=tuple(tuple(row) for row in found.rate[rows].tolist()),
        sigma_dn_per_s=tuple(tuple(row) for row in found.sigma[rows].tolist()),
        constant_dn_per_s=tuple(found.constant.tolist()),
        constant_sigma_dn_per_s=tuple(found.constant_sigma.tolist()),
        ambient_dn_per_s=tuple(leak.tolist()),
        ambient_sigma_dn_per_s=tuple(leak_sigma.tolist()),
        first_clean_s=found.first_clean_s,
        source="measured with labrig, blank",
        run=run.folder.resolve().name,
    )
    write_blank_file(stage.folder / "blank.yaml", file)
    return StageResult(
        known=replace(stage.known, blank=file),
        sections=(section(file, found, series.channels),),
        lines=tuple(_lines(file)),
        warnings=(*timing_warnings(run, "blank"), *_warnings(file, found)),
    )


def _rows_worth_keeping(found: StrayLight) -> "np.ndarray[tuple[int], np.dtype[np.intp]]":
    """Up to the first clean frame, its time not twice."""
    last = len(found.t_s)
    if found.first_clean_s is not None:
        last = int(np.searchsorted(found.start_s, found.first_clean_s)) + 1
    _, once = np.unique(found.t_s[:last], return_index=True)
    return once


def _lines(file: BlankFile) -> Iterator[str]:
    clean = file.first_clean_s
    yield "never clean" if clean is None else f"clean from {rounded(clean, 3)} s after lamp-off"
    for what, level, sigma in (
        ("stays", file.constant_dn_per_s, file.constant_sigma_dn_per_s),
        ("leaks in", file.ambient_dn_per_s, file.ambient_sigma_dn_per_s),
    ):
        named = zip(file.channels, level, sigma, strict=True)
        yield f"{what}: {', '.join(f'{n} {plus_minus(v, s)}' for n, v, s in named)} DN/s"


def _warnings(file: BlankFile, found: StrayLight) -> Iterator[str]:
    if found.fades:
        yield (
            "the blank still gets darker at its end: the lamp glows on for long (use a shield), or "
            "the card itself glows (take another); record it for longer"
        )
    yield from file.leaks()
