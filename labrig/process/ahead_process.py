"""The process of `ahead`: processes a run again and again while it is recorded.

    python -P -m labrig.process.ahead_process RUN

The end of its standard input is its end.
"""

import _thread
import os
import sys
import threading
from contextlib import suppress
from pathlib import Path

#: Shortest pause between two passes, and the pause for each second that a pass took.
PAUSE_S, PAUSE_PER_PASS = 1.0, 2.0


def main() -> None:
    """Process the run that is named until the input ends."""
    _become_idle()
    ended = threading.Event()
    threading.Thread(target=_interrupt_at_end, args=(ended,), daemon=True).start()
    with suppress(KeyboardInterrupt):
        _follow(Path(sys.argv[1]), ended)


def _become_idle() -> None:
    """Take the processors only while nothing else wants them; on Windows it was started so.

    One processor is left alone: to take another one back takes some milliseconds.
    """
    if sys.platform == "win32":
        return
    os.nice(19)
    if hasattr(os, "sched_setaffinity"):
        first, *others = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, others or {first})
    if hasattr(os, "SCHED_IDLE"):
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _interrupt_at_end(ended: threading.Event) -> None:
    sys.stdin.buffer.read()
    ended.set()
    _thread.interrupt_main()


def _follow(run: Path, ended: threading.Event) -> None:
    """Process a run whenever its journal has grown."""
    # Not above: by now it gets no time that others want.
    from labrig.foundation.clock import SystemClock
    from labrig.foundation.input_file import file_size_bytes
    from labrig.process.run import process_so_far
    from labrig.record import JOURNAL

    clock, size_bytes, pause_s = SystemClock(), 0, PAUSE_S
    while not ended.wait(pause_s):
        before_bytes, size_bytes = size_bytes, file_size_bytes(run / JOURNAL)
        if size_bytes == before_bytes:
            continue
        began_s = clock.now()
        # As long as frames are missing it fails, and whatever it is, the processing at the end
        # reports it.
        with suppress(Exception):
            process_so_far(run)
        pause_s = max(PAUSE_S, PAUSE_PER_PASS * (clock.now() - began_s))


if __name__ == "__main__":
    main()
