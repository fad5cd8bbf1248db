"""Prevention of sleep of this PC, by each system's own means; not tested on macOS and Windows."""

import ctypes
import os
import select
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

#: Timeout for the answer of the desktop's service.
ANSWER_S = 5.0
#: `cat` holds the lock until its input ends, which is when labrig ends, however it does.
SYSTEMD_INHIBIT = (
    *("systemd-inhibit", "--what=sleep:idle:handle-lid-switch", "--mode=block"),
    *("--who=labrig", "--why=a measurement is running", "cat"),
)
#: Prevents idle sleep and, on mains, all sleep until the process with the given number has ended.
CAFFEINATE = ("caffeinate", "-i", "-s", "-w")
#: Flags of SetThreadExecutionState.
ES_SYSTEM_REQUIRED, ES_CONTINUOUS = 0x00000001, 0x80000000


@contextmanager
def kept_awake(warn: Callable[[str], None], platform: str = sys.platform) -> Iterator[None]:
    """Keep this PC awake in the context; warn and continue where that is impossible.

    Parameters
    ----------
    warn
        Callback that warns that the PC may fall asleep, and why.
    platform
        Platform, with the values of `sys.platform`.
    """
    with ExitStack() as stack:
        try:
            if platform not in _KEEPERS:
                raise OSError("labrig knows no way on this system")
            stack.enter_context(_KEEPERS[platform]())
        except OSError as error:
            warn(
                f"nothing keeps this PC from falling asleep ({error}): switch its energy saving "
                "off; a unit in which it sleeps is done again"
            )
        yield


@contextmanager
def _systemd_inhibit() -> Iterator[None]:
    """Hold a lock of the desktop's service, logind; it is refused to a user connected by ssh."""
    with subprocess.Popen(
        SYSTEMD_INHIBIT,
        bufsize=0,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,  # Ctrl-C at the terminal is for labrig alone
    ) as process:
        assert process.stdin
        assert process.stdout
        assert process.stderr
        try:
            with suppress(BrokenPipeError):
                process.stdin.write(b"\n")
            # `cat` sends it back once the lock is there.
            answers, _, _ = select.select([process.stdout], [], [], ANSWER_S)
            if not answers:
                raise OSError("systemd-inhibit does not answer")
            if not process.stdout.read(1):
                message = process.stderr.read().decode(errors="replace")
                raise OSError(f"systemd-inhibit: {' '.join(message.split())}")
            yield
        finally:
            process.terminate()


@contextmanager
def _caffeinate() -> Iterator[None]:
    """Hold the power assertion of macOS' own command."""
    with subprocess.Popen(
        [*CAFFEINATE, str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        try:
            yield
        finally:
            process.terminate()


@contextmanager
def _execution_state() -> Iterator[None]:
    """Set the thread state that keeps Windows from sleeping."""
    windll: Any = vars(ctypes)["windll"]
    if not windll.kernel32.SetThreadExecutionState(ES_CONTINUOUS | ES_SYSTEM_REQUIRED):
        raise OSError("SetThreadExecutionState was refused")
    try:
        yield
    finally:
        windll.kernel32.SetThreadExecutionState(ES_CONTINUOUS)


_KEEPERS = {"linux": _systemd_inhibit, "darwin": _caffeinate, "win32": _execution_state}
