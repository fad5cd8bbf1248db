"""An excitation's result: read back whatever is in it, and written patch by patch."""

import json
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from labrig.foundation.errors import DiskError
from labrig.material import read_material
from labrig.protocols.excitation.analysis.material import excited_material
from labrig.protocols.excitation.report import render
from labrig.protocols.excitation.result import ExcitationResult
from labrig.report import Source
from labrig.results import ExcitationModel
from tests.results.made import assert_read_back
from tests.results.made_excitation import excitation_result


@pytest.fixture(scope="module")
def result() -> ExcitationResult:
    return excitation_result()


def test_it_is_read_back(result: ExcitationResult) -> None:
    assert_read_back(result)


def test_files_lie_in_folders_of_the_patches(result: ExcitationResult, tmp_path: Path) -> None:
    result.write_files(tmp_path)
    for name, patch in result.patches.items():
        assert read_material(tmp_path / name / "material.yaml") == patch.material
        fit = json.loads((tmp_path / name / "excitation.json").read_text())
        covariance = np.array(fit["covariance"], dtype=np.float64)
        known = np.isfinite(patch.fit.covariance)
        np.testing.assert_array_equal(covariance, np.where(known, patch.fit.covariance, np.nan))
        assert len(fit["covariance_parameters"]) == len(fit["covariance"])
        assert fit["covariance_parameters"][0] == "k_r_per_s 1"
    provided = result.provides()
    assert provided["materials"] == {name: each.material for name, each in result.patches.items()}
    assert provided["excitations"] == {name: each.fit for name, each in result.patches.items()}


def test_one_patch_alone_has_no_folder(result: ExcitationResult, tmp_path: Path) -> None:
    alone = replace(result, patches={"": result.patches["left"]})
    alone.write_files(tmp_path)
    assert (tmp_path / "excitation.json").is_file()
    (tmp_path / "excitation.json").unlink()
    (tmp_path / "excitation.json").mkdir()
    with pytest.raises(DiskError, match="cannot be written"):
        alone.write_files(tmp_path)


def test_places_go_along_the_filter(result: ExcitationResult) -> None:
    position_nm = result.position_nm
    assert len(position_nm) == len(result.irradiance.position)
    assert position_nm[0] < 460 < 600 < position_nm[-1]


def test_an_order_that_its_bound_holds_has_a_one_sided_limit(result: ExcitationResult) -> None:
    (state,) = result.patches["left"].fit.states
    assert str(replace(state, kinetic_order=1.0, kinetic_order_sigma=0.02).order) == "< 1.033"
    assert str(replace(state, kinetic_order=1.1, kinetic_order_sigma=0.02).order) == "1.100(20)"
    assert replace(state, kinetic_order=1.0, kinetic_order_sigma=0.0).order.sigma == 0
    patch = result.patches["left"]
    for sigma, limit in ((0.02, 1.0329), (0.0, None)):
        fit = replace(patch.fit, states=(replace(state, kinetic_order_sigma=sigma),))
        material = excited_material(fit, result.irradiance, None, "mine", "run", ())
        assert material.states[0].kinetic_order_limit_95 == limit


@pytest.mark.parametrize("is_known", [True, False])
def test_of_a_kinetic_order_only_what_is_known_is_shown(
    result: ExcitationResult, is_known: bool
) -> None:
    patch = result.patches["left"]
    fit = patch.fit
    (state,) = fit.states
    bent = replace(
        state, k_r_per_s_sigma=0.001, kinetic_order=1.5, kinetic_order_sigma=0.01,
        is_level_known=is_known,
    )  # fmt: skip
    covariance = np.diag([*np.diag(fit.covariance), 1e-4])
    models = tuple(ExcitationModel(1, order, 12, 1.0, 7.0) for order in (1.0, None))
    last = fit.at_off[-1]
    last = replace(last, decay_time_s=1 / (0.5 * state.k_r_per_s * last.r0**0.5))
    fit = replace(
        fit, states=(bent,), covariance=covariance, models=models, at_off=(*fit.at_off[:-1], last)
    )
    again = replace(result, patches={"": replace(patch, fit=fit)})
    assert_read_back(again)
    assert fit.covariance_parameters[-1] == "kinetic_order 1"
    shown = render(again, cast(Source, None))
    assert "b 1.500 ± 0.010" in shown.lines[0]
    assert ("k_r 0.0" in shown.lines[0]) == is_known
    assert ("τ" in shown.lines[0] and "p 3.000 ± 0.040" in shown.lines[0]) != is_known
    assert any("1 state of general order" in line for line in shown.lines)
    (levels, _) = shown.sections[0].tables
    assert (levels.rows[0][1:4] == ("–",) * 3) != is_known
    assert levels.rows[0][-3:-2] == ("1.500 ± 0.010",)
    material = excited_material(fit, result.irradiance, None, "mine", "run", ())
    assert material.states[0].kinetic_order == 1.5
    assert material.states[0].kinetic_order_sigma == 0.01
