"""From the journal to frames that are as they were recorded, with their times after lamp off."""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import file_digest

from labrig.errors import DataError
from labrig.process.choices import Choices
from labrig.record import Attempt, FrameRecord, RunRecord
from labrig.reduce import SeriesFrame, add_flag

#: A frame later than this after its planned time is worth a warning; its measured time is used.
LATE_S = 0.05
#: What the numbers are made of; a run can do without its other frames.
MEASURED = ("decay", "dark")
#: Damaged frames named in a message.
MOST_NAMED = 4


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


def intact_frames(run: RunRecord, choices: Choices) -> IntactFrames:
    """Every frame held against its checksum; decays timed from the lamp-off before them.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed and is not excluded.
    """
    frames = [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.purpose in (*MEASURED, "daylight")
    ]
    damaged = {frame: damage for frame in frames if (damage := _damage(frame))}
    refused = {
        frame: damage
        for frame, damage in damaged.items()
        if frame.purpose in MEASURED and not choices.excludes(frame)
    }
    if refused:
        raise DataError(f"{run.folder}: {_told(refused)}")
    decay = [
        _timed(frame, _lamp_off_time(attempt, frame), choices)
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.purpose == "decay" and frame not in damaged
    ]
    if not decay:
        raise DataError(
            f"{run.folder}: no decay is complete, so there is nothing to fit; go on with: "
            f"labrig resume {run.folder}"
        )
    return IntactFrames(
        decay=decay,
        dark=[
            SeriesFrame(frame.path, 0.0, frame.exposure_s, frame.iso, frame.f_number, frame.unit)
            for frame in run.frames("dark")
            if frame not in damaged and not choices.excludes(frame)
        ],
        daylight=[frame for frame in run.frames("daylight") if frame not in damaged],
        warnings=[
            f"{frame.path.name} {damage}; the report does without it"
            for frame, damage in damaged.items()
            if frame.purpose == "daylight"
        ],
    )


def timing_warnings(run: RunRecord) -> list[str]:
    """What is odd about the times in the journal."""
    warnings = []
    if run.torn:
        warnings.append(
            "the journal's last line is torn: labrig was cut off while writing it; what it would "
            "have said does not count"
        )
    late = [frame for frame in run.frames("decay") if frame.late_s > LATE_S]
    if late:
        worst = max(late, key=lambda frame: frame.late_s)
        warnings.append(
            f"{len(late)} frames began late, {worst.path.name} by {worst.late_s:.2f} s; their "
            "measured times are used (leave more time between frames)"
        )
    return warnings


def _damage(frame: FrameRecord) -> str:
    """What is wrong with the file, nothing if it is as recorded."""
    try:
        with frame.path.open("rb") as file:
            checksum = file_digest(file, "sha256").hexdigest()
    except OSError as error:
        return "is missing" if not frame.path.exists() else f"cannot be read ({error.strerror})"
    return "" if checksum == frame.sha256 else "was changed after the run (its checksum differs)"


def _told(damaged: Mapping[FrameRecord, str]) -> str:
    """In one line, with what to do."""
    named = list(damaged.items())[:MOST_NAMED]
    more = f" and {len(damaged) - len(named)} more are damaged" if len(damaged) > len(named) else ""
    leave_out = " ".join(f"--exclude {frame.path.name}" for frame, _ in named)
    return (
        f"{', '.join(f'{frame.path.name} {damage}' for frame, damage in named)}{more}; restore "
        f"from a copy, or leave out: {leave_out}"
    )


def _timed(frame: FrameRecord, lamp_off_time: float, choices: Choices) -> SeriesFrame:
    flag = "late" if frame.late_s > LATE_S else ""
    return SeriesFrame(
        frame.path,
        frame.start_time - lamp_off_time,
        frame.exposure_s,
        frame.iso,
        frame.f_number,
        frame.unit,
        add_flag(flag, "excluded") if choices.excludes(frame) else flag,
    )


def _lamp_off_time(attempt: Attempt, frame: FrameRecord) -> float:
    """Middle of the last lamp-off transaction before the frame: the relay opened in it."""
    offs = [
        (action.start_time + action.end_time) / 2
        for action in attempt.actions
        if action.device == "lamp" and action.action == "off"
        if action.start_time <= frame.start_time
    ]
    if not offs:
        raise DataError(f"{frame.path}: the journal does not say when the lamp went off before it")
    return offs[-1]
