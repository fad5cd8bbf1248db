"""The protocol, run on the simulated bench and analysed."""

import subprocess
import sys
from pathlib import Path

import labrig
from my_protocol.result import MyProtocolResult

FOLDER = Path(__file__).parents[1]


def test_a_run_on_the_simulated_bench(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "labrig", "run", "my_protocol"]
    subprocess.run([*words, "--rig", FOLDER / "rig.yaml", "--runs", tmp_path], check=True)
    (run,) = tmp_path.iterdir()
    result = labrig.read_result(run)
    assert isinstance(result, MyProtocolResult)
    assert len(result.time_s) == 5
    assert 0 < result.left.value < 1, "the glow fades"
    assert result.left.sigma < 0.1
