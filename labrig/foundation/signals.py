"""Signals that would end or stop labrig, deferred until that is safe."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from labrig.foundation.clock import Clock, Interrupted

#: Signals that end no process, and faults of machine code, after which no Python code runs (the
#: guard switches the lights off). All others end a process.
_OTHERS = {
    *("SIGKILL", "SIGSTOP", "SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGCONT"),
    *("SIGCHLD", "SIGURG", "SIGWINCH", "SIGINFO", "SIGPIPE", "SIGXFSZ"),
    *("SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL"),
}
#: Signals that end labrig, with the exit code 128 + number: Ctrl-C, SIGTERM, a closed terminal, a
#: limit of the system. Signals that were ignored at the start (`nohup`, a job in the background of
#: a script) stay ignored, but for SIGTERM: something has to be left that ends labrig safely.
STOP_SIGNALS = [
    signum
    for signum in sorted(signal.valid_signals() - {getattr(signal, n, 0) for n in _OTHERS})
    if signum == signal.SIGTERM or signal.getsignal(signum) != signal.SIG_IGN
]
#: Signal of Ctrl-Z, None on Windows.
PAUSE_SIGNAL = getattr(signal, "SIGTSTP", None)


@contextmanager
def interrupting(clock: Clock) -> Iterator[None]:
    """Defer stop signals to the clock's next wait, never inside a device transaction.

    Raises
    ------
    Interrupted
        A signal arrived; it is raised at a wait, or at the end if there was none left.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread gets signals
        return

    def ask(signum: int, frame: FrameType | None) -> None:
        clock.interrupt(signum)

    old_handlers = {signum: signal.signal(signum, ask) for signum in STOP_SIGNALS}
    is_interrupted = False
    try:
        raise_again()  # a signal from before, which is not asked about any more
        with _closing_console(clock):
            yield
    except Interrupted:
        is_interrupted = True
        raise
    finally:
        for signum, handler in old_handlers.items():
            is_ending = is_interrupted and handler is raise_interrupted
            signal.signal(signum, signal.SIG_IGN if is_ending else handler)
    clock.sleep(0.0)


@contextmanager
def pausing(clock: Clock) -> Iterator[None]:
    """Keep this process from being stopped while devices are open.

    Ctrl-Z takes effect at the clock's next wait, as an interruption. In the background, reading
    from the terminal fails and writing to it succeeds, where either would stop the process.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ask(signum: int, frame: FrameType | None) -> None:
        clock.interrupt(signum)

    old_handlers = {}
    for name in ("SIGTSTP", "SIGTTIN", "SIGTTOU"):
        signum = getattr(signal, name, None)  # Windows has none of them
        if signum is not None and signal.getsignal(signum) != signal.SIG_IGN:
            old_handlers[signum] = signal.signal(
                signum, ask if name == "SIGTSTP" else signal.SIG_IGN
            )
    try:
        yield
    finally:
        for signum, handler in old_handlers.items():
            signal.signal(signum, handler)


def stop_here() -> None:
    """Stop the process as Ctrl-Z does; return when it is continued."""
    if sys.platform != "win32":
        os.kill(os.getpid(), signal.SIGSTOP)


def name_of(signum: int) -> str:
    """Return the name of a signal, or its number where it has none."""
    try:
        return signal.Signals(signum).name
    except ValueError:  # most real-time signals have none
        return f"signal {signum}"


#: Signal that `raise_interrupted` has handled; none at first.
_handled: list[int] = []


def raise_interrupted(signum: int, frame: FrameType | None) -> None:
    """Handle a signal while nothing is connected by raising `Interrupted`; ignore further ones."""
    for ignored in STOP_SIGNALS:
        signal.signal(ignored, signal.SIG_IGN)
    _handled[:] = [signum]
    raise Interrupted(signum)


def await_signals() -> None:
    """Let the next signal that stops labrig raise `Interrupted`, while nothing is connected."""
    _handled.clear()
    for signum in STOP_SIGNALS:
        signal.signal(signum, raise_interrupted)


def ignore_signals() -> None:
    """Let no further signal stop labrig: its answer is given, and the process is about to end."""
    _handled.clear()
    for signum in STOP_SIGNALS:
        signal.signal(signum, signal.SIG_IGN)


def raise_again() -> None:
    """Raise `Interrupted` once more if a signal was handled and its exception got lost.

    Python drops an exception that is raised while it deletes an object, and replaces one that is
    raised while it makes a class.

    Raises
    ------
    Interrupted
        A signal was handled before.
    """
    if _handled:
        raise Interrupted(_handled[0])


def end_at_once(signum: int, frame: FrameType | None) -> NoReturn:
    """Handle a signal during imports, before anything is open, by ending the process."""
    os.write(2, b"labrig: interrupted\n")
    os._exit(128 + signum)


@contextmanager
def _closing_console(clock: Clock) -> Iterator[None]:
    """Handle the closing of the console or a log-off on Windows; not tested yet.

    Windows ends the process when the handler returns, and after 5 s in any case: time for the safe
    state.
    """
    if sys.platform == "win32":
        import ctypes

        events = {2, 5, 6}  # CTRL_CLOSE_EVENT, CTRL_LOGOFF_EVENT, CTRL_SHUTDOWN_EVENT

        @ctypes.WINFUNCTYPE(ctypes.c_int, ctypes.c_uint)
        def closing(event: int) -> int:
            if event in events:
                clock.interrupt(signal.SIGBREAK)
                threading.Event().wait()  # in a thread of its own, until the process has ended
            return 0

        set_handler = ctypes.windll.kernel32.SetConsoleCtrlHandler
        set_handler(closing, True)
        try:
            yield
        finally:
            set_handler(closing, False)
    else:
        yield
