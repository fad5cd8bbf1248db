"""kill -9 of a real process in a protocol with steps by hand, whose resume puts the bench back.

tests/acceptance/kills_in_every_protocol.py has all protocols, at moments that nobody chose.
"""

import subprocess
import sys
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from labrig.record import read_run
from tests.quick_yaml import write_quickly

IRRADIANCE: dict[str, Any] = {
    "protocol": "irradiance", "longest": "1 s", "repeats": 1, "rounds": 1,
}  # fmt: skip


@pytest.mark.campaign
def test_it_is_resumed_with_all_that_was_complete(
    make_rig: Callable[..., Path], tmp_path: Path
) -> None:
    path, runs = tmp_path / "protocol.yaml", tmp_path / "runs"
    path.write_text(write_quickly(IRRADIANCE))
    rig = make_rig(base="sim-phosphor")
    killed(
        ["run", path, "--rig", rig, "--runs", runs, "--yes", "--no-process"], "irradiance-direct"
    )
    (folder,) = runs.iterdir()
    before = read_run(folder)
    resuming = labrig(["resume", folder, "--yes", "--no-process"])
    told = resuming.communicate()[1]
    assert resuming.returncode == 0, told
    record = read_run(folder)
    units = [attempt.unit for attempt in record.attempts if attempt.completed]
    assert units == ["dark", "direct-1", "through-1", "put-back"]
    for unit, attempt in before.completed().items():
        assert record.completed()[unit].uid == attempt.uid
    for attempt in record.attempts:
        for frame in attempt.frames:
            assert sha256(frame.path.read_bytes()).hexdigest() == frame.sha256


def killed(arguments: Sequence[object], at: str) -> None:
    """Kill it once it has told of a photograph for the role `at`."""
    process = labrig(arguments)
    assert process.stderr is not None
    with process.stderr as told:
        seen = any(f": {at}, " in line for line in told)
        process.kill()
    process.wait()
    assert seen


def labrig(arguments: Sequence[object]) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "labrig", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
