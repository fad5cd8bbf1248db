"""A result is made again bit for bit: elsewhere, in another process, under another clock."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Ended

Labrig = Callable[..., Ended]
Make = Callable[..., Path]

PATCHES = {"left": [8, 12, 32, 40], "right": [52, 12, 32, 40]}


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.drawn
def test_a_result_is_made_again_bit_for_bit(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    protocol = make_protocol(patches=PATCHES, daylight=True, **{"for": "30 s"})
    ended = labrig("run", protocol, "--rig", make_rig(), "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    result = contents(ended.run_folder / "result")
    names = {"fit.json", "material.yaml", "series.csv"}
    ours = {"provenance.yaml", "report.html", "result.json", "run.nxs", "summary.txt"}
    ours.add("sample.png")
    ours |= {f"{patch}/{name}" for patch in PATCHES for name in names}
    assert ours == {name for name in result if not name.startswith("figures/")}
    shutil.rmtree(ended.run_folder / "result")
    (tmp_path / "an other").mkdir()
    moved = Path(shutil.move(ended.run_folder, tmp_path / "an other"))
    done = subprocess.run(
        [sys.executable, "-m", "labrig", "process", "."],
        cwd=moved,
        env=os.environ | {"PYTHONHASHSEED": "11", "TZ": "Asia/Kathmandu", "LC_ALL": "C"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert contents(moved / "result") == result


def test_processing_again_says_so_and_keeps_one_result(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    ended = labrig("run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path / "runs")
    assert "result before" not in ended.out
    run = ended.run_folder
    before = contents(run / "result")
    (run / "result" / "my plot.png").write_bytes(b"a person's own")
    assert "the same result as before\n" in labrig("process", run).out
    assert not (run / "result-1").exists()

    said = labrig("process", run, "--exclude", "7", "--roi", "20,20,30,30").out
    assert "kept as result-1:\n" in said
    assert "  regions sample: 0.25, 0.25, 0.5, 0.5 → 20.0, 20.0, 30.0, 30.0\n" in said
    assert "  frames decay: 12 → 11\n" in said
    assert "  excluded: none → 000007.dng\n" in said
    (line,) = (line for line in said.splitlines() if line.startswith("  k_r 1 "))
    assert " σ); a 1 " in line
    assert contents(run / "result-1").items() >= before.items()

    assert "kept as result-2:\n" in labrig("process", run).out
    assert contents(run / "result") == before
