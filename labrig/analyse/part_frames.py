"""What of a part's frames its numbers are made of: which of them, and where in them."""

from labrig.analyse.intact import insist_on_intact
from labrig.analyse.part import Part
from labrig.errors import UsageError
from labrig.record import FrameRecord
from labrig.region import Region


def part_frames(part: Part, *purposes: str) -> list[FrameRecord]:
    """Frames of completed units with one of the purposes, those a person excludes left out.

    Raises
    ------
    DataError
        A frame is missing or was changed after the run.
    """
    insist_on_intact(part.run, purposes, part.choices)
    return [
        frame
        for attempt in part.run.completed().values()
        for frame in attempt.frames
        if frame.purpose in purposes and not part.choices.excludes(frame)
    ]


def part_region(part: Part, region: Region) -> Region:
    """The protocol's one `region`, or the one that a person wants instead.

    Raises
    ------
    UsageError
        A region of another name is asked for.
    """
    if named := [name for name in part.choices.regions if name]:
        raise UsageError(
            f"--roi: expected x,y,width,height, since this run has one region only, got the name "
            f"'{named[0]}'"
        )
    return part.choices.regions.get("", region)
