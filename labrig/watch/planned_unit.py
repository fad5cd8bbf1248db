"""Progress of a unit: what was done, by the journal; what comes next, by the plan."""

from bisect import bisect_left
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

from labrig.acquire import ExposureSettings, Plan, Step
from labrig.record import PERSON, ActionRecord, Attempt, FrameRecord

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
