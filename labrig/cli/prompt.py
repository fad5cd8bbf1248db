"""Prompt for manual steps at the terminal."""

import queue
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TextIO

from labrig.acquire import ManualStep
from labrig.foundation.errors import UsageError
from labrig.foundation.quantity import duration_text

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
