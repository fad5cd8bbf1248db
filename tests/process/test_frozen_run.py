"""A run folder as labrig 0.1.0 wrote it is read by every later labrig, to the same numbers.

Where the numbers are meant to change, `labrig process` says by how much; freeze its series.csv and
fit.json beside the run again. Where the format changes, old folders must still be read: freeze a
further run, and leave this one as it is.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from labrig.process import process_run
from labrig.record import read_run
from labrig.reduce import read_series

FROZEN = Path(__file__).parent / "data" / "decay-0.1.0"


def test_a_frozen_run_gives_its_numbers(tmp_path: Path) -> None:
    run = Path(shutil.copytree(FROZEN, tmp_path / FROZEN.name))
    record = read_run(run)
    assert list(record.completed()) == ["dark", "decay-1", "daylight"]
    assert not record.torn
    result = process_run(run)

    (known,) = read_series(FROZEN / "result" / "series.csv")
    found = result.series["sample"]
    assert found.frame == known.frame
    for column in ("t_s", "exposure_s", "values", "iso", "f_number"):
        np.testing.assert_allclose(getattr(found, column), getattr(known, column), rtol=1e-9)
    np.testing.assert_allclose(found.sigma, known.sigma, rtol=1e-3)

    fit = json.loads((FROZEN / "result" / "fit.json").read_text())
    assert tuple(fit["channel_weights"]) == result.fits["sample"].channels
    for state, frozen in zip(result.fits["sample"].states, fit["states"], strict=True):
        for name, sigma in (("k_r_per_s", "k_r_sigma_per_s"), ("amplitude", "amplitude_sigma")):
            assert getattr(state, name) == pytest.approx(frozen[name], abs=0.01 * frozen[sigma])
            assert getattr(state, sigma) == pytest.approx(frozen[sigma], rel=0.01)
