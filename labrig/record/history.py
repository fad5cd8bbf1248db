"""What happened in a run, and what it was: charges, interruptions, bench and sample."""

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


@dataclass(frozen=True)
class DeviceLine:
    """A device of the rig: its role, the address it was reached at, and who answered there."""

    role: str
    address: str
    identity: str


@dataclass(frozen=True, kw_only=True)
class RunDescription:
    """A run, its bench and what its result was made with.

    Attributes
    ----------
    title
        The sample's name.
    protocol
        Name of the protocol.
    run
        Name of the run folder.
    started, ended
        As they are to be read.
    rig
        Name of the rig.
    simulated
        Whether the rig is a simulated one.
    labrig_version, libraries
        Of the processing; libraries by name and version.
    sample
        Pairs of what and value: thickness, batch, …
    devices
        Of the rig.
    guard
        What would have switched the lights off, had labrig died.
    protocol_text, rig_text
        The files, as resolved.
    interruptions
        Attempts that failed, by time.
    notes
        What a person had to say afterwards.
    """

    title: str
    protocol: str
    run: str
    started: str
    ended: str
    rig: str
    simulated: bool
    labrig_version: str
    libraries: tuple[tuple[str, str], ...] = ()
    sample: tuple[tuple[str, str], ...] = ()
    devices: tuple[DeviceLine, ...] = ()
    guard: str = ""
    protocol_text: str = ""
    rig_text: str = ""
    interruptions: tuple[Interruption, ...] = ()
    notes: str = ""
