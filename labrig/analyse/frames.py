"""Frames of a run for its analysis: intact, of this camera, timed, without stray light."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from labrig.analyse.overrides import Overrides
from labrig.analyse.part import Part
from labrig.calibration import BlankFile, CameraFile
from labrig.errors import DataError, UsageError
from labrig.record import Attempt, FrameRecord, FrameRole, RunRecord
from labrig.reduce import PixelMask, SeriesFrame, hot_pixels, read_exif, read_raw
from labrig.region import Region
from labrig.results import add_flag


def camera_identity(run: RunRecord) -> str:
    """How the camera introduced itself in a run; empty if the journal does not say."""
    for attempt in run.attempts:
        if identity := dict(attempt.start.get("devices", {})).get("camera"):
            return str(identity)
    return ""


def lens_of(frames: Sequence[FrameRecord]) -> str | None:
    """What the first frame says of the lens: its name and focal length; None: nothing."""
    return read_exif(frames[0].path.read_bytes()).lens if frames else None


def require_calibrated_camera(
    camera: CameraFile | None, run: RunRecord, frames: Sequence[FrameRecord]
) -> None:
    """Refuse a calibration that is not of these frames; nothing is done where there is none.

    Raises
    ------
    DataError
        It is of another body, lens or aperture.
    """
    if camera is None or not frames:
        return
    lens = lens_of(frames)
    for f_number in {frame.f_number for frame in frames}:
        camera.require_match(camera_identity(run), lens, f_number)


#: Damaged frames named in a message.
MOST_NAMED = 4


def require_intact(run: RunRecord, roles: Sequence[str], overrides: Overrides) -> None:
    """Refuse frames of completed units that are missing or were changed, and are not excluded.

    Raises
    ------
    DataError
        Names them, and how to leave them out.
    """
    require(run, damaged_frames(run, roles), overrides)


def damaged_frames(run: RunRecord, roles: Sequence[str]) -> dict[FrameRecord, str]:
    """Frames of completed units that are not what their checksums say, and what is wrong."""
    frames = [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.role in roles
    ]
    return {frame: damage for frame in frames if (damage := frame.damage())}


def require(run: RunRecord, damaged: Mapping[FrameRecord, str], overrides: Overrides) -> None:
    """Refuse those of the damaged frames that a person has not excluded.

    Raises
    ------
    DataError
        As `require_intact`.
    """
    refused = {f: damage for f, damage in damaged.items() if not overrides.excludes(f)}
    if refused:
        raise DataError(f"{run.folder}: {_told(refused)}")


def _told(damaged: Mapping[FrameRecord, str]) -> str:
    """In one line, with what to do."""
    named = list(damaged.items())[:MOST_NAMED]
    more = f" and {len(damaged) - len(named)} more are damaged" if len(damaged) > len(named) else ""
    leave_out = " ".join(f"--exclude {frame.path.name}" for frame, _ in named)
    return (
        f"{', '.join(f'{frame.path.name} {damage}' for frame, damage in named)}{more}; restore "
        f"from a copy, or leave out: {leave_out}"
    )


def part_frames(part: Part, *roles: str) -> list[FrameRecord]:
    """Frames of completed units with one of the roles, those a person excludes left out.

    Raises
    ------
    DataError
        A frame is missing or was changed after the run.
    """
    require_intact(part.run, roles, part.overrides)
    return [
        frame
        for attempt in part.run.completed().values()
        for frame in attempt.frames
        if frame.role in roles and not part.overrides.excludes(frame)
    ]


def part_region(part: Part, region: Region) -> Region:
    """The protocol's one `region`, or the one that a person wants instead.

    Raises
    ------
    UsageError
        A region of another name is asked for.
    """
    if named := [name for name in part.overrides.regions if name]:
        raise UsageError(
            f"--roi: expected x,y,width,height, since this run has one region only, got the name "
            f"'{named[0]}'"
        )
    return part.overrides.regions.get("", region)


#: Of a frame that begins while something else than the glow still fades.
AFTERGLOW = "afterglow"


@dataclass(frozen=True)
class IntactFrames:
    """Frames of completed units, those left out that are missing or were changed.

    Attributes
    ----------
    decay, dark
        To be reduced; excluded decay frames are flagged, excluded dark ones left out.
    daylight
        To be shown.
    warnings
        About frames that cannot be shown.
    """

    decay: list[SeriesFrame]
    dark: list[SeriesFrame]
    daylight: list[FrameRecord]
    warnings: list[str]


def without_stray_light(
    frames: IntactFrames, blank: BlankFile | None
) -> tuple[IntactFrames, tuple[str, ...]]:
    """Frames that begin too early flagged, so that nothing is made of them; and what to say of it.

    How much of the lamp's afterglow a sample throws back is not what the blank does: it cannot be
    subtracted.

    Raises
    ------
    DataError
        The blank never became clean, or no frame begins late enough.
    """
    if blank is None:
        return frames, ()
    left_out = left_out_lines([frame.t_s for frame in frames.decay], blank)
    kept = [
        frame if blank.is_clean(frame.t_s) else replace(frame, flag=add_flag(frame.flag, AFTERGLOW))
        for frame in frames.decay
    ]
    return replace(frames, decay=kept), (*left_out, *blank.leaks())


def left_out_lines(t_s: Sequence[float], blank: BlankFile) -> tuple[str, ...]:
    """What to say of frames that begin so long after lamp-off, where the bench is still bright.

    Raises
    ------
    DataError
        The blank never became clean, or no frame begins late enough.
    """
    early = [t for t in t_s if not blank.is_clean(t)]
    if not early:
        return ()
    if len(early) == len(t_s):
        raise DataError(
            f"all frames begin before the bench is dark, the last {max(early):.3g} s after "
            f"lamp off; by the blank it is dark from {blank.first_clean_s:.3g} s on: begin later, "
            "or use a shield"
        )
    return (
        f"frames that begin before the bench is dark are left out, {len(early)} of {len(t_s)}: by "
        f"the blank it is dark from {blank.first_clean_s:.3g} s after lamp off on (begin later, or "
        "use a shield)",
    )


#: As many tell; reading more takes time.
ENOUGH = 5


def hot_pixels_of(darks: Sequence[SeriesFrame]) -> PixelMask | None:
    """Pixels that are bright in the dark; None where there are too few frames to tell."""
    longest_s = max((dark.exposure_s for dark in darks), default=0.0)
    longest = [dark for dark in darks if dark.exposure_s == longest_s]
    if len(longest) < 2:
        return None
    return hot_pixels([read_raw(dark.path) for dark in longest[:ENOUGH]])


#: A frame later than this after its planned time is worth a warning; its measured time is used.
LATE_S = 0.05


def intact_frames(
    run: RunRecord, overrides: Overrides, role: str = FrameRole.DECAY
) -> IntactFrames:
    """Every frame held against its checksum; those after lamp off timed from it.

    Parameters
    ----------
    role
        Of the frames of the glow.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed and is not excluded.
    """
    damaged = _damaged(run, overrides, (role, FrameRole.DARK))
    decay = [
        _flagged(frame, attempt, overrides)
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
            f"{frame.path.name} {damage}; the report does without it"
            for frame, damage in damaged.items()
            if frame.role == FrameRole.DAYLIGHT
        ],
    )


def steady_frames(run: RunRecord, overrides: Overrides, role: str) -> list[SeriesFrame]:
    """Frames of that role under a steady light, each held against its checksum.

    Raises
    ------
    DataError
        A frame is missing or was changed and is not excluded.
    """
    damaged = _damaged(run, overrides, (role,))
    return [
        untimed(frame)
        for frame in run.frames(role)
        if frame not in damaged and not overrides.excludes(frame)
    ]


def timing_warnings(run: RunRecord, role: str = FrameRole.DECAY) -> list[str]:
    """What is odd about the times in the journal."""
    warnings = []
    if run.torn:
        warnings.append(
            "the journal's last line is torn: labrig was cut off while writing it; what it would "
            "have said does not count"
        )
    late = [frame for frame in run.frames(role) if frame.late_s > LATE_S]
    if late:
        worst = max(late, key=lambda frame: frame.late_s)
        warnings.append(
            f"{len(late)} frames began late, {worst.path.name} by {worst.late_s:.2f} s; their "
            "measured times are used (leave more time between frames)"
        )
    return warnings


def _damaged(
    run: RunRecord, overrides: Overrides, measured: tuple[str, ...]
) -> dict[FrameRecord, str]:
    """What is wrong with frames, those that are `measured` only if they are excluded."""
    damaged = damaged_frames(run, (*measured, FrameRole.DAYLIGHT))
    require(run, {f: damage for f, damage in damaged.items() if f.role in measured}, overrides)
    return damaged


def untimed(frame: FrameRecord) -> SeriesFrame:
    """A frame whose time does not matter."""
    return SeriesFrame(frame.path, 0.0, frame.exposure_s, frame.iso, frame.f_number, frame.unit)


def timed(frame: FrameRecord, zero_time: float) -> SeriesFrame:
    """A frame that begins so long after `zero_time`, in seconds since 1970."""
    return replace(untimed(frame), t_s=frame.start_time - zero_time)


def switched_time(attempt: Attempt, frame: FrameRecord, state: str) -> float:
    """When the lamp went `on` or `off` for the last time before a frame.

    Raises
    ------
    DataError
        The journal does not say.
    """
    switches = [
        action.middle_time
        for action in attempt.actions
        if action.device == "lamp" and action.action == state
        if action.start_time <= frame.start_time
    ]
    if not switches:
        raise DataError(
            f"{frame.path}: the journal does not say when the lamp went {state} before it"
        )
    return switches[-1]


def _flagged(frame: FrameRecord, attempt: Attempt, overrides: Overrides) -> SeriesFrame:
    """Timed from lamp-off."""
    flag = "late" if frame.late_s > LATE_S else ""
    flag = add_flag(flag, "excluded") if overrides.excludes(frame) else flag
    return replace(timed(frame, switched_time(attempt, frame, "off")), flag=flag)
