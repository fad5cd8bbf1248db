"""From the journal to frames that are as they were recorded, with their times after lamp off."""

from dataclasses import dataclass, replace

from labrig.analyse.choices import Choices
from labrig.analyse.intact import damaged_frames, insist
from labrig.errors import DataError
from labrig.record import Attempt, FrameRecord, FrameRole, RunRecord
from labrig.reduce import SeriesFrame
from labrig.results import add_flag

#: A frame later than this after its planned time is worth a warning; its measured time is used.
LATE_S = 0.05


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


def intact_frames(run: RunRecord, choices: Choices, purpose: str = FrameRole.DECAY) -> IntactFrames:
    """Every frame held against its checksum; those after lamp off timed from it.

    Parameters
    ----------
    purpose
        Of the frames of the glow.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed and is not excluded.
    """
    damaged = _damaged(run, choices, (purpose, FrameRole.DARK))
    decay = [
        _flagged(frame, attempt, choices)
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.purpose == purpose and frame not in damaged
    ]
    if not decay:
        raise DataError(
            f"{run.folder}: no {purpose} is complete, so there is nothing to fit; go on with: "
            f"labrig resume {run.folder}"
        )
    return IntactFrames(
        decay=decay,
        dark=[
            untimed(frame)
            for frame in run.frames(FrameRole.DARK)
            if frame not in damaged and not choices.excludes(frame)
        ],
        daylight=[frame for frame in run.frames(FrameRole.DAYLIGHT) if frame not in damaged],
        warnings=[
            f"{frame.path.name} {damage}; the report does without it"
            for frame, damage in damaged.items()
            if frame.purpose == FrameRole.DAYLIGHT
        ],
    )


def steady_frames(run: RunRecord, choices: Choices, purpose: str) -> list[SeriesFrame]:
    """Frames of that purpose under a steady light, each held against its checksum.

    Raises
    ------
    DataError
        A frame is missing or was changed and is not excluded.
    """
    damaged = _damaged(run, choices, (purpose,))
    return [
        untimed(frame)
        for frame in run.frames(purpose)
        if frame not in damaged and not choices.excludes(frame)
    ]


def timing_warnings(run: RunRecord, purpose: str = FrameRole.DECAY) -> list[str]:
    """What is odd about the times in the journal."""
    warnings = []
    if run.torn:
        warnings.append(
            "the journal's last line is torn: labrig was cut off while writing it; what it would "
            "have said does not count"
        )
    late = [frame for frame in run.frames(purpose) if frame.late_s > LATE_S]
    if late:
        worst = max(late, key=lambda frame: frame.late_s)
        warnings.append(
            f"{len(late)} frames began late, {worst.path.name} by {worst.late_s:.2f} s; their "
            "measured times are used (leave more time between frames)"
        )
    return warnings


def _damaged(run: RunRecord, choices: Choices, measured: tuple[str, ...]) -> dict[FrameRecord, str]:
    """What is wrong with frames, those that are `measured` only if they are excluded."""
    damaged = damaged_frames(run, (*measured, FrameRole.DAYLIGHT))
    insist(run, {f: damage for f, damage in damaged.items() if f.purpose in measured}, choices)
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


def _flagged(frame: FrameRecord, attempt: Attempt, choices: Choices) -> SeriesFrame:
    """Timed from lamp-off."""
    flag = "late" if frame.late_s > LATE_S else ""
    flag = add_flag(flag, "excluded") if choices.excludes(frame) else flag
    return replace(timed(frame, switched_time(attempt, frame, "off")), flag=flag)
