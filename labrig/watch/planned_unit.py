"""Where a unit that is under way stands: what was done, by the journal; what comes, by the plan."""

from bisect import bisect_left
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

from labrig.acquire import ExposureSettings, Plan, Step
from labrig.record import PERSON, ActionRecord, Attempt, FrameRecord

#: Lines of each, so that what is told after a frame is as short as a page shows.
MOST_DONE = 2
MOST_NEXT = 6
#: Devices of steps that only say what is waited for, and of what is found and not done.
WAITING, FINDING = "-", "protocol"
#: Decides which step of the plan a line of the journal is.
_Key = tuple[str, str]


@dataclass(frozen=True)
class PlannedUnit:
    """One unit of the plan; its steps' `at_s` count from the start of the run.

    Attributes
    ----------
    begins_s
        When it begins, on the same count.
    duration_s
        How long it takes, at the latest.
    """

    name: str
    begins_s: float
    duration_s: float
    steps: tuple[Step, ...]

    def status_of_unit(self, attempt: Attempt) -> dict[str, Any]:
        """What an attempt that is under way has done last, and what is to come.

        The journal decides how far it is: nobody knows how long a person takes, and the plan has
        more in it than turns out to be needed.

        Returns
        -------
        dict
            `done`: what and its `time` in seconds since 1970. `next`: what and its time in the
            plan, `at_s` after the unit's beginning. At `time` the plan's time was `at_s`; it
            stands still at `until_s`, when the next line of the journal is due.
        """
        at, time, at_s = 0, float(attempt.start["time"]), 0.0
        places: defaultdict[_Key, list[int]] = defaultdict(list)
        for number, step in enumerate(self.steps):
            places[_key(step.device, step.action)].append(number)
        happened: list[ActionRecord | FrameRecord] = [*attempt.actions, *attempt.frames]
        happened.sort(key=lambda one: one.start_time)
        for one in happened:
            fitting = places[_key_of(one)]
            found = bisect_left(fitting, at)
            if found < len(fitting):
                number = fitting[found]
                at, time, at_s = number + 1, one.start_time, self.steps[number].at_s - self.begins_s
        coming = [step for step in self.steps[at:] if step.device != FINDING]
        due = next((step.at_s for step in coming if step.device != WAITING), None)
        told = [one for one in happened if _device(one) != FINDING]
        return {
            "began_time": attempt.start["time"],
            "time": time,
            "at_s": at_s,
            "until_s": self.duration_s if due is None else due - self.begins_s,
            "done": [{"time": one.start_time, "what": _text_of(one)} for one in told[-MOST_DONE:]],
            "next": [
                {"at_s": step.at_s - self.begins_s, "what": step_text(step.device, step.action)}
                for step in coming[:MOST_NEXT]
            ],
        }


def planned_units(plan: Plan) -> tuple[PlannedUnit, ...]:
    """The units of a plan, each with its steps."""
    steps: defaultdict[str, list[Step]] = defaultdict(list)
    for step in plan.steps:
        steps[step.unit].append(step)
    begins = (0.0, *plan.unit_ends_s)
    return tuple(
        PlannedUnit(name, begin_s, end_s - begin_s, tuple(steps[name]))
        for name, begin_s, end_s in zip(plan.units, begins, plan.unit_ends_s, strict=False)
    )


def step_text(device: str, action: str) -> str:
    """A step in words."""
    if device == PERSON:
        return f"by hand: {action}"
    return action if device in (WAITING, "camera") else f"{device} {action}"


def _key(device: str, action: str) -> _Key:
    """Of frames only the role, of findings only the question, of a person nothing else.

    Exposures are settled while a unit runs, findings are what they are, a person remarks on things.
    """
    if device == "camera":
        return device, action.partition(" frame")[0]
    if device == FINDING:
        return device, action.partition(":")[0]
    return device, "" if device == PERSON else action


def _key_of(one: ActionRecord | FrameRecord) -> _Key:
    return ("camera", one.role) if isinstance(one, FrameRecord) else _key(one.device, one.action)


def _device(one: ActionRecord | FrameRecord) -> str:
    return "camera" if isinstance(one, FrameRecord) else one.device


def _text_of(one: ActionRecord | FrameRecord) -> str:
    if isinstance(one, ActionRecord):
        return step_text(one.device, one.action)
    settings = ExposureSettings(one.exposure_s, one.iso, one.f_number)
    return step_text("camera", f"{one.role} frame, {settings}")
