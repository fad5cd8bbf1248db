"""When frames began, against when they were to begin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.record.frames import FrameRecord
from labrig.report.content import PatchReport

DECAY = "decay"


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
        if frame.purpose == DECAY and frame.path.name in t_s
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
