"""Times of frames: begins after lamp off by the journal, and frames that began late."""

from dataclasses import replace

from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.record import Attempt, FrameRecord, FrameRole, RunRecord
from labrig.reduce import SeriesFrame

#: Delay in seconds after the planned time from which a warning is given; the measured time counts.
LATE_S = 0.05


def timing_warnings(run: RunRecord, role: str = FrameRole.DECAY) -> list[ResultWarning]:
    """Return warnings about irregular times in the journal."""
    warnings: list[ResultWarning] = []
    if run.torn:
        warnings.append(
            Disturbance(
                "journal-torn",
                "the journal's last line is torn: labrig was cut off while writing it; this "
                "line does not count",
            )
        )
    late = [frame for frame in run.frames(role) if frame.late_s > LATE_S]
    if late:
        latest = max(late, key=lambda frame: frame.late_s)
        warnings.append(
            Disturbance(
                "frames-late",
                "{count} frames began late, {latest} by {late_s:.2f} s; their measured times are "
                "used (leave more time between frames)",
                count=len(late),
                latest=latest.path.name,
                late_s=latest.late_s,
            )
        )
    return warnings


def untimed(frame: FrameRecord) -> SeriesFrame:
    """Return a frame whose time is not used."""
    return SeriesFrame(
        frame.path, 0.0, frame.exposure_s, frame.iso, frame.f_number, frame.unit,
        sha256=frame.sha256,
    )  # fmt: skip


def timed(frame: FrameRecord, zero_time: float) -> SeriesFrame:
    """Return a frame timed from `zero_time`, in seconds since 1970."""
    return replace(untimed(frame), t_s=frame.start_time - zero_time)


def switched_time(attempt: Attempt, frame: FrameRecord, state: str) -> float:
    """Return the time of the lamp's last switch to `on` or `off` before a frame.

    Raises
    ------
    DataError
        The journal has no such switch.
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
