"""The PC is kept awake by each system's own means, all of them stood in for."""

import ctypes
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from labrig.bench.awake import ES_CONTINUOUS, ES_SYSTEM_REQUIRED, kept_awake

pytestmark = pytest.mark.skipif(os.name == "nt", reason="stands in for commands by shell scripts")

#: As systemd-inhibit does: runs the command behind its options, for as long as that lives.
INHIBITS = """
echo "$@" >> "$0.log"
while [ "${1#--}" != "$1" ]; do shift; done
"$@"
echo ended >> "$0.log"
"""
REFUSES = "echo 'Failed to inhibit: Access denied' >&2; exit 1"
KILLED = """
import os
from labrig.bench.awake import kept_awake
with kept_awake(print, "linux"):
    os.kill(os.getpid(), 9)
"""
ENDS_BY_ITSELF = 'echo "$@" >> "$0.log"; exec sleep 60'

Stand = Callable[[str, str], Path]


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stand:
    """Puts a shell script in the place of a command; returns what it logs to."""

    def put(name: str, script: str) -> Path:
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
        return tmp_path / f"{name}.log"

    return put


def test_linux_holds_a_lock_of_the_desktops_service(stand_in: Stand) -> None:
    log, told = stand_in("systemd-inhibit", INHIBITS), list[str]()
    with kept_awake(told.append, "linux"):
        assert "sleep" in log.read_text()
        assert "ended" not in log.read_text()
    assert not told


def test_linux_holds_it_no_longer_than_labrig_lives(stand_in: Stand) -> None:
    log = stand_in("systemd-inhibit", INHIBITS)
    assert subprocess.run([sys.executable, "-c", KILLED], check=False).returncode == -9
    while "ended" not in log.read_text():
        time.sleep(0.01)


@pytest.mark.parametrize("script", [REFUSES, None])
def test_linux_without_the_service_is_reported_once(
    stand_in: Stand, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str | None
) -> None:
    told = list[str]()
    if script is None:
        monkeypatch.setenv("PATH", str(tmp_path))
    else:
        stand_in("systemd-inhibit", script)
    with kept_awake(told.append, "linux"):
        pass
    (line,) = told
    assert "energy saving" in line
    assert ("Access denied" in line) == (script is not None)
    assert "\n" not in line


def test_macos_runs_its_command_until_labrig_ends(stand_in: Stand) -> None:
    log, told = stand_in("caffeinate", ENDS_BY_ITSELF), list[str]()
    with kept_awake(told.append, "darwin"):
        while not log.exists():
            time.sleep(0.01)
    assert log.read_text().split()[-2:] == ["-w", str(os.getpid())]
    assert not told


@pytest.mark.parametrize("granted", [True, False])
def test_windows_is_asked_and_released(monkeypatch: pytest.MonkeyPatch, granted: bool) -> None:
    asked, told = list[int](), list[str]()

    def state(flags: int) -> int:
        asked.append(flags)
        return ES_CONTINUOUS if granted else 0

    windll = SimpleNamespace(kernel32=SimpleNamespace(SetThreadExecutionState=state))
    monkeypatch.setattr(ctypes, "windll", windll, raising=False)
    with kept_awake(told.append, "win32"):
        assert asked == [ES_CONTINUOUS | ES_SYSTEM_REQUIRED]
    assert asked[1:] == ([ES_CONTINUOUS] if granted else [])
    assert len(told) == (not granted)


def test_another_system_is_reported() -> None:
    told = list[str]()
    with kept_awake(told.append, "plan9"):
        pass
    assert len(told) == 1
