"""What of a stage's frames its numbers are made of: which of them, and where in them."""

from labrig.errors import UsageError
from labrig.process.intact import insist_on_intact
from labrig.process.stage import Stage
from labrig.record import FrameRecord
from labrig.region import Region


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


def stage_region(stage: Stage, region: Region) -> Region:
    """The protocol's one `region`, or the one that a person wants instead.

    Raises
    ------
    UsageError
        A region of another name is asked for.
    """
    if named := [name for name in stage.choices.regions if name]:
        raise UsageError(
            f"--roi: expected x,y,width,height, since this run has one region only, got the name "
            f"'{named[0]}'"
        )
    return stage.choices.regions.get("", region)
