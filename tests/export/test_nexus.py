"""run.nxs as other people's programs see it: silx opens it on the decay, its classes are NeXus."""

import json
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import silx.io
from nexusformat.nexus.validate import validate_file
from silx.io import nxdata

import labrig
from labrig.export import write_nexus
from labrig.foundation.errors import DiskError
from labrig.record import read_run
from tests.export.conftest import Finished


@pytest.fixture
def written(tmp_path: Path) -> Callable[[Finished], Path]:
    """Writes the NeXus file of a run."""

    def write(run: Finished, name: str = "run.nxs") -> Path:
        write_nexus(tmp_path / name, read_run(run.folder), run.about, run.result)
        return tmp_path / name

    return write


Written = Callable[..., Path]


def test_silx_opens_it_on_the_decay_with_errors_and_units(
    finished: Finished, written: Written
) -> None:
    first, second = labrig.read_series(finished.folder / "result" / "series.csv")
    with silx.io.open(str(written(finished))) as file:
        shown = nxdata.get_default(file)
        assert shown.is_valid
        assert shown.is_curve
        assert shown.title == "sample, decay-1"
        assert shown.signal_dataset_name == "B"
        assert sorted(shown.auxiliary_signals_dataset_names) == ["G", "R"]
        assert shown.signal.attrs["units"] == "DN/s"
        (axis,) = shown.axes
        assert axis.attrs["units"] == "s"
        np.testing.assert_array_equal(axis, first.t_s + first.exposure_s / 2)
        for number, channel in enumerate(first.channels):
            np.testing.assert_array_equal(shown.group[channel], first.values[:, number])
        np.testing.assert_array_equal(shown.errors, first.sigma[:, 2])
        np.testing.assert_array_equal(file["entry/decay_2_sample/B"], second.values[:, 2])


def test_every_plot_in_it_is_valid(finished: Finished, written: Written) -> None:
    plots: list[str] = []

    def check(name: str, item: Any) -> None:
        if item.attrs.get("NX_class") == "NXdata":
            plots.append(name)
            assert nxdata.NXdata(item).issues == []

    with h5py.File(written(finished)) as file:
        file.visititems(check)
    assert len(plots) == 2 * 3, "of each decay what was measured, the fit and its residuals"


@pytest.mark.parametrize("run", ["finished", "with_dark_patch"])
def test_names_and_units_are_those_of_the_nexus_definitions(
    run: str, request: pytest.FixtureRequest, written: Written
) -> None:
    warnings, errors = validate_file(str(written(request.getfixturevalue(run))))
    assert (warnings, errors) == (0, 0)


def test_the_fit_is_that_of_fit_json_and_leaves_the_residuals_it_says(
    finished: Finished, written: Written
) -> None:
    kept = json.loads((finished.folder / "result" / "fit.json").read_text())
    with h5py.File(written(finished)) as file:
        fit = file["entry/fit_sample"]
        (state,) = kept["states"]
        assert fit["parameters/rate"][0] == state["k_r_per_s"]
        assert fit["parameters/rate_errors"][0] == state["k_r_per_s_sigma"]
        assert fit["parameters/amplitude"].attrs["units"] == "DN/s"
        assert fit["parameters/covariance"][()].tolist() == kept["covariance"]
        units = fit["parameters/covariance"].attrs["units"]
        assert units == "products of 1/s, DN/s, DN/s"
        assert json.loads(fit["fit/data"].asstr()[()]) == kept
        measured, curve = file["entry/decay_1_sample"], fit["decay_1_curve"]
        k, t = state["k_r_per_s"], measured["exposure_start"][()]
        x = k * measured["exposure_time"][()]
        mean = state["amplitude"] * np.exp(-k * t) * -np.expm1(-x) / x
        np.testing.assert_allclose(curve["B"], mean + kept["offsets"]["B"], rtol=1e-12)
        squares = [np.square(fit[f"decay_{n}_residuals/{c}"]).sum() for n in (1, 2) for c in "RGB"]
        assert sum(squares) == pytest.approx(kept["chi2"], rel=0.05)


def test_it_tells_the_frames_and_where_they_come_from(finished: Finished, written: Written) -> None:
    with h5py.File(written(finished)) as file:
        entry = file["entry"]
        assert entry["title"].asstr()[()] == "Glühfarbe"
        assert entry["sample/description"].asstr()[()] == "batch: 7"
        assert entry["experiment_identifier"].asstr()[()] == finished.folder.name
        assert entry["start_time"].asstr()[()].startswith("2026-01-01T00:00:0")
        for name in ("protocol", "rig"):
            text = (finished.folder / f"{name}.yaml").read_text(encoding="utf-8")
            assert entry[name]["data"].asstr()[()] == text
        camera = entry["instrument/camera"]
        assert "Canon EOS 5D Mark II" in camera["description"].asstr()[()]
        names = camera["frames/file_name"].asstr()[()]
        assert len(names) == len(list((finished.folder / "frames").iterdir()))
        for name, checksum in zip(names, camera["frames/sha256"].asstr()[()], strict=True):
            assert sha256((finished.folder / name).read_bytes()).hexdigest() == checksum
        length_s = camera["stop_time"][()] - camera["start_time"][()]
        np.testing.assert_allclose(length_s, camera["count_time"], atol=1e-5)
        switched = entry["instrument/lamp/switched"]
        assert switched["value"][()].tolist() == [1, 0, 1, 0]
        on_s, off_s = switched["time"][:2]
        assert off_s - on_s > 600, "the charge of ten minutes"
        first = list(camera["frames/role"].asstr()[()]).index("decay")
        begin_s = entry["decay_1_sample/exposure_start"][0]
        assert camera["start_time"][first] - off_s == pytest.approx(begin_s, abs=1e-5)


def test_of_a_patch_without_a_fit_it_has_the_values_and_the_reason(
    with_dark_patch: Finished, written: Written
) -> None:
    with h5py.File(written(with_dark_patch)) as file:
        entry = file["entry"]
        assert entry.attrs["default"] == "decay_1_l_2"
        dark = entry["decay_1_l_2_"]
        assert dark["title"].asstr()[()] == "Öl; 2 %, decay-1"
        assert abs(dark["B"][()].mean()) < entry["decay_1_l_2/B"][()].mean() / 100
        reason = entry["fit_l_2_/not_fitted/data"].asstr()[()]
        assert reason == with_dark_patch.result.patches["Öl; 2 %"].failure
        assert "parameters" in entry["fit_l_2"]


def test_the_same_run_gives_the_same_bytes_whenever_it_is_written(
    finished: Finished, written: Written
) -> None:
    once = written(finished).read_bytes()
    time.sleep(1.1)  # HDF5 keeps times in whole seconds
    assert written(finished, "again.nxs").read_bytes() == once


def test_a_file_that_cannot_be_written_is_reported_in_one_line(
    finished: Finished, tmp_path: Path
) -> None:
    path = tmp_path / "nowhere" / "run.nxs"
    with pytest.raises(DiskError, match=r"run\.nxs: cannot be written") as caught:
        write_nexus(path, read_run(finished.folder), finished.about, finished.result)
    assert "\n" not in str(caught.value)
