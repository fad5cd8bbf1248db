"""Whether frames are as they were recorded."""

from collections.abc import Mapping, Sequence

from labrig.analyse.choices import Choices
from labrig.errors import DataError
from labrig.record import FrameRecord, RunRecord

#: Damaged frames named in a message.
MOST_NAMED = 4


def insist_on_intact(run: RunRecord, purposes: Sequence[str], choices: Choices) -> None:
    """Refuse frames of completed units that are missing or were changed, and are not excluded.

    Raises
    ------
    DataError
        Names them, and how to leave them out.
    """
    insist(run, damaged_frames(run, purposes), choices)


def damaged_frames(run: RunRecord, purposes: Sequence[str]) -> dict[FrameRecord, str]:
    """Frames of completed units that are not what their checksums say, and what is wrong."""
    frames = [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.purpose in purposes
    ]
    return {frame: damage for frame in frames if (damage := frame.damage())}


def insist(run: RunRecord, damaged: Mapping[FrameRecord, str], choices: Choices) -> None:
    """Refuse those of the damaged frames that a person has not excluded.

    Raises
    ------
    DataError
        As `insist_on_intact`.
    """
    refused = {f: damage for f, damage in damaged.items() if not choices.excludes(f)}
    if refused:
        raise DataError(f"{run.folder}: {_told(refused)}")


def _told(damaged: Mapping[FrameRecord, str]) -> str:
    """In one line, with what to do."""
    named = list(damaged.items())[:MOST_NAMED]
    more = f" and {len(damaged) - len(named)} more are damaged" if len(damaged) > len(named) else ""
    leave_out = " ".join(f"--exclude {frame.path.name}" for frame, _ in named)
    return (
        f"{', '.join(f'{frame.path.name} {damage}' for frame, damage in named)}{more}; restore "
        f"from a copy, or leave out: {leave_out}"
    )
