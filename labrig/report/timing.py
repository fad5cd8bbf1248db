"""Lateness of frames, and of the moves of lamp, shield and door before them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.number_format import rounded
from labrig.record import ActionRecord, FrameRecord, FrameRole
from labrig.report.report_model import PatchReport

#: Devices and their actions between a charge and its first frame.
MOVES = (("lamp", "off"), ("shield", "cover"), ("door", "open"))
#: Lateness in s above which moves are counted; a PC that runs nothing else keeps within it.
LATE_MOVE_S = 0.02
#: Lateness in s below which an action counts as punctual.
ON_TIME_S = 1e-4


@dataclass(frozen=True)
class FrameTiming:
    """Start of a frame of a decay.

    Attributes
    ----------
    frame
        File name of the frame.
    unit
        Name of the unit.
    t_s
        Start of the exposure in seconds after lamp off.
    late_s
        Start of the exposure less its planned time in s.
    """

    frame: str
    unit: str
    t_s: float
    late_s: float


@dataclass(frozen=True)
class LatenessStatistics:
    """Statistics of the lateness of frames.

    Attributes
    ----------
    n_frames
        Number of frames.
    median_s, p95_s
        Median and 95th percentile of the lateness in s.
    worst_s
        Lateness of the largest magnitude in s.
    worst_frame
        File name of the frame with this lateness.
    """

    n_frames: int
    median_s: float
    p95_s: float
    worst_s: float
    worst_frame: str


def frame_timings(
    frames: Sequence[FrameRecord], patches: Sequence[PatchReport]
) -> tuple[FrameTiming, ...]:
    """Return the start of each frame of the decay that is in a series, in order of the frames."""
    t_s = {
        name: float(t)
        for patch in patches
        for name, t in zip(patch.series.frame, patch.series.t_s, strict=True)
    }
    return tuple(
        FrameTiming(frame.path.name, frame.unit, t_s[frame.path.name], frame.late_s)
        for frame in frames
        if frame.role == FrameRole.DECAY and frame.path.name in t_s
    )


def frame_lateness(timings: Sequence[FrameTiming]) -> LatenessStatistics | None:
    """Return the statistics of the lateness; None without frames."""
    if not timings:
        return None
    late_s = np.array([timing.late_s for timing in timings])
    worst = max(timings, key=lambda timing: abs(timing.late_s))
    return LatenessStatistics(
        n_frames=len(timings),
        median_s=float(np.median(late_s)),
        p95_s=float(np.percentile(late_s, 95)),
        worst_s=worst.late_s,
        worst_frame=worst.frame,
    )


def moves_text(actions: Sequence[ActionRecord]) -> str:
    """Return the lateness of lamp, shield and door before the frames of a decay, in sentences.

    The text is empty if there is neither shield nor door and the lamp was switched off on time.
    """
    moves = [
        [action for action in actions if (action.device, action.action) == move] for move in MOVES
    ]
    latest = [max(group, key=lambda action: action.late_s) for group in moves if group]
    if all(action.device == "lamp" and action.late_s < ON_TIME_S for action in latest):
        return ""
    statements = [
        f"{action.device} {action.action} at most {rounded(1e3 * action.late_s, 2)} ms"
        + (f" ({action.unit})" if action.late_s >= ON_TIME_S else "")
        for action in latest
    ]
    text = f"Begun after its planned time: {', '.join(statements)}."
    lateness_s = [action.late_s for group in moves for action in group]
    n_late = sum(late_s > LATE_MOVE_S for late_s in lateness_s)
    if not n_late:
        return text
    return (
        f"{text} {n_late} of {len(lateness_s)} began more than {1e3 * LATE_MOVE_S:g} ms late: the "
        "frames after may show a door that still moves, or the lamp's transient."
    )
