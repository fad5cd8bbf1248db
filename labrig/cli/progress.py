"""Progress of a run at the terminal: present action, next step, lab time left, manual steps."""

import logging
import queue
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
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

from labrig.acquire import ExposureSettings, ManualStep, PlanClock, RunObserver, step_text
from labrig.bench import logging_to
from labrig.cli.detachable_stream import DetachableStream
from labrig.cli.under_way import hidden_work, work_text
from labrig.foundation.activity import under_way
from labrig.foundation.clock import Clock, SystemClock
from labrig.foundation.errors import UsageError
from labrig.foundation.quantity import duration_text
from labrig.record import PERSON, FrameRecord
from labrig.watch import Previews, RenderedPreview

#: Answer that undoes the previous step.
UNDO = "undo"
#: Period in which an interruption is looked for.
CHECK_INTERVAL_S = 0.05
#: Shortest time from one line to the next; nobody types faster.
ANSWER_PERIOD_S = 0.05
#: Time in which nobody does a step by hand, and how often in a row that shows that nobody does it.
AT_ONCE_S, MAX_AT_ONCE = 0.5, 10


class Terminal:
    """Reader of lines from the terminal in a thread, so that a run can be interrupted.

    Only lines that come while a question is open are answers, at most `1 / ANSWER_PERIOD_S` a
    second: a program that writes without end fills no memory and keeps no run from its work.
    """

    def __init__(self) -> None:
        self._clock = SystemClock()
        self._lines: queue.Queue[str] = queue.Queue()
        self._is_open = threading.Event()
        self._ended = threading.Event()
        self._reading = False
        self._at_once = 0

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
        offer = f", or: {UNDO} (do again: {last})" if last else ""
        _print_line(step_text(PERSON, step.what))
        _print_line(f"  why: {step.why}; {duration_text(left_s)} of lab time left")
        _print_line(
            f"  Enter when it is done, or a remark{offer}; Ctrl-C stops, labrig resume goes on"
        )
        asked_s = self._clock.now()
        self._is_open.set()
        try:
            return self._answer(step, last, meanwhile)
        finally:
            self._is_open.clear()
            while not self._lines.empty():
                self._lines.get()
            self._count(self._clock.now() - asked_s)

    def _answer(
        self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]
    ) -> str | None:
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

    def _count(self, took_s: float) -> None:
        """Say in one line that steps are confirmed as no person confirms them."""
        self._at_once = self._at_once + 1 if took_s < AT_ONCE_S else 0
        if self._at_once == MAX_AT_ONCE:
            _print_line(
                f"warning: {MAX_AT_ONCE} steps by hand in a row were confirmed within "
                f"{duration_text(AT_ONCE_S)} each: no person does that, so nothing of it was done; "
                "stop with Ctrl-C if the input is not from a keyboard"
            )

    def _read(self) -> None:
        if not self._reading:
            self._reading = True
            threading.Thread(target=self._keep_reading, args=(sys.stdin,), daemon=True).start()

    def _keep_reading(self, source: TextIO) -> None:
        with suppress(OSError, ValueError):  # it was closed, which is an end, too
            while line := source.readline():
                if self._is_open.is_set():  # else it was typed before the question
                    self._lines.put(line)
                self._clock.sleep(ANSWER_PERIOD_S)
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
    plan_clock: PlanClock,
    clock: Clock,
    *,
    yes: bool = False,
    has_changer: bool = False,
    verbose: bool = False,
) -> Iterator[RunObserver]:
    """Create an observer that reports to the terminal, or to a log, on standard error.

    Parameters
    ----------
    plan_clock
        Clock of the run's plan, for the time left and the next steps.
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
    by_hand = plan_clock.plan.manual_steps
    if yes and by_hand and not has_changer:
        raise UsageError(
            f"--yes: {len(by_hand)} steps are done by hand, such as '{by_hand[0]}', and the rig "
            "has no 'changer' to do them; run without --yes, or on a simulated rig that has one: "
            "--rig sim-phosphor"
        )
    state = _State(plan_clock, clock, yes=yes)
    if verbose:
        with logging_to(logging.StreamHandler(DetachableStream(sys.stderr)), clock):
            yield LogProgress(state)
        return
    if not sys.stderr.isatty():
        yield PlainProgress(state)
        return
    console = Console(file=cast(TextIO, DetachableStream(sys.stderr)))
    with hidden_work(), Live(console=console, refresh_per_second=4, transient=True) as live:
        observer = LiveProgress(state, live, console)
        try:
            yield observer
        finally:
            observer.close()


class _State:
    """State of the run at its place in the plan."""

    def __init__(self, plan_clock: PlanClock, clock: Clock, *, yes: bool) -> None:
        self.plan_clock = plan_clock
        self.clock = clock
        self.unit = ""
        self.number = self.total = 0
        self.doing = "connecting"
        self.until_s: float | None = None
        self._terminal = None if yes else Terminal()

    def begin(self, unit: str, number: int, total: int) -> None:
        self.unit, self.number, self.total = unit, number, total

    def frames(self) -> str:
        """Return the number of frames and the largest one."""
        return f"{self.plan_clock.frames} of {self.plan_clock.most_frames}"

    def left_s(self) -> float:
        """Return the planned lab time left in seconds."""
        return self.plan_clock.left_s(self.clock.now())

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Ask the person at the terminal; without one, only let the time of the step pass."""
        if self._terminal is None:
            self.clock.sleep(step.takes_s)
            return ""
        return self._terminal.ask(step, last, self.left_s(), meanwhile)

    def next_step(self) -> str:
        """Return the next step of this unit in the plan, else the next unit."""
        if due := self.plan_clock.next_due(self.clock.now()):
            return f"{due.what} in {_countdown(due.in_s)}"
        units = self.plan_clock.plan.units
        following = units[units.index(self.unit) + 1 :] if self.unit in units else units
        return f"unit {following[0]}" if following else "the report"

    def next_by_hand(self) -> str:
        """Return when the next step by hand is due, by the clock on the wall; empty if none is."""
        due = self.plan_clock.next_by_hand(self.clock.now())
        if due is None or self._terminal is None:
            return ""
        time_of_day = datetime.fromtimestamp(self.clock.wall() + due.in_s).astimezone()
        return f"next by hand at {time_of_day:%H:%M}: {due.what}"


class PlainProgress:
    """Progress as one line for each unit, wait and frame; for logs and pipes."""

    def __init__(self, state: _State) -> None:
        self._state = state

    def unit(self, name: str, number: int, total: int) -> None:
        """Print that a unit begins."""
        self._state.begin(name, number, total)
        self._print(f"unit {number} of {total}: {name}{self._by_hand()}")

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Print that a wait begins; actions without an end time are not printed."""
        if until_s is not None:
            self._print(f"{what}; next: {self._state.next_step()}{self._by_hand()}")

    def frame(self, record: FrameRecord) -> None:
        """Print that a frame was recorded."""
        settings = ExposureSettings(record.exposure_s, record.iso, record.f_number)
        self._print(f"frame {self._state.frames()}: {record.role}, {settings}")

    def warn(self, text: str) -> None:
        """Print a warning."""
        self._print(f"warning: {text}")

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Print a step to be done by hand, and ask the person to do it."""
        self._print(step_text(PERSON, step.what))
        return self._state.ask(step, last, meanwhile)

    def _by_hand(self) -> str:
        due = self._state.next_by_hand()
        return f"; {due}" if due else ""

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
        self._run: Path | None = None
        self._previews: Previews | None = None
        live.update(self)

    def unit(self, name: str, number: int, total: int) -> None:
        """Note that a unit begins."""
        self._state.begin(name, number, total)

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Note that an action or a wait begins."""
        self._state.doing, self._state.until_s = what, until_s

    def frame(self, record: FrameRecord) -> None:
        """Note that a frame was recorded, and request its preview from another process."""
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
        table.add_row(_dim("unit"), f"{state.unit}  ({state.number} of {state.total})")
        countdown = ""
        if state.until_s is not None:
            countdown = f"  ({_countdown(state.until_s - state.clock.now())} to go)"
        table.add_row(_dim("now"), Text(state.doing + countdown, style="bold"))
        if work := under_way():
            table.add_row(_dim("computing"), work_text(work, SystemClock().now()))
        table.add_row(_dim("next"), state.next_step())
        if due := state.next_by_hand():
            table.add_row(_dim("by hand"), due.removeprefix("next by hand "))
        table.add_row(_dim("frames"), f"{state.frames()}{self._disk()}")
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
