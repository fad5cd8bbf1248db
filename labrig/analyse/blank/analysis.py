"""A blank, from its frames to its result."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from labrig.analyse.blank.stray_light import ambient, stray_light
from labrig.analyse.hot_pixels import hot_pixels_of
from labrig.analyse.part import Part
from labrig.analyse.part_frames import part_frames, part_region
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import intact_frames, timing_warnings
from labrig.calibration import BlankFile
from labrig.protocols.blank import BLANK_FRAMES
from labrig.reduce import measure, read_raw, reduce_patches
from labrig.results import BlankResult, StrayLight


def analyse(part: Part) -> BlankResult:
    """Find what light there is after lamp-off where nothing glows.

    Raises
    ------
    DataError
        No sequence is complete, or a frame is missing or was changed.
    """
    protocol, run, camera = part.protocol, part.run, part.inputs.camera
    region = part_region(part, protocol.region)
    frames = intact_frames(run, part.choices, BLANK_FRAMES)
    insist_on_this_camera(camera, run, part_frames(part, BLANK_FRAMES))
    series = reduce_patches(frames.decay, {"blank": region}, frames.dark, camera=camera)["blank"]
    # Hot pixels are of one colour: left in, they look like light.
    hot = hot_pixels_of(frames.dark)
    darks = [
        replace(measure(read_raw(frame.path), region, hot), exposure_s=frame.exposure_s)
        for frame in frames.dark
    ]
    least_dn = protocol.clean.share * darks[0].range_dn
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
    return BlankResult(
        calibration=file,
        stray_light=found,
        warnings=(*timing_warnings(run, "blank"), *_warnings(file, found)),
    )


def _rows_worth_keeping(found: StrayLight) -> "np.ndarray[tuple[int], np.dtype[np.intp]]":
    """Up to the first clean frame, its time not twice."""
    last = len(found.t_s)
    if found.first_clean_s is not None:
        last = int(np.searchsorted(found.start_s, found.first_clean_s)) + 1
    _, once = np.unique(found.t_s[:last], return_index=True)
    return once


def _warnings(file: BlankFile, found: StrayLight) -> Iterator[str]:
    if found.fades:
        yield (
            "the blank still gets darker at its end: the lamp glows on for long (use a shield), or "
            "the card itself glows (take another); record it for longer"
        )
    yield from file.leaks()
