"""Asks the person at the terminal to do something by hand, and waits for the answer."""

import queue
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TextIO

from labrig.acquire import ManualStep
from labrig.errors import UsageError
from labrig.quantity import duration_text

#: What takes back the step before.
UNDO = "undo"
#: How often it is looked whether somebody wants to stop.
LOOK_UP_S = 0.05


class Terminal:
    """Reads lines beside the run, so that Ctrl-C and long waits are answered in the meantime."""

    def __init__(self) -> None:
        self._lines: queue.Queue[str] = queue.Queue()
        self._ended = threading.Event()
        self._reading = False

    def ask(
        self, step: ManualStep, last: str | None, left_s: float, meanwhile: Callable[[], None]
    ) -> str | None:
        """A remark, mostly empty; None to take back `last`.

        Raises
        ------
        UsageError
            Nobody can answer here.
        """
        self._read()
        while not self._lines.empty():
            self._lines.get()  # typed before the question
        offer = f", or: {UNDO} (do again: {last})" if last else ""
        _say(f"by hand: {step.what}")
        _say(f"  why: {step.why}; {duration_text(left_s)} of lab time left")
        _say(f"  Enter when it is done, or a remark{offer}; Ctrl-C stops, labrig resume goes on")
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
            _say("  there is nothing to take back; Enter when it is done")

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
        """What was typed; None if nothing can be any more."""
        while True:
            meanwhile()
            ended = self._ended.is_set()  # asked first: what came before the end counts
            try:
                return self._lines.get(timeout=LOOK_UP_S)
            except queue.Empty:
                if ended:
                    return None


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
