"""Ctrl-C, SIGTERM and Windows' Ctrl-Break, made to wait for a moment when stopping is safe."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from labrig.clock import Clock, Interrupted

#: What stops a run.
STOP_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name)
]


@contextmanager
def interrupting(clock: Clock) -> Iterator[None]:
    """Stop signals are answered at the clock's next wait, never inside a device transaction.

    Raises
    ------
    Interrupted
        At a wait, or at the end if a signal came too late for one.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread gets signals
        return

    def ask(signum: int, frame: FrameType | None) -> None:
        clock.interrupt(signum)

    before = {signum: signal.signal(signum, ask) for signum in STOP_SIGNALS}
    stopped = False
    try:
        yield
        clock.sleep(0.0)
    except Interrupted:
        stopped = True
        raise
    finally:
        for signum, handler in before.items():
            ending = stopped and handler is raise_interrupted
            signal.signal(signum, signal.SIG_IGN if ending else handler)


def raise_interrupted(signum: int, frame: FrameType | None) -> None:
    """Handler for when nothing is connected: stop at once. One stop is enough for a command."""
    for ignored in STOP_SIGNALS:
        signal.signal(ignored, signal.SIG_IGN)
    raise Interrupted(signum)
