"""Processing of a whole phosphor, against rawpy decoding the same frames."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import rawpy

from labrig.process import process_run

Against = Callable[..., None]


@pytest.fixture(scope="module")
def phosphor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A phosphor of the simulated room, recorded and not yet processed."""
    runs = tmp_path_factory.mktemp("runs")
    command = [sys.executable, "-m", "labrig", "run", "phosphor", "--rig", "sim-phosphor", "--yes"]
    options = ["--no-process", "--runs", str(runs)]
    subprocess.run([*command, *options], check=True, stdout=subprocess.DEVNULL)
    (run,) = runs.iterdir()
    return run


def test_a_phosphor(phosphor: Path, against: Against) -> None:
    paths = sorted((phosphor / "frames").iterdir())

    def decoded() -> None:
        for path in paths:
            with rawpy.imread(str(path)) as raw:
                assert raw.raw_image[0, 0] > 0

    def processed() -> None:
        # With its cache kept no photograph would be read again.
        for folder in ("cache", "result"):
            shutil.rmtree(phosphor / folder, ignore_errors=True)
        assert process_run(phosphor).failures() == ()

    against(
        processed,
        {"rawpy decodes": decoded},
        rounds=1,
        what=f"a phosphor of {len(paths)} small frames: result, report, exports",
    )
