"""The folder in which the examples of docstrings and of the manual run.

It holds what a bench has after its first measurements: `runs/decay`, a run of the simulated bench
with its results; `material.yaml` and `series.csv` from it; `frame.dng`, one of its frames; the
calibrations `camera.yaml`, `lvf.yaml`, `fade.yaml`, `blank.yaml`, `irradiance.yaml` and
`reference.yaml`; and
`paper.csv`, the re-radiation matrix of a fluorescent paper.
"""

import shutil
from pathlib import Path

from labrig.material import write_reradiation
from labrig.process import process_run
from tests.material.reradiation.formats.matrices import two_dyes

TESTS = Path(__file__).parents[1]
RUN = TESTS / "recordings/decay/run"
CALIBRATIONS = TESTS / "acceptance/recorded_phosphor"
REFERENCE = Path(__file__).with_name("reference.yaml")


def make_examples(folder: Path) -> None:
    """Fill `folder`, which is there and empty."""
    run = folder / "runs/decay"
    shutil.copytree(RUN, run)
    process_run(run)
    for name in ("material.yaml", "series.csv"):
        shutil.copy(run / "result" / name, folder)
    shutil.copy(sorted((run / "frames").iterdir())[-1], folder / "frame.dng")
    for path in CALIBRATIONS.glob("*/*.yaml"):
        if path.stem in {"camera", "lvf", "fade", "blank", "irradiance"}:
            shutil.copy(path, folder)
    shutil.copy(REFERENCE, folder)
    write_reradiation(folder / "paper.csv", two_dyes(noise=0.0))
