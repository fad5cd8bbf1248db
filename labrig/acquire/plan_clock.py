"""The clock of a plan: by it, every display counts what is left of a run and when a person is due.

A plan has the longest durations, and a person takes as long as a person takes. The position in the
plan therefore follows what happens: it goes on with time as far as the next step, waits there until
that step begins, and skips what a choice of the protocol has left out.
"""

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from labrig.acquire.planner import Plan, Step
from labrig.acquire.roles import CAMERA
from labrig.record import PERSON

#: Devices of steps that are waits or warnings, and of choices of the protocol.
WAITING, CHOOSING = "-", "protocol"
#: Start of the text of a step by hand.
BY_HAND = "by hand: "
#: Steps that begin so soon are under way, in seconds.
BEGUN_S = 0.1


@dataclass(frozen=True)
class Due:
    """A step that is due.

    Attributes
    ----------
    what
        Step as text.
    in_s
        Time until it begins in seconds.
    """

    what: str
    in_s: float


class PlanClock:
    """Position of a run in the plan of what is left of it.

    Times are in seconds of any one clock. Steps are given as text, as an observer of a run gets
    them.

    Parameters
    ----------
    plan
        Plan of all units that are missing, from the connection of the devices on.

    Attributes
    ----------
    frames, most_frames
        Number of frames so far, those of completed units before the plan included, and the largest
        number there will be.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.acquire import PlanClock
    >>> run = Path("runs/decay")
    >>> protocol = labrig.read_protocol(run / "protocol.yaml")
    >>> clock = PlanClock(labrig.plan(protocol, labrig.read_rig_file(run / "rig.yaml"), "rig.yaml"))
    >>> clock.begin_unit("dark", 100.0)
    >>> clock.begin_wait("warming up the camera, 1 min", 100.0, 160.0)
    >>> clock.next_due(130.0).in_s
    30.0
    >>> clock.left_s(130.0) == clock.plan.duration_s - 30.0
    True
    """

    def __init__(self, plan: Plan) -> None:
        self.lay_out(plan)

    def lay_out(self, plan: Plan, recorded_frames: int = 0) -> None:
        """Follow another plan: devices were connected anew, or a completed unit is done again."""
        self.plan = plan
        self.frames, self.most_frames = recorded_frames, recorded_frames + plan.frames
        self._places: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
        for number, step in enumerate(plan.steps):
            self._places[step.unit, _key(step)].append(number)
        self._unit = ""
        self._following = 0
        self._at_s = self._until_s = 0.0
        self._since_s: float | None = None

    def begin_unit(self, unit: str, now_s: float) -> None:
        """Note that a unit of the plan begins."""
        self._unit = unit
        steps = self.plan.steps
        following = next((n for n, step in enumerate(steps) if step.unit == unit), len(steps))
        self._move(following, self.plan.begins_s(unit), now_s)

    def begin_step(self, what: str, now_s: float) -> None:
        """Note that a step begins; one that is not in the plan changes nothing."""
        number = self._find(_key_of_step(what))
        if number is None:
            return
        step = self.plan.steps[number]
        if self._is_random(step):
            self._following = number + 1
        else:
            self._move(number + 1, step.at_s, now_s)

    def begin_wait(self, what: str, now_s: float, until_s: float) -> None:
        """Note that a wait begins, which may be shorter than planned, and when it ends."""
        number = self._find(_key_of_wait(what))
        if number is not None:
            step = self.plan.steps[number]
            ends_s = step.at_s + (step.lasts_s or 0.0)
            self._move(number + 1, ends_s - (until_s - now_s), now_s)

    def at_s(self, now_s: float) -> float:
        """Return the position in seconds after the start of the plan."""
        elapsed_s = 0.0 if self._since_s is None else max(now_s - self._since_s, 0.0)
        return min(self._at_s + elapsed_s, self.waits_at_s)

    @property
    def waits_at_s(self) -> float:
        """Position beyond which the clock does not go before the next step begins."""
        return max(self._until_s, self._at_s)

    def left_s(self, now_s: float) -> float:
        """Return the lab time that is left, in seconds; at most, as choices may shorten it."""
        return max(self.plan.duration_s - self.at_s(now_s), 0.0)

    def coming(self) -> Iterator[Step]:
        """Yield the steps to come in this unit, without choices."""
        for step in self.plan.steps[self._following :]:
            if step.unit != self._unit:
                return
            if step.device != CHOOSING:
                yield step

    def next_due(self, now_s: float) -> Due | None:
        """Return the next step of this unit that has not begun; None after the last."""
        at_s = self.at_s(now_s)
        for step in self.coming():
            if _begins(step) and step.at_s > at_s + BEGUN_S:
                return Due(step_text(step.device, step.action), step.at_s - at_s)
        return None

    def next_by_hand(self, now_s: float) -> Due | None:
        """Return the next step by hand, of this unit or a later one; None if there is none."""
        for step in self.plan.steps[self._following :]:
            if step.device == PERSON:
                return Due(step.action, max(step.at_s - self.at_s(now_s), 0.0))
        return None

    def _find(self, key: str) -> int | None:
        """Return the place in the plan of this unit's next step with a key."""
        places = self._places[self._unit, key]
        index = bisect_left(places, self._following)
        return places[index] if index < len(places) else None

    def _move(self, following: int, at_s: float, now_s: float) -> None:
        """Take a position, from which time goes on until the next step that is no wait."""
        self._following, self._at_s, self._since_s = following, at_s, now_s
        steps = (
            step.at_s
            for step in self.coming()
            if step.device != WAITING and not self._is_random(step)
        )
        self._until_s = next(steps, self.plan.ends_s(self._unit))

    def _is_random(self, step: Step) -> bool:
        """Return whether a step begins at a time that the run draws, which is not the plan's."""
        return step.device == CAMERA.key and step.unit in self.plan.drawn


def step_text(device: str, action: str) -> str:
    """Return a step of a plan as text.

    Parameters
    ----------
    device
        Key of the device, `PERSON` for a step by hand, `-` for a wait.
    action
        Action as text.

    Returns
    -------
    str
        Text such as `lamp on`.

    Examples
    --------
    >>> from labrig.acquire import step_text
    >>> step_text("lamp", "on")
    'lamp on'
    """
    if device == PERSON:
        return f"{BY_HAND}{action}"
    return action if device in (WAITING, CAMERA.key) else f"{device} {action}"


def _begins(step: Step) -> bool:
    """Return whether something begins, which it does not with a warning."""
    return step.device != WAITING or step.lasts_s is not None


def _key(step: Step) -> str:
    if step.device == WAITING:
        return _key_of_wait(step.action) if _begins(step) else ""
    return _key_of_step(step_text(step.device, step.action))


def _key_of_step(what: str) -> str:
    """Return the key by which a step of the plan is found for what happens.

    The key of a frame has only its role, that of a person nothing: exposures and remarks are known
    after the plan was made.
    """
    if what.startswith(BY_HAND):
        return BY_HAND
    role, frame, _ = what.partition(" frame, ")
    return f"{role} frame" if frame else what


def _key_of_wait(what: str) -> str:
    """Return the reason for a wait, without its duration."""
    return f"wait: {what.rpartition(', ')[0]}"
