import subprocess
from pathlib import Path
from typing import Any

import pytest

from .bench import ToyBench

Processes = list["subprocess.Popen[bytes]"]


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """libgphoto2 finds and leaves no settings of anybody's."""
    monkeypatch.setenv("HOME", str(tmp_path))


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ToyBench:
    return ToyBench(tmp_path, monkeypatch)


@pytest.fixture
def helpers(monkeypatch: pytest.MonkeyPatch) -> Processes:
    """The processes that are started from now on."""
    started: Processes = []

    class Recorded(subprocess.Popen[Any]):
        def __init__(self, *arguments: Any, **keys: Any) -> None:
            super().__init__(*arguments, **keys)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Recorded)
    return started
