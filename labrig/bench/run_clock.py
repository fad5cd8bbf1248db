"""The plan's clock in a run: laid out anew at every connection, moved by what is observed."""

from collections.abc import Callable

from labrig.acquire import ManualStep, Plan, PlanClock, RunObserver, step_text
from labrig.foundation.clock import Clock
from labrig.record import PERSON, FrameRecord, RunRecord


class ClockedObserver:
    """Observer that moves the plan's clock, and passes on what it observes.

    Parameters
    ----------
    observer
        Observer that shows the clock.
    plan_clock
        Clock of the plan.
    clock
        Clock of the rig.
    """

    def __init__(self, observer: RunObserver, plan_clock: PlanClock, clock: Clock) -> None:
        self._observer = observer
        self._plan_clock = plan_clock
        self._clock = clock
        self._lay_out: Callable[[], tuple[Plan, RunRecord]] | None = None
        self._is_paced = self._has_new_pace = False

    def connected(self, lay_out: Callable[[], tuple[Plan, RunRecord]]) -> None:
        """Follow the plan from this connection of the devices on.

        Parameters
        ----------
        lay_out
            Function that lays out what is missing now, and returns the record, too.
        """
        self._lay_out = lay_out
        self._follow()

    def unit(self, name: str, number: int, total: int) -> None:
        """Note that a unit begins.

        The plan is laid out anew after the first frames, which show how fast devices are, and for a
        unit that was complete at the connection, and was taken back.
        """
        if self._has_new_pace or name not in self._plan_clock.plan.units:
            self._follow()
            self._has_new_pace = False
        self._plan_clock.begin_unit(name, self._clock.now())
        self._observer.unit(name, number, total)

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Note the start of an action or of a wait."""
        if until_s is None:
            self._plan_clock.begin_step(what, self._clock.now())
        else:
            self._plan_clock.begin_wait(what, self._clock.now(), until_s)
        self._observer.doing(what, until_s)

    def frame(self, record: FrameRecord) -> None:
        """Note that a frame was recorded."""
        self._plan_clock.frames += 1
        if not self._is_paced:
            self._is_paced = self._has_new_pace = True
        self._observer.frame(record)

    def warn(self, text: str) -> None:
        """Show a warning."""
        self._observer.warn(text)

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Note that a step by hand begins, and have it done."""
        self._plan_clock.begin_step(step_text(PERSON, step.what), self._clock.now())
        return self._observer.ask(step, last, meanwhile)

    def _follow(self) -> None:
        assert self._lay_out is not None, "units begin on connected devices"
        plan, record = self._lay_out()
        frames = sum(len(attempt.frames) for attempt in record.completed().values())
        self._plan_clock.lay_out(plan, frames)
