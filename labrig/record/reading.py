"""Reading a run folder back: which units completed, and what they hold."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labrig.errors import DataError
from labrig.record.frames import ActionRecord, FrameRecord
from labrig.record.journal import Document, read_journal


@dataclass(frozen=True)
class Attempt:
    """One attempt at a unit, in the order of the journal.

    `exit_status` is `None` while it runs, and for good when the process died.
    """

    uid: str
    unit: str
    start: dict[str, Any]
    exit_status: str | None = None
    reason: str = ""
    frames: list[FrameRecord] = field(default_factory=list)
    actions: list[ActionRecord] = field(default_factory=list)

    @property
    def completed(self) -> bool:
        """Whether it counts."""
        return self.exit_status == "success"


@dataclass(frozen=True)
class RunRecord:
    """What a run folder's journal says."""

    folder: Path
    attempts: list[Attempt]
    torn: bool
    last_time: float

    def completed(self) -> dict[str, Attempt]:
        """The attempt that counts, of each completed unit, in order of completion."""
        return {attempt.unit: attempt for attempt in self.attempts if attempt.completed}

    def frames(self, purpose: str) -> list[FrameRecord]:
        """Frames with that purpose, of completed units only."""
        return [
            frame
            for attempt in self.completed().values()
            for frame in attempt.frames
            if frame.purpose == purpose
        ]


def read_run(folder: Path) -> RunRecord:
    """Read the journal of the run in `folder`.

    Raises
    ------
    DataError
        Not a run folder, or its journal is damaged.
    """
    content = read_journal(folder / "journal.jsonl")
    attempts: dict[str, Attempt] = {}
    streams: dict[str, tuple[str, str]] = {}
    last_time = 0.0
    for name, doc in content.documents:
        last_time = max(last_time, float(doc.get("time", 0.0)))
        try:
            _take(folder, (name, doc), attempts, streams)
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                f"{folder}: the journal holds a '{name}' document that does not fit ({error!r})"
            ) from None
    return RunRecord(folder, list(attempts.values()), content.torn, last_time)


def _take(
    folder: Path,
    document: Document,
    attempts: dict[str, Attempt],
    streams: dict[str, tuple[str, str]],
) -> None:
    name, doc = document
    if name == "start":
        attempts[doc["uid"]] = Attempt(uid=doc["uid"], unit=doc["unit"], start=doc)
    elif name == "descriptor":
        streams[doc["uid"]] = (doc["run_start"], doc["name"])
    elif name == "stop":
        opened = attempts[doc["run_start"]]
        attempts[doc["run_start"]] = Attempt(
            uid=opened.uid,
            unit=opened.unit,
            start=opened.start,
            exit_status=doc["exit_status"],
            reason=doc.get("reason", ""),
            frames=opened.frames,
            actions=opened.actions,
        )
    elif name == "event":
        run_uid, stream = streams[doc["descriptor"]]
        attempt, data = attempts[run_uid], dict(doc["data"])
        if stream == "frames":
            path = folder / data.pop("frame")
            attempt.frames.append(FrameRecord(path=path, unit=attempt.unit, **data))
        elif stream == "actions":
            attempt.actions.append(ActionRecord(unit=attempt.unit, **data))
