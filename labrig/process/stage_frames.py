"""The frames of a stage that its numbers are made of."""

from labrig.process.intact import insist_on_intact
from labrig.process.stage import Stage
from labrig.record import FrameRecord


def stage_frames(stage: Stage, *purposes: str) -> list[FrameRecord]:
    """Frames of completed units with one of the purposes, those a person excludes left out.

    Raises
    ------
    DataError
        A frame is missing or was changed after the run.
    """
    insist_on_intact(stage.run, purposes, stage.choices)
    return [
        frame
        for attempt in stage.run.completed().values()
        for frame in attempt.frames
        if frame.purpose in purposes and not stage.choices.excludes(frame)
    ]
