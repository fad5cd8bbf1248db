"""A processed run, for tests of commands that take a run folder."""

import shutil
from pathlib import Path

import pytest

from labrig.cli import guarded
from tests.conftest import write_short_decay, write_small_rig


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A processed run, of which tests get copies."""
    folder = tmp_path_factory.mktemp("finished")
    write_small_rig(folder / "rig.yaml")
    write_short_decay(folder / "protocol.yaml")
    asked = [str(folder / "protocol.yaml"), "--rig", str(folder / "rig.yaml")]
    assert guarded(["run", *asked, "--runs", str(folder / "runs")]) == 0
    (run,) = (folder / "runs").iterdir()
    return run


@pytest.fixture
def finished(kept: Path, tmp_path: Path) -> Path:
    """A copy of the run that the test may change."""
    return Path(shutil.copytree(kept, tmp_path / "runs" / kept.name))
