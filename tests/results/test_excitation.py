"""An excitation's result: read back whatever is in it, and written patch by patch."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from labrig.analyse.excitation.material import excited_material
from labrig.errors import DiskError
from labrig.fit.excitation import RelativeSigmas, closure, fit_excitation
from labrig.material import read_material
from labrig.report import Source
from labrig.report.excitation import render
from labrig.results import ExcitationModel, Series
from labrig.results.excitation import (
    ExcitationResult,
    LightScatter,
    PatchCharging,
    PatchExcitation,
)
from tests.analyse.excitation.test_excitation_run import true_irradiance
from tests.fit.charged_samples import Bench, lvf_windows
from tests.results.made import assert_read_back, decay_result


@pytest.fixture(scope="module")
def result() -> ExcitationResult:
    material = read_material("blue-paint")
    bench = Bench(material)
    windows = lvf_windows(np.array([430.0, 480.0, 650.0]))
    through = bench.series("through the filter", windows, (8.0, 64.0), shots=3)
    direct = bench.series("by the lamp itself", np.ones_like(windows), (256.0,), shots=3)
    through.values[0, 0, 0] = math.nan
    (state,) = material.states
    fit = fit_excitation([through, direct], [state.k_r_per_s], [1.0], RelativeSigmas(bench.flicker))
    unknown = replace(fit.states[0], k_r_sigma_per_s=math.inf)
    fit = replace(fit, states=(unknown,))
    whole = Series(
        t_s=np.array([1.0, 5.0]), exposure_s=np.ones(2), values=np.ones((2, 3)),
        sigma=np.full((2, 3), math.nan), dark_sigma=np.zeros(3), channels=("R", "G", "B"),
        iso=np.full(2, 400.0), f_number=np.full(2, 4.0), frame=("a", "b"), unit=("u", "u"),
        flag=("", "late"),
    )  # fmt: skip
    closed = closure(
        [8.0, 64.0, 256.0], [1.0, 2.0, 3.0], [0.1, 0.1, 0.1], irradiance=[1.0],
        k_e_per_s=[[0.01]], k_r_per_s=[0.03], full_level=[10.0],
    )  # fmt: skip
    charging = PatchCharging(through, direct, np.ones(3), whole)
    decay, light = decay_result((0.03, 10.0)), LightScatter(0.003, 0.2, 0.005)
    patch = PatchExcitation(charging, decay, fit, light, material, closed)
    untested = PatchExcitation(charging, decay, fit, light, material, None)
    return ExcitationResult(
        irradiance=true_irradiance(), patches={"left": patch, "right": untested}, warnings=("odd",)
    )


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
    assert result.provides() == {
        "materials": {name: patch.material for name, patch in result.patches.items()}
    }


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


@pytest.mark.parametrize("is_known", [True, False])
def test_of_a_kinetic_order_only_what_is_known_is_shown(
    result: ExcitationResult, is_known: bool
) -> None:
    patch = result.patches["left"]
    fit = patch.fit
    (state,) = fit.states
    bent = replace(
        state, k_r_sigma_per_s=0.001, kinetic_order=1.5, kinetic_order_sigma=0.01,
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
