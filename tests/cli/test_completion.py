"""Completion, asked for as a shell asks."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


def completed(typed: str, folder: Path) -> list[str]:
    words = typed.split(" ")
    asked = {
        "_LABRIG_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(words),
        "COMP_CWORD": str(len(words) - 1),
    }
    answer = subprocess.run(
        [sys.executable, "-m", "labrig"],
        capture_output=True, text=True, check=True, cwd=folder, env=os.environ | asked,
    )  # fmt: skip
    assert not answer.stderr
    return answer.stdout.split()


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("labrig pla", ["plan"]),
        ("labrig run dec", ["decay", "decay-eleven"]),
        ("labrig run ./my-", []),  # the shell completes files itself
        pytest.param("labrig rig use sim-p", ["sim-phosphor"], marks=pytest.mark.campaign),
        pytest.param(
            "labrig plan decay --predict gre", ["green-paint"], marks=pytest.mark.campaign
        ),
        pytest.param("labrig resume la", ["last"], marks=pytest.mark.campaign),
        ("labrig runs show 2026-01-0", ["2026-01-02_b", "2026-01-01_a"]),
        ("labrig watch --runs elsewhere 2026", ["2026-01-03_c"]),
        pytest.param("labrig watch --runs nowhere 2026", [], marks=pytest.mark.campaign),
    ],
)
def test_names_are_completed(tmp_path: Path, typed: str, words: list[str]) -> None:
    for run in ("runs/2026-01-01_a", "runs/2026-01-02_b", "elsewhere/2026-01-03_c"):
        (tmp_path / run).mkdir(parents=True)
    assert completed(typed, tmp_path) == words
