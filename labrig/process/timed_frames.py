"""From the journal to frames with their measured times after lamp off."""

from collections.abc import Iterator
from hashlib import sha256

from labrig.errors import DataError
from labrig.process.choices import Choices
from labrig.record import Attempt, FrameRecord, RunRecord
from labrig.reduce import SeriesFrame, add_flag

#: A frame later than this after its planned time is worth a warning; its measured time is used.
LATE_S = 0.05


def decay_frames(run: RunRecord, choices: Choices) -> list[SeriesFrame]:
    """Frames of all completed decays, timed from the lamp-off before them.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or damaged and not excluded.
    """
    frames = [
        _timed(frame, _lamp_off_time(attempt, frame), choices)
        for attempt in run.completed().values()
        for frame in _intact(attempt, "decay", choices)
    ]
    if not frames:
        raise DataError(
            f"{run.folder}: no decay is complete, so there is nothing to fit; go on with: "
            f"labrig resume {run.folder}"
        )
    return frames


def dark_frames(run: RunRecord, choices: Choices) -> list[SeriesFrame]:
    """Dark frames that count."""
    return [
        SeriesFrame(frame.path, 0.0, frame.exposure_s, frame.iso, frame.f_number, frame.unit)
        for attempt in run.completed().values()
        for frame in _intact(attempt, "dark", choices)
        if not choices.excludes(frame)
    ]


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


def _intact(attempt: Attempt, purpose: str, choices: Choices) -> Iterator[FrameRecord]:
    for frame in attempt.frames:
        if frame.purpose != purpose:
            continue
        if _is_intact(frame):
            yield frame
        elif not choices.excludes(frame):
            raise DataError(
                f"{frame.path}: the frame is missing or was changed after the run (its checksum "
                f"differs); restore it from a copy, or leave it out: --exclude {frame.path.name}"
            )


def _is_intact(frame: FrameRecord) -> bool:
    return frame.path.is_file() and sha256(frame.path.read_bytes()).hexdigest() == frame.sha256


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
