"""A run as a Dataset: the numbers of its files, and one line when there are none."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import labrig
from labrig.foundation.errors import DataError, UsageError
from tests.export.conftest import Finished


def test_it_has_the_numbers_of_the_result(finished: Finished) -> None:
    dataset = labrig.read_result(finished.folder).to_xarray()
    decays = labrig.read_series(finished.folder / "result" / "series.csv")
    assert dict(dataset.sizes) == {"patch": 1, "frame": 16, "channel": 3, "state": 1}
    for decay in decays:
        part = dataset.sel(patch="sample", frame=list(decay.frame))
        np.testing.assert_array_equal(part.value, decay.values)
        np.testing.assert_array_equal(part.value_sigma, decay.sigma)
        np.testing.assert_array_equal(part.t_s, decay.t_s)
        np.testing.assert_array_equal(part.exposure_s, decay.exposure_s)
        assert list(part.unit.values) == list(decay.unit)
    fit = json.loads((finished.folder / "result" / "fit.json").read_text())
    state = dataset.sel(patch="sample", state=1)
    assert {key: float(state[key]) for key in fit["states"][0]} == fit["states"][0]
    for channel in "RGB":
        weight = dataset.channel_weight.sel(patch="sample", channel=channel)
        assert float(weight) == fit["channel_weights"][channel]


def test_units_and_origin_are_attributes(finished: Finished) -> None:
    dataset = labrig.read_result(str(finished.folder)).to_xarray()
    units = {name: dataset[name].attrs.get("units") for name in ("value", "value_sigma", "t_s")}
    assert units == {"value": "DN/s", "value_sigma": "DN/s", "t_s": "s"}
    assert dataset.k_r_per_s.attrs["units"] == "1/s"
    assert dataset.attrs["run"] == finished.folder.name
    assert dataset.attrs["sample"] == "Glühfarbe"
    assert "Canon" in dataset.attrs["camera"]


def test_a_patch_without_a_fit_has_values_and_no_parameters(with_dark_patch: Finished) -> None:
    dataset = labrig.read_result(with_dark_patch.folder).to_xarray()
    assert set(dataset.patch.values) == {"Öl, 2 %", "Öl; 2 %"}
    assert np.isfinite(dataset.value).all()
    assert np.isfinite(dataset.k_r_per_s.sel(patch="Öl, 2 %", state=1))
    dark = dataset.sel(patch="Öl; 2 %")
    assert np.isnan(dark.k_r_per_s).all()
    assert np.isnan(dark.channel_weight).all()


def test_what_cannot_be_read_is_reported_in_one_line(
    finished: Finished, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UsageError, match="expected a run with a result"):
        labrig.read_result(tmp_path).to_xarray()
    copy = shutil.copytree(finished.folder, tmp_path / "run")
    (copy / "result" / "result.json").write_text(
        '{"kind": "decay", "schema_version": 1, "patches": ['
    )
    with pytest.raises(DataError, match=r"result\.json: expected"):
        labrig.read_result(copy).to_xarray()
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(UsageError, match=r"pip install 'labrig\[notebook\]'"):
        labrig.read_result(finished.folder).to_xarray()
