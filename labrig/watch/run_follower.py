"""Follower of a run folder while it is written: progress, plan, and the decay so far."""

import math
import shutil
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labrig.acquire import (
    ExposureSettings,
    Plan,
    ProtocolModel,
    Step,
    plan,
    read_protocol,
    read_rig_file,
)
from labrig.catalogue import RunStatus, status_of
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.foundation.region import Region
from labrig.record import PERSON, ActionRecord, Attempt, FrameRecord, FrameRole, RunRecord, read_run
from labrig.reduce import jpeg
from labrig.results import parameter_text, read_fitted_decays
from labrig.watch.preview import Preview, glance

#: Largest numbers of past and coming steps, as many as the page shows.
MAX_DONE = 2
MAX_NEXT = 6
#: Devices of steps that are waits, and of choices of the protocol.
WAITING, FINDING = "-", "protocol"
#: Key by which a step of the plan is found for a journal line.
_Key = tuple[str, str]


@dataclass(frozen=True)
class PlannedUnit:
    """One unit of a plan.

    Attributes
    ----------
    name
        Name of the unit.
    begins_s
        Begin of the unit in seconds after the start of the run.
    duration_s
        Longest duration of the unit in seconds.
    steps
        Steps of the unit, with times from the start of the run.
    """

    name: str
    begins_s: float
    duration_s: float
    steps: tuple[Step, ...]

    def status_of_unit(self, attempt: Attempt) -> dict[str, Any]:
        """Return the last and the next steps of an attempt that is under way.

        The progress is that of the journal: the time that a person takes is not known, and a plan
        has more steps than turn out to be needed.

        Returns
        -------
        dict
            `done`: last steps, each with its `time` in seconds since 1970. `next`: next steps, each
            with its planned time `at_s` in seconds after the begin of the unit. `time` and `at_s`:
            time and planned time of the last step; `until_s`: planned time at which the next line
            of the journal is due.
        """
        position, time, at_s = 0, float(attempt.start["time"]), 0.0
        places: defaultdict[_Key, list[int]] = defaultdict(list)
        for number, step in enumerate(self.steps):
            places[_key(step.device, step.action)].append(number)
        records: list[ActionRecord | FrameRecord] = [*attempt.actions, *attempt.frames]
        records.sort(key=lambda record: record.start_time)
        for record in records:
            candidates = places[_key_of(record)]
            index = bisect_left(candidates, position)
            if index < len(candidates):
                number = candidates[index]
                position, time, at_s = (
                    number + 1,
                    record.start_time,
                    self.steps[number].at_s - self.begins_s,
                )
        coming = [step for step in self.steps[position:] if step.device != FINDING]
        due = next((step.at_s for step in coming if step.device != WAITING), None)
        past = [record for record in records if _device(record) != FINDING]
        return {
            "began_time": attempt.start["time"],
            "time": time,
            "at_s": at_s,
            "until_s": self.duration_s if due is None else due - self.begins_s,
            "done": [
                {"time": record.start_time, "what": _text_of(record)} for record in past[-MAX_DONE:]
            ],
            "next": [
                {"at_s": step.at_s - self.begins_s, "what": step_text(step.device, step.action)}
                for step in coming[:MAX_NEXT]
            ],
        }


def planned_units(plan: Plan) -> tuple[PlannedUnit, ...]:
    """Return the units of a plan, each with its steps."""
    steps: defaultdict[str, list[Step]] = defaultdict(list)
    for step in plan.steps:
        steps[step.unit].append(step)
    begins = (0.0, *plan.unit_ends_s)
    return tuple(
        PlannedUnit(name, begin_s, end_s - begin_s, tuple(steps[name]))
        for name, begin_s, end_s in zip(plan.units, begins, plan.unit_ends_s, strict=False)
    )


def step_text(device: str, action: str) -> str:
    """Return a step as text."""
    if device == PERSON:
        return f"by hand: {action}"
    return action if device in (WAITING, "camera") else f"{device} {action}"


def _key(device: str, action: str) -> _Key:
    """Return the key by which a step of the plan is found for a journal line.

    The key of a frame has only its role, that of a choice its question, that of a person nothing:
    exposures, answers and remarks are known after the plan was made.
    """
    if device == "camera":
        return device, action.partition(" frame")[0]
    if device == FINDING:
        return device, action.partition(":")[0]
    return device, "" if device == PERSON else action


def _key_of(record: ActionRecord | FrameRecord) -> _Key:
    return (
        ("camera", record.role)
        if isinstance(record, FrameRecord)
        else _key(record.device, record.action)
    )


def _device(record: ActionRecord | FrameRecord) -> str:
    return "camera" if isinstance(record, FrameRecord) else record.device


def _text_of(record: ActionRecord | FrameRecord) -> str:
    if isinstance(record, ActionRecord):
        return step_text(record.device, record.action)
    settings = ExposureSettings(record.exposure_s, record.iso, record.f_number)
    return step_text("camera", f"{record.role} frame, {settings}")


PICTURE_WIDTH = 720
#: Number of earlier decay frames read per look, so that the page does not wait for thousands.
MAX_EARLIER = 4

#: Section → key → plain value. Everything that grows with a run has keys of its own, so that only
#: new values are sent.
State = dict[str, dict[str, Any]]


class RunFollower:
    """State of a run, from its folder alone; looking again costs little if nothing has changed.

    Parameters
    ----------
    run
        Run folder; it may hold nothing but protocol and rig.

    Raises
    ------
    UsageError
        If this is not a run folder.

    Attributes
    ----------
    picture
        Newest frame that could be read, as a JPEG.
    """

    def __init__(self, run: Path) -> None:
        if not (run / "protocol.yaml").is_file():
            raise UsageError(f"{run}: expected a run folder with protocol.yaml in it; see --runs")
        self.run = run
        self.picture: bytes | None = None
        self._protocol: ProtocolModel = read_protocol(run / "protocol.yaml")
        rig = read_rig_file(run / "rig.yaml")
        self._is_simulated = rig.simulation is not None
        laid_out = plan(self._protocol, rig, str(run / "rig.yaml"))
        self._planned_frames = laid_out.frames
        self._units: tuple[PlannedUnit, ...] = planned_units(laid_out)
        self._patches: dict[str, Mapping[str, Region]] = {
            unit: self._protocol.patches_of(unit) for unit in laid_out.units
        }
        self._last_look: tuple[object, ...] = ()
        self._record = RunRecord(run, [], False, 0.0)
        self._status: RunStatus = "interrupted"
        self._points: dict[str, list[dict[str, Any]]] = {}
        self._newest_frame: dict[str, Any] = {}
        self._unreadable: set[str] = set()

    def look(self) -> bool:
        """Read what is new in the folder and return whether there was anything.

        Some frames of a decay are read at every call, until all have been.

        Raises
        ------
        DataError
            If the journal is damaged.
        """
        sizes = _size(self.run / "journal.jsonl"), _size(self.run / "result" / "report.html")
        if sizes[0] and sizes != self._last_look[:2]:
            self._record = read_run(self.run)
        is_complete = len(self._record.completed()) == len(self._units)
        self._status = status_of(self._record, is_complete=is_complete)
        is_new = (*sizes, self._status) != self._last_look
        self._last_look = (*sizes, self._status)
        return self._read_frames() or is_new

    def state(self) -> State:
        """Return the whole state for a page: plain values, times in seconds since 1970."""
        counted = self._counted_attempts()
        completed = self._record.completed()
        all_frames = sum(len(attempt.frames) for attempt in self._record.attempts)
        frames = [frame for attempt in counted for frame in attempt.frames]
        current = self._current()
        return {
            "run": {
                "name": self.run.name,
                "sample": self._protocol.sample.name,
                "status": self._status,
                "simulated": self._is_simulated,
                "last_time": self._record.last_time,
                "frames": len(frames),
                "discarded_frames": all_frames - len(frames),
                "planned_frames": self._planned_frames,
                "disk_free_bytes": shutil.disk_usage(self.run).free,
                "now": None if current is None else self._unit_status(current),
            },
            "units": self._unit_states(completed, current),
            "points": {
                frame.path.name: self._points[frame.path.name]
                for frame in frames
                if self._points.get(frame.path.name)
            },
            "frame": self._newest_frame,
            "troubles": self._troubles(completed, current),
            "results": self._results(),
        }

    def _current(self) -> Attempt | None:
        """Return the attempt under way; one that a crash left open is not under way."""
        last = self._record.attempts[-1:] if self._status == "running" else []
        return next((attempt for attempt in last if attempt.exit_status is None), None)

    def _counted_attempts(self) -> list[Attempt]:
        """Return the completed attempts and the one under way."""
        current = self._current()
        return [*self._record.completed().values(), *([] if current is None else [current])]

    def _unit_status(self, attempt: Attempt) -> dict[str, Any] | None:
        for number, unit in enumerate(self._units):
            if unit.name == attempt.unit:
                return {"unit": number, **unit.status_of_unit(attempt)}
        return None

    def _unit_states(
        self, completed: Mapping[str, Attempt], current: Attempt | None
    ) -> dict[str, dict[str, Any]]:
        """Return the state of every unit by its number."""
        tries = Counter(attempt.unit for attempt in self._record.attempts)
        states = {}
        for number, unit in enumerate(self._units):
            if current is not None and unit.name == current.unit:
                state = "now"
            elif unit.name in completed:
                state = "done"
            else:
                state = "again" if tries[unit.name] else "to do"
            states[str(number)] = {
                "name": unit.name,
                "state": state,
                "planned_s": unit.duration_s,
                "tries": tries[unit.name],
            }
        return states

    def _troubles(
        self, completed: Mapping[str, Attempt], current: Attempt | None
    ) -> dict[str, dict[str, Any]]:
        """Return the failed attempts by number, with reason and whether the unit was done since."""
        return {
            str(number): {
                "unit": attempt.unit,
                "reason": attempt.reason or "labrig was cut off",
                "mended": attempt.unit in completed,
            }
            for number, attempt in enumerate(self._record.attempts)
            if not attempt.completed and attempt is not current
        }

    def _read_frames(self) -> bool:
        """Read the newest frame and some of a decay; return whether there were any to read."""
        newest = next(
            (
                (attempt, frame)
                for attempt in reversed(self._record.attempts)
                for frame in reversed(attempt.frames)
                if frame.path.name not in self._unreadable
            ),
            None,
        )
        is_new = newest is not None and newest[1].path.name != self._newest_frame.get("name")
        if newest is not None and is_new and (preview := self._read_frame(*newest)) is not None:
            self._newest_frame = _frame_state(newest[1], preview)
            self.picture = jpeg(preview.picture)
        earlier = [
            (attempt, frame)
            for attempt in self._counted_attempts()
            for frame in attempt.frames
            if frame.role == FrameRole.DECAY and frame.path.name not in self._points
        ]
        for attempt, frame in earlier[:MAX_EARLIER]:
            self._read_frame(attempt, frame)
        return is_new or bool(earlier)

    def _read_frame(self, attempt: Attempt, frame: FrameRecord) -> Preview | None:
        """Read a frame and keep its points; None if it cannot be read, which processing reports."""
        name = frame.path.name
        self._points[name] = []
        try:
            preview = glance(frame.path, self._patches.get(frame.unit, {}), PICTURE_WIDTH)
        except LabrigError:
            self._unreadable.add(name)
            return None
        off_times = [
            action.middle_time
            for action in attempt.actions
            if (action.device, action.action) == ("lamp", "off")
            and action.middle_time <= frame.start_time
        ]
        if frame.role == FrameRole.DECAY and off_times:
            self._points[name] = _points(frame, preview, off_times[-1])
        return preview

    def _results(self) -> dict[str, str]:
        """Return the fitted rates of each patch as text."""
        try:
            results = read_fitted_decays(self.run / "result")
        except DataError:
            return {}
        only = next(iter(self._protocol.patches_of("")), "")
        return {
            name or only: ", ".join(
                parameter_text(parameter, each.plus_minus)
                for parameter, each in fit.parameters.items()
            )
            for name, fit in results.items()
        }


def _points(frame: FrameRecord, preview: Preview, lamp_off_time: float) -> list[dict[str, Any]]:
    """Return the signals of a decay frame by patch: means above black in DN/s, unreduced."""
    return [
        {
            "unit": frame.unit,
            "patch": patch,
            "t_s": frame.start_time - lamp_off_time,
            "dn_per_s": {
                channel: mean / frame.exposure_s
                for channel, mean in values.items()
                if math.isfinite(mean)
            },
        }
        for patch, values in preview.values.items()
    ]


def _frame_state(frame: FrameRecord, preview: Preview) -> dict[str, Any]:
    return {
        "name": frame.path.name,
        "unit": frame.unit,
        "role": frame.role,
        "exposure_s": frame.exposure_s,
        "iso": frame.iso,
        "late_s": frame.late_s,
        "brightened": preview.brightened,
        "values": {
            patch: {
                channel: mean if math.isfinite(mean) else None for channel, mean in values.items()
            }
            for patch, values in preview.values.items()
        },
        "clipped": preview.clipped,
        "width": preview.picture.shape[1],
        "height": preview.picture.shape[0],
    }


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0
