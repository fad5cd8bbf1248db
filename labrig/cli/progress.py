"""What is happening, what comes next, how much lab time is left."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from labrig.acquire import ExposureSettings, Plan, RunObserver
from labrig.clock import Clock
from labrig.quantity import duration_text


@contextmanager
def progress(plan: Plan, done: Sequence[str], clock: Clock) -> Iterator[RunObserver]:
    """An observer that tells the person at the terminal, or a log, on standard error.

    Parameters
    ----------
    plan
        What is to come, for the time left.
    done
        Names of units that are complete already.
    clock
        The rig's clock.
    """
    state = _State(plan, done, clock)
    if not sys.stderr.isatty():
        yield PlainProgress(state)
        return
    console = Console(stderr=True)
    with Live(console=console, refresh_per_second=4, transient=True) as live:
        yield LiveProgress(state, live, console)


class _State:
    """Where the run is, held against the plan."""

    def __init__(self, plan: Plan, done: Sequence[str], clock: Clock) -> None:
        self.plan = plan
        self.clock = clock
        self.done = set(done)
        self.unit = ""
        self.number = 0
        self.doing = "connecting"
        self.until_s: float | None = None
        self.frames = 0
        self._unit_began_s = clock.now()

    def begin(self, unit: str, number: int) -> None:
        if self.unit:
            self.done.add(self.unit)
        self.unit, self.number = unit, number
        self._unit_began_s = self.clock.now()

    def left_s(self) -> float:
        """Lab time left, by the plan; a unit that takes longer than planned counts as over."""
        left_s = 0.0
        for name, begins_s, ends_s in self._spans():
            if name == self.unit:
                left_s += max(ends_s - begins_s - self._elapsed_s(), 0.0)
            elif name not in self.done:
                left_s += ends_s - begins_s
        return left_s

    def next_step(self) -> str:
        """What the plan has next in this unit, else the next unit."""
        begins_s = next((b for name, b, _ in self._spans() if name == self.unit), 0.0)
        now_s = begins_s + self._elapsed_s()
        for step in self.plan.steps:
            if step.unit == self.unit and step.at_s > now_s + 0.1:
                what = (
                    step.action
                    if step.device in ("-", "camera")
                    else f"{step.device} {step.action}"
                )
                return f"{what} in {_countdown(step.at_s - now_s)}"
        following = self.plan.units[self.number :]
        return f"unit {following[0]}" if following else "the report"

    def _elapsed_s(self) -> float:
        return self.clock.now() - self._unit_began_s

    def _spans(self) -> Iterator[tuple[str, float, float]]:
        begins_s = 0.0
        for name, ends_s in zip(self.plan.units, self.plan.unit_ends_s, strict=True):
            yield name, begins_s, ends_s
            begins_s = ends_s


class PlainProgress:
    """One line for everything that takes a while; for logs and pipes."""

    def __init__(self, state: _State) -> None:
        self._state = state

    def unit(self, name: str, number: int, total: int) -> None:
        """A unit begins."""
        self._state.begin(name, number)
        self._say(f"unit {number} of {total}: {name}")

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Say it, if it is worth a line."""
        if until_s is not None:
            self._say(f"{what}; next: {self._state.next_step()}")

    def frame(self, purpose: str, settings: ExposureSettings) -> None:
        """Say that a frame was kept."""
        self._state.frames += 1
        self._say(f"frame {self._state.frames} of {self._state.plan.frames}: {purpose}, {settings}")

    def warn(self, text: str) -> None:
        """Say a warning."""
        self._say(f"warning: {text}")

    def _say(self, text: str) -> None:
        left = _countdown(self._state.left_s())
        print(f"[{left} left] {text}", file=sys.stderr, flush=True)


class LiveProgress:
    """A small table that is drawn anew four times a second."""

    def __init__(self, state: _State, live: Live, console: Console) -> None:
        self._state = state
        self._console = console
        self._total = len(state.plan.units)
        live.update(self)

    def unit(self, name: str, number: int, total: int) -> None:
        """A unit begins."""
        self._state.begin(name, number)

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Something begins."""
        self._state.doing, self._state.until_s = what, until_s

    def frame(self, purpose: str, settings: ExposureSettings) -> None:
        """A frame was kept."""
        self._state.frames += 1

    def warn(self, text: str) -> None:
        """A warning stays on the screen above the table."""
        self._console.print(Text(f"warning: {text}", style="yellow"))

    def __rich__(self) -> Table:
        """The table as it is now."""
        state = self._state
        table = Table.grid(padding=(0, 2))
        table.add_row(Text("unit", style="dim"), f"{state.unit}  ({state.number} of {self._total})")
        countdown = ""
        if state.until_s is not None:
            countdown = f"  ({_countdown(state.until_s - state.clock.now())} to go)"
        table.add_row(Text("now", style="dim"), Text(state.doing + countdown, style="bold"))
        table.add_row(Text("next", style="dim"), state.next_step())
        table.add_row(Text("frames", style="dim"), f"{state.frames} of {state.plan.frames}")
        table.add_row(Text("lab time left", style="dim"), _countdown(state.left_s()))
        return table


def _countdown(seconds: float) -> str:
    return duration_text(max(round(seconds), 0)) if seconds >= 1 else "0 s"
