"""Commands from the shell's point of view: a new process each, imports included."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

Against = Callable[..., None]

PYTHON = (sys.executable, "-c", "import numpy, pydantic, typer")
RUNS = 5000


def call(*command: str | Path) -> None:
    # Commands are installed with their bytecode, or write it when they are first used.
    environment = {key: os.environ[key] for key in os.environ if key != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run(command, check=True, capture_output=True, env=environment)


def labrig(*arguments: str | Path) -> None:
    call(sys.executable, "-m", "labrig", *arguments)


IMPORTS = {"Python with NumPy, pydantic and Typer": partial(call, *PYTHON)}


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of copies of one processed run without its frames, each of another sample."""
    folder = tmp_path_factory.mktemp("many")
    labrig("run", "decay", "--rig", "sim", "--runs", folder / "one")
    (original,) = (folder / "one").iterdir()
    for name in ("frames", "cache"):
        shutil.rmtree(original / name)
    for path in sorted((original / "result").rglob("*"), reverse=True):
        if path.is_dir():
            path.rmdir()
        elif path.name not in ("fit.json", "result.json", "provenance.yaml"):
            path.unlink()
    protocol = (original / "protocol.yaml").read_text()
    for number in range(RUNS):
        copy = folder / "runs" / f"2026-01-01T00-00-00_decay_paint-{number}"
        shutil.copytree(original, copy, copy_function=os.link)
        (copy / "protocol.yaml").unlink()
        (copy / "protocol.yaml").write_text(protocol.replace("blue-paint", f"paint-{number}"))
    return folder / "runs"


@pytest.mark.parametrize("arguments", ["--help", "--version", "plan decay --rig sim"])
def test_commands_that_measure_nothing(arguments: str, against: Against) -> None:
    against(partial(labrig, *arguments.split()), IMPORTS, rounds=10, what=f"labrig {arguments}")


def test_no_runs_listed(tmp_path: Path, against: Against) -> None:
    ours = partial(labrig, "runs", "list", "--runs", tmp_path)
    against(ours, IMPORTS, rounds=10, what="labrig runs list, no runs")


def test_many_runs_listed(many: Path, against: Against) -> None:
    def stat() -> None:
        for path in many.iterdir():
            path.stat()

    ours = partial(labrig, "runs", "list", "--runs", many)
    peers = {**IMPORTS, "stat of their folders": stat}
    against(ours, peers, rounds=10, what=f"labrig runs list, {RUNS} runs")


@pytest.mark.parametrize("processing", [(), ("--no-process",)])
def test_a_run_in_the_simulated_room(
    processing: tuple[str, ...], tmp_path: Path, against: Against
) -> None:
    arguments = ("run", "decay", "--rig", "sim", *processing)
    ours = partial(labrig, *arguments, "--runs", tmp_path)
    against(ours, IMPORTS, rounds=3, what=f"labrig {' '.join(arguments)}")
