"""Progress of a run at the terminal: present action, next step, lab time left, manual steps."""

import logging
import queue
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO, cast

import numpy as np
from numpy.typing import NDArray
from rich.color import Color
from rich.console import Console, Group
from rich.live import Live
from rich.style import Style
from rich.table import Table
from rich.text import Text

from labrig.acquire import ExposureSettings, ManualStep, Plan, RunObserver
from labrig.bench import logging_to
from labrig.cli.exit_codes import DetachableStream
from labrig.foundation.clock import Clock
from labrig.foundation.errors import UsageError
from labrig.foundation.quantity import duration_text
from labrig.record import FrameRecord
from labrig.watch import Previews, RenderedPreview

#: Answer that undoes the previous step.
UNDO = "undo"
#: Period in which an interruption is looked for.
CHECK_INTERVAL_S = 0.05


class Terminal:
    """Reader of lines from the terminal in a thread, so that a run can be interrupted."""

    def __init__(self) -> None:
        self._lines: queue.Queue[str] = queue.Queue()
        self._ended = threading.Event()
        self._reading = False

    def ask(
        self, step: ManualStep, last: str | None, left_s: float, meanwhile: Callable[[], None]
    ) -> str | None:
        """Ask for a step to be done and return the remark, mostly empty; None to undo `last`.

        Raises
        ------
        UsageError
            If the input has ended without an answer.
        """
        self._read()
        while not self._lines.empty():
            self._lines.get()  # typed before the question
        offer = f", or: {UNDO} (do again: {last})" if last else ""
        _print_line(f"by hand: {step.what}")
        _print_line(f"  why: {step.why}; {duration_text(left_s)} of lab time left")
        _print_line(
            f"  Enter when it is done, or a remark{offer}; Ctrl-C stops, labrig resume goes on"
        )
        while True:
            line = self._next_line(meanwhile)
            if line is None:
                raise UsageError(
                    f"'{step.what}' has to be done by hand, and nobody can answer here (the input "
                    "has ended); run labrig in a terminal, or a simulated rig with --yes"
                )
            answer = line.strip()
            if answer.lower() != UNDO:
                return answer
            if last:
                return None
            _print_line("  there is nothing to take back; Enter when it is done")

    def _read(self) -> None:
        if not self._reading:
            self._reading = True
            threading.Thread(target=self._keep_reading, args=(sys.stdin,), daemon=True).start()

    def _keep_reading(self, source: TextIO) -> None:
        with suppress(OSError, ValueError):  # it was closed, which is an end, too
            while line := source.readline():
                self._lines.put(line)
        self._ended.set()

    def _next_line(self, meanwhile: Callable[[], None]) -> str | None:
        """Return the next line of input; None if the input has ended."""
        while True:
            meanwhile()
            ended = self._ended.is_set()  # read first, so that input before the end counts
            try:
                return self._lines.get(timeout=CHECK_INTERVAL_S)
            except queue.Empty:
                if ended:
                    return None


def _print_line(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


#: Width of the last frame's thumbnail in characters.
THUMBNAIL_WIDTH = 48


@contextmanager
def progress(
    plan: Plan,
    done: Sequence[str],
    clock: Clock,
    *,
    yes: bool = False,
    has_changer: bool = False,
    verbose: bool = False,
) -> Iterator[RunObserver]:
    """Create an observer that reports to the terminal, or to a log, on standard error.

    Parameters
    ----------
    plan
        Plan of the run, for the time left.
    done
        Names of units that are complete already.
    clock
        Clock of the rig.
    yes
        Whether the rig's changer does the manual steps; no person is asked then.
    has_changer
        Whether the rig has a changer.
    verbose
        Whether to print the run's log instead of its progress.

    Raises
    ------
    UsageError
        If `yes` is given for manual steps that only a person can do.
    """
    if yes and plan.manual_steps and not has_changer:
        raise UsageError(
            f"--yes: {len(plan.manual_steps)} steps are done by hand, such as "
            f"'{plan.manual_steps[0]}', and the rig has no 'changer' to do them; run without "
            "--yes, or on a simulated rig that has one: --rig sim-phosphor"
        )
    state = _State(plan, done, clock, yes=yes)
    if verbose:
        with logging_to(logging.StreamHandler(DetachableStream(sys.stderr)), clock):
            yield LogProgress(state)
        return
    if not sys.stderr.isatty():
        yield PlainProgress(state)
        return
    console = Console(file=cast(TextIO, DetachableStream(sys.stderr)))
    with Live(console=console, refresh_per_second=4, transient=True) as live:
        observer = LiveProgress(state, live, console)
        try:
            yield observer
        finally:
            observer.close()


class _State:
    """Progress of the run relative to its plan."""

    def __init__(self, plan: Plan, done: Sequence[str], clock: Clock, *, yes: bool) -> None:
        self.plan = plan
        self.clock = clock
        self.done = set(done)
        self.unit = ""
        self.number = 0
        self.doing = "connecting"
        self.until_s: float | None = None
        self.frames = 0
        self._terminal = None if yes else Terminal()
        self._unit_began_s = clock.now()

    def begin(self, unit: str, number: int) -> None:
        if self.unit and number > self.number:  # else it was taken back
            self.done.add(self.unit)
        self.done.discard(unit)
        self.unit, self.number = unit, number
        self._unit_began_s = self.clock.now()

    def left_s(self) -> float:
        """Return the planned lab time left in seconds; a unit that takes longer counts as over."""
        left_s = 0.0
        for name, begins_s, ends_s in self._spans():
            if name == self.unit:
                left_s += max(ends_s - begins_s - self._elapsed_s(), 0.0)
            elif name not in self.done:
                left_s += ends_s - begins_s
        return left_s

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Ask the person at the terminal; without one, only let the time of the step pass."""
        if self._terminal is None:
            self.clock.sleep(step.takes_s)
            return ""
        return self._terminal.ask(step, last, self.left_s(), meanwhile)

    def next_step(self) -> str:
        """Return the next step of this unit in the plan, else the next unit."""
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
    """Progress as one line for each unit, wait and frame; for logs and pipes."""

    def __init__(self, state: _State) -> None:
        self._state = state

    def unit(self, name: str, number: int, total: int) -> None:
        """Print that a unit begins."""
        self._state.begin(name, number)
        self._print(f"unit {number} of {total}: {name}")

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Print that a wait begins; actions without an end time are not printed."""
        if until_s is not None:
            self._print(f"{what}; next: {self._state.next_step()}")

    def frame(self, record: FrameRecord) -> None:
        """Print that a frame was recorded."""
        self._state.frames += 1
        settings = ExposureSettings(record.exposure_s, record.iso, record.f_number)
        number = f"frame {self._state.frames} of {self._state.plan.frames}"
        self._print(f"{number}: {record.role}, {settings}")

    def warn(self, text: str) -> None:
        """Print a warning."""
        self._print(f"warning: {text}")

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Print a step to be done by hand, and ask the person to do it."""
        self._print(f"by hand: {step.what}")
        return self._state.ask(step, last, meanwhile)

    def _print(self, text: str) -> None:
        time_left = _countdown(self._state.left_s())
        print(f"[{time_left} left] {text}", file=DetachableStream(sys.stderr), flush=True)


class LogProgress(PlainProgress):
    """Progress of a run whose log is printed, which tells the same and more."""

    def _print(self, text: str) -> None:
        pass


class LiveProgress:
    """Progress as a small table that is drawn four times a second."""

    def __init__(self, state: _State, live: Live, console: Console) -> None:
        self._state = state
        self._live = live
        self._console = console
        self._total = len(state.plan.units)
        self._run: Path | None = None
        self._previews: Previews | None = None
        live.update(self)

    def unit(self, name: str, number: int, total: int) -> None:
        """Note that a unit begins."""
        self._state.begin(name, number)

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Note that an action or a wait begins."""
        self._state.doing, self._state.until_s = what, until_s

    def frame(self, record: FrameRecord) -> None:
        """Note that a frame was recorded, and request its preview from another process."""
        self._state.frames += 1
        if self._previews is None:
            self._run = record.path.parents[1]
            self._previews = Previews(self._run, THUMBNAIL_WIDTH)
        self._previews.ask(record.path.name, record.unit)

    def close(self) -> None:
        """End the process of the previews."""
        if self._previews is not None:
            self._previews.close()

    def warn(self, text: str) -> None:
        """Print a warning, which stays on the screen above the table."""
        self._console.print(Text(f"warning: {text}", style="yellow"))

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Ask the person to do a step by hand; the table is hidden meanwhile."""
        self._live.stop()
        try:
            return self._state.ask(step, last, meanwhile)
        finally:
            self._live.start()

    def __rich__(self) -> Group:
        """Return the table and the thumbnail as they are now."""
        preview = None if self._previews is None else self._previews.latest
        if preview is None:
            return Group(self._table(None))
        return Group(self._table(preview), thumbnail(preview.picture))

    def _table(self, preview: RenderedPreview | None) -> Table:
        state = self._state
        table = Table.grid(padding=(0, 2))
        table.add_row(_dim("unit"), f"{state.unit}  ({state.number} of {self._total})")
        countdown = ""
        if state.until_s is not None:
            countdown = f"  ({_countdown(state.until_s - state.clock.now())} to go)"
        table.add_row(_dim("now"), Text(state.doing + countdown, style="bold"))
        table.add_row(_dim("next"), state.next_step())
        table.add_row(_dim("frames"), f"{state.frames} of {state.plan.frames}{self._disk()}")
        table.add_row(_dim("lab time left"), _countdown(state.left_s()))
        for patch, values in ({} if preview is None else preview.values).items():
            means = "  ".join(f"{channel} {mean:.1f}" for channel, mean in values.items())
            clipped = "  clipped" if preview is not None and patch in preview.clipped else ""
            table.add_row(_dim(patch), Text(f"{means} DN{clipped}", "red" if clipped else ""))
        return table

    def _disk(self) -> str:
        if self._run is None:
            return ""
        return f", {shutil.disk_usage(self._run).free / 1e9:.1f} GB free"


def thumbnail(picture: NDArray[np.uint8]) -> Text:
    """Return a picture in half blocks, with two pixels one above the other in each character."""
    rows = [
        Text("").join(
            Text("▀", Style(color=_colour(above), bgcolor=_colour(below)))
            for above, below in zip(top, bottom, strict=True)
        )
        for top, bottom in zip(picture[0:-1:2], picture[1::2], strict=False)
    ]
    return Text("\n").join(rows)


def _colour(rgb: NDArray[np.uint8]) -> Color:
    return Color.from_rgb(*(int(level) for level in rgb))


def _dim(text: str) -> Text:
    return Text(text, style="dim")


def _countdown(seconds: float) -> str:
    return duration_text(max(round(seconds), 0)) if seconds >= 1 else "0 s"
