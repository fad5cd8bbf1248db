"""Frames of a run for its analysis: intact, of this camera, timed, without stray light or glare.

Of veiling glare: light of the patch itself does not matter: a lens scatters it with the course of
the patch's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from labrig.analyse.frame_times import LATE_S, switched_time, timed, untimed
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.overrides import Overrides
from labrig.calibration import TYPICAL_FLICKER, BlankFile, CameraFile
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.input_file import MAX_FRAME_BYTES, read_bytes
from labrig.foundation.region import Region, region_pixels
from labrig.foundation.result_warning import Disturbance, ResultWarning, Unmeasured
from labrig.record import Attempt, FileRecord, FrameRecord, FrameRole, RunRecord, damaged_frames
from labrig.reduce import SensorLayout, SeriesFrame, read_exif
from labrig.results import Series, add_flag


def lens_of(frames: Sequence[FrameRecord]) -> str | None:
    """Return name and focal length of the lens by the first frame's EXIF; None if absent."""
    return read_exif(read_bytes(frames[0].path, MAX_FRAME_BYTES)).lens if frames else None


def require_calibrated_camera(
    camera: CameraFile | None, run: RunRecord, frames: Sequence[FrameRecord]
) -> None:
    """Refuse a calibration that is not of these frames; do nothing without a calibration.

    Raises
    ------
    DataError
        The calibration is of another body, lens or aperture.
    """
    if camera is None or not frames:
        return
    lens = lens_of(frames)
    for f_number in {frame.f_number for frame in frames}:
        camera.require_match(run.camera_identity, lens, f_number)


FileRecordT = TypeVar("FileRecordT", bound=FileRecord)

#: Most damaged frames that a message names.
MAX_NAMED = 4


def require_intact(run: RunRecord, roles: Sequence[str], overrides: Overrides) -> None:
    """Refuse files of completed units that are missing or were changed, and are not excluded.

    These are frames and spectra.

    Raises
    ------
    DataError
        Frames are damaged; the message names them and how to leave them out.
    """
    files = [
        file for attempt in run.completed().values() for file in attempt.files if file.role in roles
    ]
    require(run, damaged_frames(run.folder, files), overrides)


def _frames_in_roles(run: RunRecord, roles: Sequence[str]) -> list[FrameRecord]:
    return [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.role in roles
    ]


def require(run: RunRecord, damaged: Mapping[FileRecordT, str], overrides: Overrides) -> None:
    """Refuse damaged frames that the user has not excluded.

    Raises
    ------
    DataError
        Frames are damaged; the message names them and how to leave them out.
    """
    refused = {f: damage for f, damage in damaged.items() if not overrides.excludes(f)}
    if refused:
        raise DataError(f"{run.folder}: {_damage_text(refused)}")


def verify_frames(run: RunRecord, overrides: Overrides) -> str:
    """Read every frame of completed units anew and compare it with its checksum in the journal.

    Parameters
    ----------
    run
        A recorded run.
    overrides
        The user's settings, with the frames to leave out.

    Returns
    -------
    str
        Line for people that says how many frames are undamaged.

    Raises
    ------
    DataError
        Frames are damaged; the message names them and how to leave them out.

    Examples
    --------
    >>> import labrig
    >>> from labrig.analyse import Overrides, verify_frames
    >>> verify_frames(labrig.read_run("runs/decay"), Overrides())
    'all 37 frames have the checksums of the journal'
    """
    frames = [file for attempt in run.completed().values() for file in attempt.files]
    damaged = damaged_frames(run.folder, frames, trust=False)
    require(run, damaged, overrides)
    if not damaged:
        return f"all {len(frames)} frames have the checksums of the journal"
    texts = ", ".join(f"{frame.path.name} {damage}" for frame, damage in damaged.items())
    return (
        f"{len(frames) - len(damaged)} of {len(frames)} frames have the checksums of the journal; "
        f"left out: {texts}"
    )


def _damage_text(damaged: Mapping[FileRecordT, str]) -> str:
    """Return a line that names damaged frames and the remedy."""
    listed = list(damaged.items())[:MAX_NAMED]
    remainder = (
        f" and {len(damaged) - len(listed)} more are damaged" if len(damaged) > len(listed) else ""
    )
    leave_out = " ".join(f"--exclude {frame.path.name}" for frame, _ in listed)
    return (
        f"{', '.join(f'{frame.path.name} {damage}' for frame, damage in listed)}{remainder}; "
        f"restore from a copy, or leave out: {leave_out}"
    )


def part_frames(context: AnalysisContext, *roles: str) -> list[FrameRecord]:
    """Return frames of completed units with one of the roles, without those the user excludes.

    Raises
    ------
    DataError
        A frame is missing or was changed after the run.
    """
    require_intact(context.run, roles, context.overrides)
    return [
        frame
        for frame in _frames_in_roles(context.run, roles)
        if not context.overrides.excludes(frame)
    ]


def part_region(context: AnalysisContext, region: Region) -> Region:
    """Return the protocol's only `region`, or the user's region instead.

    Raises
    ------
    UsageError
        The user names a region.
    """
    if named := [name for name in context.overrides.regions if name]:
        raise UsageError(
            f"--roi: expected x,y,width,height, since this run has one region only, got the name "
            f"'{named[0]}'"
        )
    return context.overrides.regions.get("", region)


#: Flag of a frame that begins before the bench is dark.
AFTERGLOW = "afterglow"


@dataclass(frozen=True)
class IntactFrames:
    """Frames of completed units, without those that are missing or were changed.

    Attributes
    ----------
    decay
        Frames of the glow; excluded ones are flagged.
    dark
        Dark frames without the excluded ones.
    daylight
        Daylight frames, which are only shown.
    warnings
        Warnings about frames that cannot be shown.
    """

    decay: list[SeriesFrame]
    dark: list[SeriesFrame]
    daylight: list[FrameRecord]
    warnings: list[ResultWarning]


def without_stray_light(
    frames: IntactFrames, blank: BlankFile | None
) -> tuple[IntactFrames, tuple[ResultWarning, ...]]:
    """Flag frames that begin before the blank is clean, and return the warnings about them.

    Stray light cannot be subtracted: the sample reflects another part of the lamp's afterglow than
    the blank does.

    Raises
    ------
    DataError
        The blank never became dark, or no frame begins late enough.
    """
    if blank is None:
        return frames, ()
    left_out = left_out_warnings([frame.t_s for frame in frames.decay], blank)
    kept = [
        frame if blank.is_clean(frame.t_s) else replace(frame, flag=add_flag(frame.flag, AFTERGLOW))
        for frame in frames.decay
    ]
    return replace(frames, decay=kept), (*left_out, *blank.leaks())


def left_out_warnings(t_s: Sequence[float], blank: BlankFile) -> tuple[ResultWarning, ...]:
    """Return warnings about frames that begin before the blank is clean.

    Parameters
    ----------
    t_s
        Begins of the frames in seconds after lamp off.
    blank
        Stray light of the bench.

    Raises
    ------
    DataError
        The blank never became dark, or no frame begins late enough.
    """
    early = [start_s for start_s in t_s if not blank.is_clean(start_s)]
    if not early:
        return ()
    if len(early) == len(t_s):
        raise DataError(
            f"all frames begin before the bench is dark, the last {max(early):.3g} s after "
            f"lamp off; by the blank it is dark from {blank.first_clean_s:.3g} s on: begin later, "
            "or use a shield"
        )
    return (
        Disturbance(
            "frames-before-dark",
            "frames that begin before the bench is dark are left out, {left_out} of {frames}: by "
            "the blank it is dark from {dark_from_s:.3g} s after lamp off on (begin later, or use "
            "a shield)",
            left_out=len(early),
            frames=len(t_s),
            dark_from_s=blank.first_clean_s,
        ),
    )


def intact_frames(
    run: RunRecord, overrides: Overrides, role: str = FrameRole.DECAY
) -> IntactFrames:
    """Check every frame against its checksum, and time those after lamp off from it.

    Parameters
    ----------
    run
        A recorded run.
    overrides
        The user's choices.
    role
        Role of the frames of the glow.

    Returns
    -------
    IntactFrames
        Frames of the glow, timed from lamp off, dark frames and daylight frames.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed and is not excluded.

    Examples
    --------
    >>> import labrig
    >>> from labrig.analyse import Overrides, intact_frames
    >>> frames = intact_frames(labrig.read_run("runs/decay"), Overrides())
    >>> len(frames.decay)
    18
    """
    damaged = _check_damage(run, overrides, (role, FrameRole.DARK))
    decay = [
        _flag_frame(frame, attempt, overrides)
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.role == role and frame not in damaged
    ]
    if not decay:
        raise DataError(
            f"{run.folder}: no {role} is complete, so there is nothing to fit; go on with: "
            f"labrig resume {run.folder}"
        )
    return IntactFrames(
        decay=decay,
        dark=[
            untimed(frame)
            for frame in run.frames(FrameRole.DARK)
            if frame not in damaged and not overrides.excludes(frame)
        ],
        daylight=[frame for frame in run.frames(FrameRole.DAYLIGHT) if frame not in damaged],
        warnings=[
            Disturbance(
                "photograph-damaged",
                "{file} {damage}; the report does without it",
                file=frame.path.name,
                damage=damage,
            )
            for frame, damage in damaged.items()
            if frame.role == FrameRole.DAYLIGHT
        ],
    )


def steady_frames(run: RunRecord, overrides: Overrides, role: str) -> list[SeriesFrame]:
    """Return frames of a role under steady light, each checked against its checksum.

    Raises
    ------
    DataError
        A frame is missing or was changed and is not excluded.
    """
    damaged = _check_damage(run, overrides, (role,))
    return [
        untimed(frame)
        for frame in run.frames(role)
        if frame not in damaged and not overrides.excludes(frame)
    ]


def _check_damage(
    run: RunRecord, overrides: Overrides, measured: tuple[str, ...]
) -> dict[FrameRecord, str]:
    """Return damaged frames and their damage; frames of `measured` roles must be excluded."""
    shown = _frames_in_roles(run, (*measured, FrameRole.DAYLIGHT))
    damaged = damaged_frames(run.folder, shown)
    require(run, {f: damage for f, damage in damaged.items() if f.role in measured}, overrides)
    return damaged


def _flag_frame(frame: FrameRecord, attempt: Attempt, overrides: Overrides) -> SeriesFrame:
    """Return a frame timed from lamp off, with its flags."""
    flag = "late" if frame.late_s > LATE_S else ""
    flag = add_flag(flag, "excluded") if overrides.excludes(frame) else flag
    return replace(timed(frame, switched_time(attempt, frame, "off")), flag=flag)


#: Glare of a clean photographic lens, as a fraction of the frame's mean light.
USUAL_GLARE = 0.01
#: Change of the course of a glow by the glare, in σ of all frames, and of its level, that matter.
COURSE_SIGMAS, LEVEL = 2.0, 0.01


def glare_warning(
    series: Mapping[str, Series],
    regions: Mapping[str, Region],
    frame: Series,
    layout: SensorLayout,
) -> tuple[ResultWarning, ...]:
    """Return a warning that names the patches for which a usual glare matters; empty for none.

    Parameters
    ----------
    series, regions
        Series of every patch, and its region.
    frame
        Series of the whole frame.
    layout
        Size of the sensor.
    """
    matters = {
        name: fraction
        for name, patch_series in series.items()
        if (fraction := _matters(patch_series, _area(regions[name], layout), frame)) > 0
    }
    if not matters:
        return ()
    largest = max(matters, key=lambda name: matters[name])
    return (
        Unmeasured(
            "glare-unmeasured",
            "the light of the rest of the frame may veil {patches}: a veiling glare of "
            "{glare_percent:.0f} %, as lenses have, would be up to {most_percent:.2g} % of "
            "{most_veiled}'s signal; measure it with camera_calibration (black:), or photograph "
            "dim patches without bright ones",
            patches=tuple(matters),
            glare_percent=100 * USUAL_GLARE,
            most_percent=100 * matters[largest],
            most_veiled=largest,
        ),
    )


def _area(region: Region, layout: SensorLayout) -> float:
    """Return the part of the frame that a region covers."""
    _, _, width, height = region_pixels(region, layout.width, layout.height)
    return width * height / (layout.width * layout.height)


def _matters(series: Series, area: float, frame: Series) -> float:
    """Return a usual glare over the signal of a patch in the channel of most, 0 if no matter."""
    rows = series.usable & frame.usable & np.isfinite(series.sigma).all(axis=1)
    if not rows.any():
        return 0.0
    signal, sigma = series.values[rows], series.sigma[rows]
    veil = USUAL_GLARE * (frame.values[rows] - area * signal)
    weight = 1 / (np.square(sigma) + np.square(TYPICAL_FLICKER * signal))
    power = (weight * np.square(signal)).sum(axis=0)
    # What is like the signal changes its level, the rest its course.
    levels = (weight * signal * veil).sum(axis=0) / power
    course_sigmas = np.sqrt((weight * np.square(veil - levels * signal)).sum())
    brightest = np.argmax((signal / sigma).sum(axis=0))
    if abs(levels[brightest]) < LEVEL and course_sigmas < COURSE_SIGMAS:
        return 0.0
    return float(np.abs(levels).max())
