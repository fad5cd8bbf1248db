"""A decay's result: what is written is read back, and what is damaged is refused in one line."""

import json
import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.errors import DataError
from labrig.results import (
    FittedDecay,
    Measured,
    find_fitted_decays,
    read_fitted_decay,
    read_fitted_decays,
    write_fitted_decay,
)
from tests.fit import truths


@pytest.fixture(scope="module")
def fit() -> DecayFit:
    seen = truths.observe(truths.exponentials((0.08, 1.0), (0.015, 0.4)), 1)
    return fit_decay(
        seen.t_s, seen.values, seen.sigma, exposure_s=seen.exposure_s, channels="RGB",
        offset_sigma=0.01, flicker=None,
    )  # fmt: skip


def assert_same(one: FittedDecay, other: FittedDecay) -> None:
    for field in fields(FittedDecay):
        of_one, of_other = getattr(one, field.name), getattr(other, field.name)
        if field.name in ("laws", "rate_spectrum"):
            continue
        if isinstance(of_one, np.ndarray):
            np.testing.assert_array_equal(of_one, of_other)
        else:
            assert of_one == of_other, field.name
    for law, again in zip(one.other_laws, other.other_laws, strict=True):
        assert law.to_dict() == again.to_dict()


def test_what_is_written_is_read_back(fit: DecayFit, tmp_path: Path) -> None:
    write_fitted_decay(tmp_path / "fit.json", fit)
    again = read_fitted_decay(tmp_path / "fit.json")
    assert_same(fit, again)
    np.testing.assert_array_equal(again.predict([0.0, 10.0], 1.0), fit.predict([0.0, 10.0], 1.0))
    assert str(again) == str(fit)


def test_what_nothing_is_known_of_is_read_back(fit: DecayFit, tmp_path: Path) -> None:
    states = (replace(fit.states[0], amplitude_sigma=math.inf), *fit.states[1:])
    unknown = replace(fit, states=states, flicker_sigma=math.inf)
    write_fitted_decay(tmp_path / "fit.json", unknown)
    assert "Infinity" not in (tmp_path / "fit.json").read_text()
    assert_same(unknown, read_fitted_decay(tmp_path / "fit.json"))


def test_the_covariance_says_whose_it_is(fit: DecayFit) -> None:
    content = fit.to_dict()
    assert content["covariance_parameters"] == [
        "k_r_per_s 1", "amplitude 1", "k_r_per_s 2", "amplitude 2", "offset",
    ]  # fmt: skip
    sigma = dict(
        zip(content["covariance_parameters"], np.sqrt(np.diag(content["covariance"])), strict=True)
    )
    for number, state in enumerate(fit.states, start=1):
        assert sigma[f"k_r_per_s {number}"] == pytest.approx(state.k_r_per_s_sigma)
        assert sigma[f"amplitude {number}"] == pytest.approx(state.amplitude_sigma)
    assert sigma["offset"] == pytest.approx(fit.offset_sigma)


@pytest.mark.parametrize(
    "change",
    [
        {"schema_version": 0},
        {"states": [{"k_r_per_s": "fast"}]},
        {"channel_weights": None},
        {"offsets": {"R": 0.0}},
        {"covariance": [["x"]]},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_damaged_file_is_one_line(fit: DecayFit, tmp_path: Path, change: dict[str, Any]) -> None:
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(fit.to_dict() | change))
    with pytest.raises(DataError, match="expected the fit of a decay") as caught:
        read_fitted_decay(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[]", "{}", "null", "{"])
def test_a_file_of_something_else_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "fit.json"
    path.write_text(text)
    with pytest.raises(DataError, match="make it again"):
        read_fitted_decay(path)


def test_results_go_by_the_names_of_their_folders(fit: DecayFit, tmp_path: Path) -> None:
    assert read_fitted_decays(tmp_path) == {}
    write_fitted_decay(tmp_path / "fit.json", fit)
    assert list(find_fitted_decays(tmp_path)) == [""]
    (tmp_path / "fit.json").unlink()
    for patch in ("left", "right"):
        (tmp_path / patch).mkdir()
        write_fitted_decay(tmp_path / patch / "fit.json", fit)
    assert list(read_fitted_decays(tmp_path)) == ["left", "right"]


def test_amplitudes_in_another_channel(fit: DecayFit) -> None:
    brightest = fit.amplitudes_in(fit.brightest_channel)
    assert [one.value for one in brightest] == [state.amplitude for state in fit.states]
    red = fit.amplitudes_in("R")
    weight = fit.channel_weights[fit.channels.index("R")]
    assert red[0].value == pytest.approx(brightest[0].value * weight)
    assert red[0].sigma > brightest[0].sigma * weight
    assert red[0].unit == "DN/s"
    with pytest.raises(DataError, match="expected the same channels"):
        fit.amplitudes_in("L")


def test_measured_quantities() -> None:
    one, other = Measured(3.0, 0.3, "s"), Measured(2.0, 0.4, "s")
    assert one.sigmas_from(other) == pytest.approx(2.0)
    assert one.over(other).value == 1.5
    assert one.over(other).sigma == pytest.approx(1.5 * math.hypot(0.1, 0.2))
    assert one.over(other).unit == ""
    assert one.times(Measured(2.0, 0.0)) == Measured(6.0, 0.6, "s")
    assert str(Measured(0.0802, 0.0013, "1/s")) == "0.0802(13) 1/s"
    assert math.isnan(one.sigmas_from(Measured(2.0, math.inf)))
    with pytest.raises(ValueError, match="expected two values in s"):
        one.over(Measured(1.0, 0.1, "DN"))


def test_sigma_of_a_law_s_own_parameters_is_that_of_small_changes(fit: DecayFit) -> None:
    """σ of 1/k, τ and p by differences along the covariance's own axes."""
    for law in fit.laws:
        if law.shape in (0.0, 1.0) or law.shape**2 <= law.covariance[2, 2]:
            continue
        lengths, axes = np.linalg.eigh(law.covariance[1:3, 1:3])
        for name, stated in law.parameters.items():
            changes = []
            for length, axis in zip(lengths, axes.T, strict=True):
                by = 1e-4 * np.sqrt(max(length, 0.0)) * axis
                moved = [
                    replace(
                        law,
                        rate_per_s=law.rate_per_s + sign * by[0],
                        shape=law.shape + sign * by[1],
                    )
                    .parameters[name]
                    .value
                    for sign in (-1, 1)
                ]
                changes.append((moved[1] - moved[0]) / 2e-4)
            assert stated.sigma == pytest.approx(float(np.linalg.norm(changes)), rel=1e-3), name
