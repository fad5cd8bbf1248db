"""When frames began, against when they were to begin."""

from collections.abc import Sequence
from dataclasses import dataclass

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
