"""Reading of a run folder: attempts, their completion and their records."""

import os
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from labrig.foundation.errors import DataError
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.record.frames import (
    UNDONE,
    ActionRecord,
    FileRecord,
    FrameRecord,
    SpectrumRecord,
    TemperatureRecord,
    unit_within,
)
from labrig.record.journal import (
    JOURNAL,
    Document,
    JournalContent,
    check_descriptor,
    check_event,
    check_start,
    check_stop,
    read_journal,
)
from labrig.record.plain_folder import require_plain_folder

#: End of the year 9999 in seconds since 1970, the limit of `datetime`.
LATEST = 253_402_300_799.0
#: Largest plausible magnitude of a reading in degrees Celsius.
MAX_TEMPERATURE_C = 1000.0

#: Names of frames as `AttemptWriter` gives them.
_FRAME_NAME = re.compile(r"frames/\d{6,}[\w.-]*")

Recorded = TypeVar("Recorded", FrameRecord, SpectrumRecord, ActionRecord)
_FRAME, _ACTION = TypeAdapter(FrameRecord), TypeAdapter(ActionRecord)
_SPECTRUM, _TEMPERATURE = TypeAdapter(SpectrumRecord), TypeAdapter(TemperatureRecord)


@dataclass(frozen=True)
class Attempt:
    """One attempt at a unit, with its records in the order of the journal.

    Attributes
    ----------
    uid
        Uid of the RunStart.
    unit
        Name of the unit.
    start
        RunStart document.
    exit_status
        Status of the RunStop; None while the attempt runs, and if the process died during it.
    reason
        Reason of the RunStop.
    frames, actions, temperatures, spectra
        Records of the attempt.
    stop_time
        Time of the RunStop in seconds since 1970; None where there is none.
    """

    uid: str
    unit: str
    start: dict[str, Any]
    exit_status: str | None = None
    reason: str = ""
    frames: list[FrameRecord] = field(default_factory=list)
    actions: list[ActionRecord] = field(default_factory=list)
    temperatures: list[TemperatureRecord] = field(default_factory=list)
    spectra: list[SpectrumRecord] = field(default_factory=list)
    stop_time: float | None = None

    @property
    def files(self) -> list[FileRecord]:
        """Records of all that is in files of its own, frames before spectra."""
        return [*self.frames, *self.spectra]

    @property
    def completed(self) -> bool:
        """Whether the attempt ended with `success`."""
        return self.exit_status == "success"


@dataclass(frozen=True)
class RunRecord(NotebookViews):
    """Content of the journal of a run.

    Attributes
    ----------
    folder
        Run folder.
    attempts
        Attempts at units in order of their start.
    torn
        Whether the last line of the journal is incomplete because of a crash.
    last_time
        Time of the latest document in seconds since 1970.
    seal
        SHA-256 of the journal's last complete line, by which it is sealed; empty if there is none.
    """

    folder: Path
    attempts: list[Attempt]
    torn: bool
    last_time: float
    seal: str = ""

    @property
    def name(self) -> str:
        """Name of the run folder, with links resolved; bytes that are not UTF-8 are replaced."""
        return os.fsencode(self.folder.resolve().name).decode(errors="replace")

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return frames, actions and temperatures of completed units; times are since 1970."""
        attempts = self.completed().values()
        frames = [
            (
                *(frame.path.name, frame.role, frame.unit, frame.start_time, frame.exposure_s),
                *(frame.iso, "" if frame.f_number is None else frame.f_number, frame.late_s),
            )
            for attempt in attempts
            for frame in attempt.frames
        ]
        actions = [
            (act.unit, act.device, act.action, act.start_time, act.end_time, act.late_s)
            for attempt in attempts
            for act in attempt.actions
        ]
        of_frame = ("start_time_s", "exposure_s", "iso", "f_number", "late_s")
        of_action = ("start_time_s", "end_time_s", "late_s")
        tables = {
            "frames.csv": CsvTable(("frame", "role", "unit", *of_frame), frames),
            "actions.csv": CsvTable(("unit", "device", "action", *of_action), actions),
        }
        if readings := self.temperatures():
            rows = [(reading.time, reading.temperature_c) for reading in readings]
            tables["temperatures.csv"] = CsvTable(("time_s", "temperature_c"), rows)
        return tables

    @property
    def camera_identity(self) -> str:
        """What the camera said of itself: maker and model first; empty if there is none."""
        for attempt in self.attempts:
            if identity := dict(attempt.start.get("devices", {})).get("camera"):
                return str(identity)
        return ""

    def began_with(self, key: str) -> str:
        """Return a text of the first RunStart, such as `protocol`; empty if there is none."""
        return str(self.attempts[0].start.get(key, "")) if self.attempts else ""

    def so_far(self) -> "RunRecord":
        """Return the record as if the attempt that is under way were complete."""
        *ended, last = self.attempts
        if last.exit_status is None:
            last = replace(last, exit_status="success")
        return replace(self, attempts=[*ended, last])

    def completed(self) -> dict[str, Attempt]:
        """Return the completed attempt of each unit by the unit's name, in order of completion.

        A unit that a person undid later does not count as completed.
        """
        completed: dict[str, Attempt] = {}
        for attempt in self.attempts:
            for action in attempt.actions:
                if action.device == UNDONE:
                    completed.pop(action.action, None)
            if attempt.completed:
                completed[attempt.unit] = attempt
        return completed

    def part(self, name: str) -> "RunRecord":
        """Return the completed units of one part of a chain, by their names within the part."""
        attempts = [_attempt_within(name, attempt) for attempt in self.completed().values()]
        return replace(self, attempts=[attempt for attempt in attempts if attempt is not None])

    def without_part(self, name: str) -> "RunRecord":
        """Return the completed units of all other parts of a chain, by their whole names."""
        attempts = [
            attempt
            for attempt in self.completed().values()
            if unit_within(name, attempt.unit) is None
        ]
        return replace(self, attempts=attempts)

    def frames(self, role: str) -> list[FrameRecord]:
        """Return the frames with a given role in completed units."""
        return [
            frame
            for attempt in self.completed().values()
            for frame in attempt.frames
            if frame.role == role
        ]

    def spectra(self, role: str) -> list[SpectrumRecord]:
        """Return the readings of the spectrometer with a given role in completed units."""
        return [
            spectrum
            for attempt in self.completed().values()
            for spectrum in attempt.spectra
            if spectrum.role == role
        ]

    def temperatures(self) -> list[TemperatureRecord]:
        """Return all readings of the thermometer in order of time, including failed attempts."""
        readings = [reading for attempt in self.attempts for reading in attempt.temperatures]
        return sorted(readings, key=lambda reading: reading.time)


def _attempt_within(part: str, attempt: Attempt) -> Attempt | None:
    unit = unit_within(part, attempt.unit)
    if unit is None:
        return None
    return replace(
        attempt,
        unit=unit,
        frames=[replace(frame, unit=unit) for frame in attempt.frames],
        spectra=[replace(spectrum, unit=unit) for spectrum in attempt.spectra],
        actions=[replace(action, unit=unit) for action in attempt.actions],
        temperatures=[replace(reading, unit=unit) for reading in attempt.temperatures],
    )


def read_run(run: str | os.PathLike[str]) -> RunRecord:
    """Read the journal of a run.

    Parameters
    ----------
    run
        Run folder.

    Returns
    -------
    RunRecord
        Attempts at the units of the run, with the frames, actions and temperatures of each.

    Raises
    ------
    DataError
        If this is not a run folder, if something in it leads elsewhere, or if its journal is
        damaged or was edited inconsistently.
    DiskError
        If the journal cannot be read.

    Examples
    --------
    >>> import labrig
    >>> run = labrig.read_run("runs/decay")
    >>> list(run.completed())
    ['dark', 'meter', 'decay-1']
    >>> len(run.frames("decay"))
    18
    """
    folder = Path(run)
    require_plain_folder(folder)
    return run_record(folder, read_journal(folder / JOURNAL))


def run_record(folder: Path, content: JournalContent) -> RunRecord:
    """Build the record of the run in `folder` from the documents of its journal.

    Raises
    ------
    DataError
        If a document does not fit those before it.
    """
    attempts: dict[str, Attempt] = {}
    streams: dict[str, _Stream] = {}
    last_time = 0.0
    for number, (name, doc) in enumerate(content.documents, start=1):
        try:
            last_time = max(last_time, _seconds(doc.get("time", 0.0)))
            _add_document(folder, (name, doc), attempts, streams)
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                f"{folder / JOURNAL}, line {number}: a '{name}' document that does not fit "
                f"({_error_text(error)}); the file was changed after the run; restore it from a "
                "copy"
            ) from None
    return RunRecord(folder, list(attempts.values()), content.torn, last_time, content.seal)


@dataclass
class _Stream:
    """A stream of an attempt, the names of its values, and how many of its events were read."""

    attempt: Attempt
    name: str
    values: tuple[str, ...]
    events: int = 0


def _add_document(
    folder: Path,
    document: Document,
    attempts: dict[str, Attempt],
    streams: dict[str, _Stream],
) -> None:
    name, doc = document
    if name == "start":
        check_start(doc)
        if doc["uid"] in attempts:
            raise ValueError("it is there already")
        attempts[doc["uid"]] = _open_attempt(doc)
    elif name == "descriptor":
        check_descriptor(doc)
        attempt = _still_open(attempts, doc["run_start"])
        if any(each.attempt is attempt and each.name == doc["name"] for each in streams.values()):
            raise ValueError(f"the stream '{doc['name']}' is there already")
        streams[doc["uid"]] = _Stream(attempt, doc["name"], tuple(doc["data_keys"]))
    elif name == "stop":
        open_attempt = _still_open(attempts, doc["run_start"])
        attempts[doc["run_start"]] = _close_attempt(open_attempt, doc)
    elif name == "event":
        opened = streams[doc["descriptor"]]
        opened.events += 1
        check_event(doc, opened.events, opened.values)
        attempt = _still_open(attempts, opened.attempt.uid)
        stream, data = opened.name, dict(doc["data"])
        if stream == "frames":
            path = folder / _frame_name(data.pop("frame"))
            frame = _FRAME.validate_python({**data, "path": path, "unit": attempt.unit})
            attempt.frames.append(_check_times(frame))
        elif stream == "spectra":
            path = folder / _frame_name(data.pop("frame"))
            spectrum = _SPECTRUM.validate_python({**data, "path": path, "unit": attempt.unit})
            attempt.spectra.append(_check_times(spectrum))
        elif stream == "actions":
            action = _ACTION.validate_python({**data, "unit": attempt.unit})
            attempt.actions.append(_check_times(action))
        elif stream == "temperatures":
            reading = _TEMPERATURE.validate_python({**data, "unit": attempt.unit})
            attempt.temperatures.append(_check_reading(reading))


def _still_open(attempts: dict[str, Attempt], uid: str) -> Attempt:
    """Return an attempt that has not ended yet."""
    if attempts[uid].exit_status is not None:
        raise ValueError("its attempt has ended before")
    return attempts[uid]


def _frame_name(name: str) -> str:
    """Return `name` if it names a frame within the run folder."""
    if not _FRAME_NAME.fullmatch(name):
        raise ValueError(f"'{name}' is no name of a frame, such as frames/000001.cr2")
    return name


def _open_attempt(doc: dict[str, Any]) -> Attempt:
    _seconds(doc["time"])
    return Attempt(uid=doc["uid"], unit=doc["unit"], start=doc)


def _close_attempt(attempt: Attempt, doc: dict[str, Any]) -> Attempt:
    counts = {
        "frames": len(attempt.frames),
        "spectra": len(attempt.spectra),
        "actions": len(attempt.actions),
        "temperatures": len(attempt.temperatures),
    }
    check_stop(doc, counts)
    return replace(
        attempt,
        exit_status=doc["exit_status"],
        reason=doc.get("reason", ""),
        stop_time=float(doc["time"]),
    )


def _check_times(record: Recorded) -> Recorded:
    _seconds(record.start_time)
    _seconds(record.end_time)
    return record


def _check_reading(reading: TemperatureRecord) -> TemperatureRecord:
    _seconds(reading.time)
    if not abs(reading.temperature_c) <= MAX_TEMPERATURE_C:
        raise ValueError(f"{reading.temperature_c} °C is no temperature")
    return reading


def _seconds(time: float) -> float:
    """Return `time` if a calendar can express it."""
    if not 0 <= time <= LATEST:
        raise ValueError(f"{time} is no time in seconds since 1970")
    return float(time)


def _error_text(error: Exception) -> str:
    """Return an error in a few words."""
    if isinstance(error, ValidationError):
        problem = error.errors(include_url=False)[0]
        return f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}"
    return f"{error} is not there" if isinstance(error, KeyError) else str(error)
