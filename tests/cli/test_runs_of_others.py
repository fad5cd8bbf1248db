"""Runs that another labrig is writing, or that another user owns: one line for each command."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.record import RunFolder
from tests.conftest import Ended

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no such modes of files")

RIGHTS = "-dac_override,-dac_read_search,-fowner"
COMMANDS = [
    ("process RUN", 5, "Permission denied"),
    ("process RUN --verify", 5, "Permission denied"),
    ("resume RUN --yes", 5, "copy it to a folder of your own"),
    ("note RUN text", 5, "ask for the right to write there"),
    ("figures RUN", 5, "ask for the right to write there"),
    ("verify RUN", 4, "cannot be read (Permission denied)"),
    ("frame RUN/frames/000001.dng", 2, "not readable"),
    ("runs list --runs RUNS", 0, ""),
    ("queue add decay --rig sim --queue RUNS/queue.yaml", 5, "Permission denied"),
    ("run decay --rig sim --runs RUNS --yes", 5, "a run folder cannot be made there"),
]


def test_a_run_that_is_being_recorded_is_analysed_as_far_as_it_is(
    labrig: Callable[..., Ended], finished: Path
) -> None:
    shutil.rmtree(finished / "result")
    with RunFolder(finished):
        ended = labrig("process", finished)
    assert ended.code == 0
    assert ended.err.splitlines()[0].startswith("note: this run is being recorded")
    assert "being recorded" not in labrig("process", finished).err


def test_what_another_user_owns_is_left_alone(finished: Path, tmp_path: Path) -> None:
    """Who runs the tests as root has all rights, and gives them away first."""
    text = (
        "import shlex, sys\n"
        "from labrig.cli import guarded\n"
        "for line in sys.stdin:\n"
        "    code = guarded(shlex.split(line))\n"
        "    print('exit code', code, file=sys.stderr, flush=True)\n"
    )
    command = [sys.executable, "-c", text]
    if os.geteuid() == 0:
        command = ["setpriv", f"--bounding-set={RIGHTS}", f"--inh-caps={RIGHTS}", *command]
    places = [finished, *finished.rglob("*"), finished.parent]
    modes = {path: path.stat().st_mode for path in places}
    for path, mode in modes.items():
        path.chmod(mode & 0o555)
    (finished / "frames" / "000001.dng").chmod(0)
    named = {"RUNS": str(finished.parent), "RUN": str(finished)}
    lines = [" ".join(_filled(word, named) for word in line.split()) for line, *_ in COMMANDS]
    ended = subprocess.run(
        command, input="\n".join(lines), capture_output=True, text=True, check=False, cwd=tmp_path
    )
    for path, mode in modes.items():
        path.chmod(mode)
    assert sorted(places) == sorted([finished, *finished.rglob("*"), finished.parent])
    said = [part.splitlines() for part in ended.stderr.split("exit code ")]
    codes = [int(part[0]) for part in said[1:]]
    assert codes == [code for _, code, _ in COMMANDS], ended.stderr
    complaints = [[line for line in part if line.startswith("labrig: ")] for part in said]
    for (_, code, reason), complaint in zip(COMMANDS, complaints, strict=False):
        assert len(complaint) == (code != 0), complaint
        assert reason in "".join(complaint)


def _filled(word: str, named: dict[str, str]) -> str:
    first, slash, rest = word.partition("/")
    return named.get(first, first) + slash + rest
