"""Follower of a run folder while it is written: progress, plan, and the decay so far."""

import math
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from labrig.acquire import (
    Continuation,
    ExposureSettings,
    Plan,
    PlanClock,
    ProtocolModel,
    plan,
    read_run_protocol,
    read_run_rig,
    step_text,
)
from labrig.catalogue import RunStatus, status_of
from labrig.foundation.errors import DataError, LabrigError
from labrig.foundation.input_file import file_size_bytes
from labrig.foundation.region import Region
from labrig.record import UNDONE, ActionRecord, Attempt, FrameRecord, FrameRole, RunRecord, read_run
from labrig.reduce import jpeg
from labrig.results import parameter_text, read_fitted_decays
from labrig.watch.preview import Preview, glance

#: Largest numbers of past and coming steps, as many as the page shows.
MAX_DONE = 2
MAX_NEXT = 6
#: Device of the protocol's choices.
CHOICE = "protocol"
#: Longest time between two units of one connection; to connect devices anew takes longer.
BETWEEN_UNITS_S = 1.0


@dataclass(frozen=True)
class Course:
    """Plan of what was left of a run as an attempt began.

    Attributes
    ----------
    plan
        Plan of the units that were missing then.
    uid
        Uid of the attempt.
    """

    plan: Plan
    uid: str

    def status_of(self, attempt: Attempt) -> dict[str, Any]:
        """Return the last and the next steps of an attempt that is under way.

        The progress is that of the journal: the time that a person takes is not known, and a plan
        has more steps than turn out to be needed.

        Returns
        -------
        dict
            `done`: last steps, each with its `time` in seconds since 1970. `next`: next steps, each
            with its planned time `at_s` in seconds after the start of the unit. `time` and `at_s`:
            time and planned time of the last step; `until_s`: planned time at which the next line
            of the journal is due. `ends_s`: planned end of the run. `by_hand`: next step by hand in
            this unit or a later one, with its planned time; None if there is none.
        """
        began_time = float(attempt.start["time"])
        clock, begins_s = PlanClock(self.plan), self.plan.begins_s(attempt.unit)
        clock.begin_unit(attempt.unit, began_time)
        records: list[ActionRecord | FrameRecord] = [*attempt.actions, *attempt.frames]
        records.sort(key=lambda record: record.start_time)
        for record in records:
            clock.begin_step(_text_of(record), record.start_time)
        time = records[-1].start_time if records else began_time
        at_s = clock.at_s(time)
        past = [record for record in records if _device(record) != CHOICE]
        by_hand = clock.next_by_hand(time)
        return {
            "began_time": began_time,
            "time": time,
            "at_s": at_s - begins_s,
            "until_s": clock.waits_at_s - begins_s,
            "ends_s": self.plan.duration_s - begins_s,
            "done": [
                {"time": record.start_time, "what": _text_of(record)} for record in past[-MAX_DONE:]
            ],
            "next": [
                {"at_s": step.at_s - begins_s, "what": step_text(step.device, step.action)}
                for step in islice(clock.coming(), MAX_NEXT)
            ],
            "by_hand": by_hand and {"at_s": at_s + by_hand.in_s - begins_s, "what": by_hand.what},
        }


def connected_at(attempts: Sequence[Attempt]) -> int:
    """Return the number of the attempt with which the present connection of the devices began.

    The journal has no line of a connection. Units of one connection follow each other at once,
    after one that is complete or was taken back.
    """
    for number in range(len(attempts) - 1, 0, -1):
        before, attempt = attempts[number - 1], attempts[number]
        if any(action.device == UNDONE for action in before.actions):
            continue
        begins_time = float(attempt.start["time"])
        is_late = begins_time - (before.stop_time or 0.0) > BETWEEN_UNITS_S
        if not before.completed or is_late:
            return number
    return 0


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
        self.run = run
        self.picture: bytes | None = None
        self._protocol: ProtocolModel = read_run_protocol(run)
        rig = read_run_rig(run)
        self._is_simulated = rig.simulation is not None
        self._rig = rig
        self._plan = plan(self._protocol, rig, str(run / "rig.yaml"))
        self._course: Course | None = None
        self._patches: dict[str, Mapping[str, Region]] = {
            unit: self._protocol.patches_of(unit) for unit in self._plan.units
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
        sizes = (
            file_size_bytes(self.run / "journal.jsonl"),
            file_size_bytes(self.run / "result" / "report.html"),
        )
        if sizes[0] and sizes != self._last_look[:2]:
            self._record = read_run(self.run)
        is_complete = len(self._record.completed()) == len(self._plan.units)
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
                "planned_frames": self._plan.frames,
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
        if attempt.unit not in self._plan.units:
            return None
        course = self._course_of(attempt)
        return {"unit": self._plan.units.index(attempt.unit), **course.status_of(attempt)}

    def _course_of(self, attempt: Attempt) -> Course:
        """Return the plan of what is left since the start of an attempt."""
        if self._course is None or self._course.uid != attempt.uid:
            attempts = self._record.attempts
            before = attempts[: attempts.index(attempt)]
            connected = attempts[connected_at(attempts)]
            begun = replace(attempt, frames=[], actions=[])
            goes_on = Continuation(
                replace(self._record, attempts=[*before, begun]),
                connected_time=float(connected.start["time"]),
                time=float(attempt.start["time"]),
            )
            source = str(self.run / "rig.yaml")
            rest = plan(self._protocol, self._rig, source, continuation=goes_on)
            self._course = Course(rest, attempt.uid)
        return self._course

    def _unit_states(
        self, completed: Mapping[str, Attempt], current: Attempt | None
    ) -> dict[str, dict[str, Any]]:
        """Return the state of every unit by its number, as planned now or else at the beginning."""
        tries = Counter(attempt.unit for attempt in self._record.attempts)
        rest = self._plan if self._course is None else self._course.plan
        states = {}
        for number, unit in enumerate(self._plan.units):
            if current is not None and unit == current.unit:
                state = "now"
            elif unit in completed:
                state = "done"
            else:
                state = "again" if tries[unit] else "to do"
            planned = rest if unit in rest.units else self._plan
            states[str(number)] = {
                "name": unit,
                "state": state,
                "planned_s": planned.ends_s(unit) - planned.begins_s(unit),
                "tries": tries[unit],
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
