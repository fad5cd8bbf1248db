"""Line at the terminal that shows what long work is at, and how long it still takes."""

import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from shutil import get_terminal_size
from typing import Any, TextIO, cast

from labrig.cli.detachable_stream import DetachableStream
from labrig.foundation.activity import Activity, activity, under_way
from labrig.foundation.clock import SystemClock
from labrig.foundation.quantity import duration_text

#: Time after which work is shown, and the period in which it is shown anew.
PATIENCE_S, PERIOD_S = 0.5, 0.4
#: Least time after which the time left is worth stating.
FORESEEN_S = 2.0
#: What takes a terminal back to the start of an empty line.
EMPTY_LINE = "\r\x1b[2K"


#: Commands that only compute: they ask nothing, show nothing of their own, and end.
COMPUTING = frozenset(
    {
        *("figures", "fit", "frame", "leds", "material", "optics", "plan", "process", "reproduce"),
        *("protocol", "render", "runs", "schema", "seal", "verify"),
        *("driver new", "queue add", "queue list"),
    }
)
_hidden = threading.Event()


@contextmanager
def showing_work(arguments: Sequence[str]) -> Iterator[None]:
    """Show what is under way in a line of standard error that vanishes; only on a terminal.

    Parameters
    ----------
    arguments
        Arguments of the command line: a command that only computes is work as a whole.

    Yields
    ------
    None
        Nothing; the line is drawn until the block ends.
    """
    if not sys.stderr.isatty():
        yield
        return
    is_work = not COMPUTING.isdisjoint({*arguments[:1], " ".join(arguments[:2])})
    out, err = sys.stdout, sys.stderr
    line = _Line(err)
    sys.stdout = cast(TextIO, _Erasing(out, line))
    sys.stderr = cast(TextIO, _Erasing(err, line))
    try:
        with activity(f"labrig {arguments[0]}") if is_work else nullcontext():
            yield
    finally:
        sys.stdout, sys.stderr = out, err
        line.close()


@contextmanager
def hidden_work() -> Iterator[None]:
    """Show no line while a display of its own has the terminal."""
    _hidden.set()
    try:
        yield
    finally:
        _hidden.clear()


class _Erasing:
    """A stream before whose texts the line is erased."""

    def __init__(self, stream: TextIO, line: "_Line") -> None:
        self._stream = stream
        self._line = line

    def write(self, text: str) -> int:
        """Write `text` where the line was."""
        with self._line.lock:
            self._line.erase()
            return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class _Line:
    """The line, drawn by a thread while work is under way."""

    def __init__(self, stream: TextIO) -> None:
        self.lock = threading.RLock()
        self._clock = SystemClock()
        self._closed = threading.Event()
        self._stream = DetachableStream(stream)
        self._is_shown = False
        self._thread = threading.Thread(target=self._draw, daemon=True)
        self._thread.start()

    def erase(self) -> None:
        """Erase the line, if it is there."""
        if self._is_shown:
            self._stream.write(EMPTY_LINE)
            self._stream.flush()
        self._is_shown = False

    def close(self) -> None:
        """Erase the line, and draw it no more."""
        self._closed.set()
        self._thread.join()
        self.erase()

    def _draw(self) -> None:
        while not self._closed.wait(PERIOD_S):
            work, now_s = under_way(), self._clock.now()
            with self.lock:
                if _hidden.is_set() or not work or now_s - work[0].began_s < PATIENCE_S:
                    self.erase()
                else:
                    width = get_terminal_size().columns - 1
                    self._stream.write(EMPTY_LINE + work_text(work, now_s)[:width])
                    self._stream.flush()
                    self._is_shown = True


def work_text(work: Sequence[Activity], now_s: float) -> str:
    """Return work under way as a line.

    Parameters
    ----------
    work
        Activities, from the whole to its part.
    now_s
        Present time in seconds of the PC's clock.

    Returns
    -------
    str
        Line such as `processing: reducing frames, 312 of 1446, 25 s left; 40 s so far`.

    Examples
    --------
    >>> from labrig.foundation.activity import Activity
    >>> from labrig.cli.under_way import work_text
    >>> work = [Activity("processing", began_s=0.0), Activity("reducing", 8, 2, began_s=2.0)]
    >>> work_text(work, 12.0)
    'processing: reducing, 2 of 8, 30 s left; 12 s so far'
    """
    parts = [
        f"{each.what}, {min(each.done + 1, each.total)} of {each.total}"
        if each.total and each is not work[-1]
        else each.what
        for each in work
    ]
    last = work[-1]
    count = f", {last.done} of {last.total}" if last.total else ""
    left_s = last.left_s(now_s) if now_s - last.began_s >= FORESEEN_S else None
    left = "" if left_s is None else f", {duration_text(max(round(left_s), 1))} left"
    so_far = duration_text(round(now_s - work[0].began_s))
    return f"{': '.join(parts)}{count}{left}; {so_far} so far"
