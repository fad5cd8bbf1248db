"""Pipes whose reader has gone: `labrig plan … | head` is no error, and no reason to stop a run."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from labrig.record import read_run


@pytest.fixture
def unread() -> Iterator[int]:
    """The writing end of a pipe that nobody reads any more."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


def labrig(*arguments: object, out: int, err: int) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "labrig", *map(str, arguments)]
    return subprocess.run(command, stdout=out, stderr=err, text=True, check=False)


def test_whoever_reads_no_further_gets_no_complaint(unread: int) -> None:
    done = labrig("plan", "decay", "--rig", "sim", out=unread, err=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_run_whose_log_nobody_reads_any_more_goes_on(
    make_protocol: Callable[..., Path],
    make_rig: Callable[..., Path],
    tmp_path: Path,
    unread: int,
) -> None:
    protocol = make_protocol(charge="60 s", **{"for": "20 s"})
    command = ["run", protocol, "--rig", make_rig(), "--runs", tmp_path / "runs", "--no-process"]
    assert labrig(*command, out=unread, err=unread).returncode == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert list(read_run(folder).completed()) == ["dark", "decay-1"]


def test_what_is_wrong_is_an_exit_code_even_if_nobody_reads_the_line(unread: int) -> None:
    done = labrig("plan", "decya", "--rig", "sim", out=subprocess.PIPE, err=unread)
    assert (done.returncode, done.stdout) == (2, "")
