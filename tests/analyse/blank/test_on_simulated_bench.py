"""A blank on the simulated bench: clean when nothing shines, and what it says when it is not."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import Overrides
from labrig.analyse.frames import intact_frames
from labrig.analyse.inputs import Inputs
from labrig.calibration import BLANK_KIND
from labrig.foundation.errors import DataError
from labrig.process import process_run
from labrig.protocols.decay import analysis as decay_analysis
from labrig.record import read_run
from tests.analyse.recorded import cut_off_and_resumed, part_of, record
from tests.analyse.small_runs import BLANK
from tests.results.made import assert_read_back
from tests.warned import codes, of_code


def without_door(rig: dict[str, Any]) -> None:
    del rig["devices"]["door"], rig["devices"]["shield"]
    rig["simulation"] |= {"door": None, "shield": None}


def with_light(**simulation: Any) -> Callable[[dict[str, Any]], None]:
    def change(rig: dict[str, Any]) -> None:
        without_door(rig)
        rig["simulation"] |= simulation

    return change


def test_a_dark_bench_is_clean_as_soon_as_its_lamp_is(tmp_path: Path) -> None:
    run = record(tmp_path, BLANK, without_door)
    result = process_run(run)
    blank = BLANK_KIND.read(run / "result" / "blank.yaml")
    assert blank.first_clean_s is not None
    # At 160 ms the filament still glows, at 560 ms it does not.
    assert blank.first_clean_s == pytest.approx(0.56, abs=0.02)
    assert blank.rate_dn_per_s[0][1] > 100 * blank.sigma_dn_per_s[0][1]
    assert result.warnings == ()
    assert_read_back(result)
    constant = np.array(blank.constant_dn_per_s)
    assert np.all(np.abs(constant) < 4 * np.array(blank.constant_dn_per_s_sigma))

    cut, resumed = cut_off_and_resumed(run, "blank-2")
    assert list(cut.completed()) == ["dark", "blank-1"]
    assert list(resumed.completed()) == ["dark", "blank-1", "blank-2", "put-back"]


def test_a_hot_pixel_is_no_light_that_leaks_in(tmp_path: Path) -> None:
    """This sensor has one in blue, which makes 0.7 DN/s of the mean of that colour."""
    assert process_run(record(tmp_path, BLANK, with_light(seed=4))).warnings == ()


def test_a_leak_is_found_and_reported_and_a_decay_is_warned(tmp_path: Path) -> None:
    leaking = record(tmp_path / "leak", BLANK, with_light(ambient=1e-6))
    result = process_run(leaking)
    blank = BLANK_KIND.read(leaking / "result" / "blank.yaml")
    green = blank.channels.index("G")
    assert blank.ambient_dn_per_s[green] > 10 * blank.ambient_dn_per_s_sigma[green]
    # Dark frames hold it, too: nothing is left once they are subtracted.
    assert abs(blank.constant_dn_per_s[green]) < 4 * blank.constant_dn_per_s_sigma[green]
    assert of_code(result.warnings, "stray-light").values["occasion"] == "all the time"

    decay = {"protocol": "decay", "sample": {"name": "test"}, "charge": "60 s", "for": "40 s",
             "first": "1 s", "exposure": "1 s"}  # fmt: skip
    run = record(tmp_path / "decay", decay)
    found = decay_analysis.analyse(part_of(run, Inputs({"blank": blank})))
    assert of_code(found.warnings, "stray-light").values["occasion"] == "all the time"


def test_a_lamp_that_glows_on_is_never_clean(tmp_path: Path) -> None:
    # Half as much is within the noise of one run in eight.
    lamp = {"afterglow": 2e-5, "afterglow_fades": "20 s"}
    run = record(tmp_path, BLANK, with_light(lamp=lamp))
    result = process_run(run)
    blank = BLANK_KIND.read(run / "result" / "blank.yaml")
    assert blank.first_clean_s is None
    assert "blank-still-fades" in codes(result.warnings)
    decay = {"protocol": "decay", "sample": {"name": "test"}, "charge": "60 s", "for": "20 s",
             "first": "1 s", "exposure": "1 s"}  # fmt: skip
    decayed = record(tmp_path / "decay", decay)
    with pytest.raises(DataError, match="never became free"):
        decay_analysis.analyse(part_of(decayed, Inputs({"blank": blank})))
    # One that is clean from the third frame on: the earlier ones are left out, and it is said.
    third = sorted(frame.t_s for frame in intact_frames(read_run(decayed), Overrides()).decay)[2]
    ends = blank.model_copy(update={"first_clean_s": third, "ambient_dn_per_s": (0.0, 0.0, 0.0)})
    found = decay_analysis.analyse(part_of(decayed, Inputs({"blank": ends})))
    (patch,) = found.patches.values()
    assert list(patch.series.usable[:4]) == [False, False, True, True]
    assert of_code(found.warnings, "frames-before-dark").values["left_out"] == 2
    rate = np.array(blank.rate_dn_per_s)[:, 1]
    assert rate[1] > rate[-1]


def test_frames_that_were_changed_are_refused(tmp_path: Path) -> None:
    run = record(tmp_path, BLANK, without_door)
    first, *_, last = sorted((run / "frames").iterdir())
    shutil.copy(last, first)
    with pytest.raises(Exception, match="was changed after the run"):
        process_run(run)
