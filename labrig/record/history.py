"""What the journal of a run says besides its frames: how long the lamp shone, what failed."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

from labrig.record.frames import FrameRole
from labrig.record.reading import Attempt, RunRecord


@dataclass(frozen=True)
class Interruption:
    """An attempt at a unit that did not count: when it began, and why it ended."""

    unit: str
    began: str
    reason: str


def charges_s(run: RunRecord) -> tuple[float, ...]:
    """How long the lamp shone in each complete decay before its first frame, looks left out."""
    return tuple(
        sum(_shining_s(attempt, decay[0].start_time))
        for attempt in run.completed().values()
        if (decay := [frame for frame in attempt.frames if frame.purpose == FrameRole.DECAY])
    )


def interruptions(run: RunRecord) -> tuple[Interruption, ...]:
    """Attempts that did not come to their end, by time."""
    return tuple(
        Interruption(
            attempt.unit,
            written_time(attempt.start["time"]),
            attempt.reason or "labrig was cut off",
        )
        for attempt in run.attempts
        if not attempt.completed
    )


def written_time(seconds: float) -> str:
    """Seconds since 1970 as a person reads them."""
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _shining_s(attempt: Attempt, until: float) -> Iterator[float]:
    """The lengths of the times with the lamp on; relays switch in the middle of a transaction."""
    since = None
    for action in attempt.actions:
        switched = action.middle_time
        if action.device != "lamp" or switched > until:
            continue
        if action.action == "on":
            since = switched if since is None else since
        elif since is not None:
            yield switched - since
            since = None
