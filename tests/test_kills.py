"""kill -9 of real processes in protocols whose resume nothing else in this suite goes through.

tests/acceptance/kills_in_every_protocol.py has all of them, at moments that nobody chose.
"""

import subprocess
import sys
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
import yaml

from labrig.record import read_run

SHORT: dict[str, dict[str, Any]] = {
    "irradiance": {"longest": "1 s", "repeats": 1, "rounds": 1},
    "isotropy": {"charge": "1 min", "angles": [60], "frames": 2},
    "saturation": {"charges": ["1 min", "2 min"], "for": "20 s"},
}


@pytest.mark.parametrize(
    ("protocol", "at", "units"),
    [
        ("irradiance", "irradiance-direct", ["dark", "direct-1", "through-1", "put-back"]),
        ("isotropy", "isotropy", ["dark", "meter", "angle-before", "angle-60", "angle-after"]),
        ("saturation", "decay", ["dark", "meter-full", "full-1", "full-2"]),
    ],
)
def test_it_is_resumed_with_all_that_was_complete(
    make_rig: Callable[..., Path], tmp_path: Path, protocol: str, at: str, units: list[str]
) -> None:
    path, runs = tmp_path / "protocol.yaml", tmp_path / "runs"
    path.write_text(yaml.safe_dump({"protocol": protocol} | SHORT[protocol]))
    rig = make_rig(base="sim-phosphor")
    killed(["run", path, "--rig", rig, "--runs", runs, "--yes", "--no-process"], at)
    (folder,) = runs.iterdir()
    before = read_run(folder)
    resuming = labrig(["resume", folder, "--yes", "--no-process"])
    told = resuming.communicate()[1]
    assert resuming.returncode == 0, told
    record = read_run(folder)
    assert [attempt.unit for attempt in record.attempts if attempt.completed] == units
    for unit, attempt in before.completed().items():
        assert record.completed()[unit].uid == attempt.uid
    for attempt in record.attempts:
        for frame in attempt.frames:
            assert sha256(frame.path.read_bytes()).hexdigest() == frame.sha256


def killed(arguments: Sequence[object], at: str) -> None:
    """Kill it once it has told of a photograph for the purpose `at`."""
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
