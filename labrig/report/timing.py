"""When frames began, and what comes before them, against when they were to begin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.record import ActionRecord, FrameRecord, FrameRole
from labrig.report.report_model import PatchReport
from labrig.written_numbers import rounded

#: Devices and what they do between a charge and its first frame.
MOVES = (("lamp", "off"), ("shield", "cover"), ("door", "open"))
#: Moves that began later than this are counted; a PC alone keeps within it.
LATE_MOVE_S = 0.02
#: Nobody asks how much less late than this something was.
ON_TIME_S = 1e-4


@dataclass(frozen=True)
class FrameTiming:
    """One frame of a decay: when after lamp off it began, and how long after its planned time."""

    frame: str
    unit: str
    t_s: float
    late_s: float


@dataclass(frozen=True)
class Lateness:
    """How late frames began: half of them by less than the median, 95 % by less than `p95_s`."""

    n_frames: int
    median_s: float
    p95_s: float
    worst_s: float
    worst_frame: str


def frame_timings(
    frames: Sequence[FrameRecord], patches: Sequence[PatchReport]
) -> tuple[FrameTiming, ...]:
    """Of the frames that were measured, in their order."""
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


def lateness(timings: Sequence[FrameTiming]) -> Lateness | None:
    """None without frames."""
    if not timings:
        return None
    late_s = np.array([timing.late_s for timing in timings])
    worst = max(timings, key=lambda timing: abs(timing.late_s))
    return Lateness(
        n_frames=len(timings),
        median_s=float(np.median(late_s)),
        p95_s=float(np.percentile(late_s, 95)),
        worst_s=worst.late_s,
        worst_frame=worst.frame,
    )


def moves_text(actions: Sequence[ActionRecord]) -> str:
    """How late lamp, shield and door were before the frames of a decay, in a sentence or two.

    Empty if there is neither shield nor door, and the lamp went off on time.
    """
    moves = {move: [one for one in actions if (one.device, one.action) == move] for move in MOVES}
    latest = [max(some, key=lambda one: one.late_s) for some in moves.values() if some]
    if all(one.device == "lamp" and one.late_s < ON_TIME_S for one in latest):
        return ""
    said = [
        f"{one.device} {one.action} at most {rounded(1e3 * one.late_s, 2)} ms"
        + (f" ({one.unit})" if one.late_s >= ON_TIME_S else "")
        for one in latest
    ]
    text = f"Begun after its planned time: {', '.join(said)}."
    late_s = [one.late_s for some in moves.values() for one in some]
    n_late = sum(one > LATE_MOVE_S for one in late_s)
    if not n_late:
        return text
    return (
        f"{text} {n_late} of {len(late_s)} began more than {1e3 * LATE_MOVE_S:g} ms late: the "
        "frames after may show a door that still moves, or the lamp's transient."
    )
