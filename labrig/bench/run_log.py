"""Logs of a run: what every device was told and answered, what was decided, with times.

They are for people, and less durable than the journal, which is the record. Modules write them by
`logging.getLogger(__name__)`: actions, choices and waits as INFO, what goes over the wire as DEBUG.
"""

import logging
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from labrig.acquire import ManualStep, RunObserver
from labrig.foundation.clock import Clock
from labrig.record import FrameRecord

FILE = "log.txt"
_LABRIG = logging.getLogger("labrig")
# Without this, Python prints warnings of a program that has set up no logging to standard error.
_LABRIG.addHandler(logging.NullHandler())
_logger = logging.getLogger("labrig.run")


class LoggedObserver:
    """Observer that logs what it is told and passes it on.

    Parameters
    ----------
    observer
        Observer for the person at the terminal.
    """

    def __init__(self, observer: RunObserver) -> None:
        self._observer = observer

    def unit(self, name: str, number: int, total: int) -> None:
        """Log that a unit begins."""
        _logger.info("unit %d of %d: %s", number, total, name)
        self._observer.unit(name, number, total)

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Log that a wait begins; actions are logged when they are over."""
        if until_s is not None:
            _logger.info("%s", what)
        self._observer.doing(what, until_s)

    def frame(self, record: FrameRecord) -> None:
        """Log that a frame was recorded."""
        _logger.info(
            "frame %s: %s, %.4g s, ISO %d, %d bytes",
            record.path.name, record.role, record.exposure_s, record.iso, record.size_bytes,
        )  # fmt: skip
        self._observer.frame(record)

    def warn(self, text: str) -> None:
        """Log a warning."""
        _logger.warning("%s", text)
        self._observer.warn(text)

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Log that a step is to be done by hand, and the answer."""
        _logger.info("by hand: %s", step.what)
        answer = self._observer.ask(step, last, meanwhile)
        _logger.info("%s", "undo the step before" if answer is None else f"done {answer}".strip())
        return answer


@contextmanager
def logging_to(handler: logging.Handler, clock: Clock) -> Iterator[None]:
    """Write all that labrig logs to `handler`, with the times of a clock.

    Parameters
    ----------
    handler
        Handler of Python's logging; it is closed at the end.
    clock
        Clock of the rig: in a simulated room that of the room, as in the journal.

    Yields
    ------
    None
        Nothing; the handler writes until the block ends.

    Examples
    --------
    >>> import io
    >>> import logging
    >>> from labrig.bench import logging_to
    >>> from labrig.foundation.clock import VirtualClock
    >>> text = io.StringIO()
    >>> with logging_to(logging.StreamHandler(text), VirtualClock()):
    ...     logging.getLogger("labrig.example").info("lamp on")
    >>> text.getvalue().strip().endswith("lamp on")
    True
    """
    handler.setFormatter(_Formatter(clock))
    level, propagate = _LABRIG.level, _LABRIG.propagate
    _LABRIG.setLevel(logging.DEBUG)
    # A library that logs by `logging.debug` gives the root a handler that prints on the terminal.
    _LABRIG.propagate = False
    _LABRIG.addHandler(handler)
    try:
        yield
    finally:
        _LABRIG.removeHandler(handler)
        _LABRIG.setLevel(level)
        _LABRIG.propagate = propagate
        handler.close()


@contextmanager
def run_log(run: Path, rig: str, clock: Clock) -> Iterator[None]:
    """Append all that labrig logs to `log.txt` in a run folder, and how it ended.

    Parameters
    ----------
    run
        Run folder.
    rig
        Name of the rig.
    clock
        Clock of the rig.
    """
    with logging_to(
        _LogFile(run / FILE, encoding="utf-8", errors="backslashreplace", delay=True), clock
    ):
        _logger.info("labrig %s on %s; rig: %s", version("labrig"), platform.platform(), rig)
        try:
            yield
        except BaseException as error:
            _logger.error("%s: %s", type(error).__name__, error)
            raise
        _logger.info("all units are complete")


class _LogFile(logging.FileHandler):
    """Log file whose failure, on a full disk for instance, disturbs no run."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            super().emit(record)
        except OSError:  # it cannot be opened
            self.handleError(record)

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging's name
        """Lose the line: the run and its journal are worth more."""

    def close(self) -> None:
        try:
            super().close()
        except OSError:
            return


class _Formatter(logging.Formatter):
    """One line for each record: time in UTC, level, module, message."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock

    def format(self, record: logging.LogRecord) -> str:
        time = datetime.fromtimestamp(self._clock.wall(), UTC)
        when = f"{time:%Y-%m-%d %H:%M:%S}.{time.microsecond // 1000:03d}"
        place = record.name.removeprefix("labrig.")
        message = " ".join(record.getMessage().split())
        return f"{when} {record.levelname:<7} {place}: {message}"
