"""Signals: which ones stop a run, when, and what becomes of those at the very start."""

import os
import signal
import subprocess
import sys

import pytest

from labrig.foundation.clock import Interrupted, VirtualClock
from labrig.foundation.signals import STOP_SIGNALS, interrupting, name_of, pausing

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows knows few signals")

#: What a lab's PC sends: terminals, users, schedulers, limits, timers.
ENDING = "HUP INT QUIT ABRT USR1 USR2 ALRM TERM XCPU VTALRM PROF IO PWR SYS TRAP STKFLT"


def test_every_signal_that_would_end_the_process_is_answered_at_a_wait() -> None:
    known = {getattr(signal, f"SIG{name}", signal.SIGTERM) for name in ENDING.split()}
    assert {each for each in known if signal.getsignal(each) != signal.SIG_IGN} <= set(STOP_SIGNALS)
    for signum in STOP_SIGNALS:
        clock = VirtualClock()
        before = signal.getsignal(signum)
        with pytest.raises(Interrupted) as caught, interrupting(clock):  # noqa: PT012
            os.kill(os.getpid(), signum)
            clock.sleep(1.0)
        assert (caught.value.signum, clock.now()) == (signum, 0.0), name_of(signum)
        assert signal.getsignal(signum) == before


def test_a_signal_that_comes_too_late_for_a_wait_is_answered_at_the_end() -> None:
    with pytest.raises(Interrupted), interrupting(VirtualClock()):
        os.kill(os.getpid(), signal.SIGUSR1)


def test_with_devices_open_ctrl_z_is_an_interruption_and_the_terminal_stops_nothing() -> None:
    clock = VirtualClock()
    with pausing(clock):
        for signum in (signal.SIGTTIN, signal.SIGTTOU, signal.SIGTSTP):
            os.kill(os.getpid(), signum)
        with pytest.raises(Interrupted) as caught:
            clock.sleep(0.0)
    assert caught.value.signum == signal.SIGTSTP
    assert signal.getsignal(signal.SIGTSTP) == signal.SIG_DFL


def python(text: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)


def test_what_was_ignored_before_labrig_began_stays_so_but_sigterm_ends_it() -> None:
    """As of a job in the background of a script; the first library imported sends the signals."""
    ended = python(
        "import os, signal, sys\n"
        "ignored = signal.SIGINT, signal.SIGHUP, signal.SIGTERM\n"
        "for signum in ignored:\n"
        "    signal.signal(signum, signal.SIG_IGN)\n"
        "class Sending:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'typer':\n"
        "            for signum in ignored:\n"
        "                print(signum.name, flush=True)\n"
        "                os.kill(os.getpid(), signum)\n"
        "from labrig.__main__ import main\n"
        "sys.meta_path.insert(0, Sending())\n"
        "main()"
    )
    assert ended.returncode == 128 + signal.SIGTERM
    assert ended.stdout.split() == ["SIGINT", "SIGHUP", "SIGTERM"]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_while_libraries_are_imported_a_signal_ends_it_with_one_line(name: str) -> None:
    """The very import of the first library sends it."""
    ended = python(
        "import os, signal, sys\n"
        "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"
        "class Sending:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'typer':\n"
        f"            os.kill(os.getpid(), signal.{name})\n"
        "from labrig.__main__ import main\n"
        "sys.meta_path.insert(0, Sending())\n"
        "main()"
    )
    assert ended.returncode == 128 + getattr(signal, name)
    assert ended.stderr == "labrig: interrupted\n"
    assert ended.stdout == ""


@pytest.mark.parametrize(
    ("moment", "then"),
    [
        # Python drops what is raised while it deletes an object …
        ("__del__(self)", "Moment()\n    with interrupting(SystemClock()):\n        pass"),
        # … and replaces what is raised while it makes a class.
        ("__set_name__(self, *_)", "type('Made', (), {'key': Moment()})"),
    ],
)
def test_a_signal_whose_exception_got_lost_is_answered(moment: str, then: str) -> None:
    ended = python(
        "import os, signal\n"
        "from labrig.cli import app, guarded\n"
        "from labrig.foundation.clock import SystemClock\n"
        "from labrig.foundation.signals import interrupting\n"
        "class Moment:\n"
        f"    def {moment}:\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "def called(**_):\n"
        f"    {then}\n"
        "app.command = lambda: called\n"
        "raise SystemExit(guarded([]))"
    )
    assert ended.returncode == 128 + signal.SIGINT
    assert ended.stderr.splitlines()[-1] == "labrig: interrupted"
