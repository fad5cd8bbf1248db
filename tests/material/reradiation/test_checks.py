"""A matrix that no surface has is refused in one line; one that few have gets a warning."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.foundation.errors import DataError
from labrig.material import ReradiationMatrix, physical_warnings, with_sigma
from tests.material.reradiation import bfc450
from tests.material.reradiation.synthetic import (
    BRIGHTENER,
    ORANGE,
    YELLOW,
    measurement,
)
from tests.warned import of_code


def bright(total: float, sigma: float | None = None) -> ReradiationMatrix:
    """A sample that returns this part of the light at 460 nm, half of it re-radiated."""
    truth = measurement(0, YELLOW).truth
    column = truth.reradiation.copy()
    column[:, 16] *= total / 2 / (column[:, 16].sum() * 10)
    reflectance = np.full(41, 0.4)
    reflectance[8] = total / 2
    bare = replace(truth, name="glow", reflectance=reflectance, reradiation=column)
    if sigma is None:
        return bare
    sigmas = np.zeros(column.shape)
    sigmas[20, 16] = sigma / 10
    return replace(bare, reradiation_sigma=sigmas)


def dark(value: float, sigma: float = 0.0) -> ReradiationMatrix:
    truth = measurement(0, YELLOW).truth
    reflectance, sigmas = np.full(41, 0.3), np.full(41, sigma)
    reflectance[3] = value
    return replace(truth, name="soot", reflectance=reflectance, reflectance_sigma=sigmas)


def test_a_usual_sample_has_no_warnings() -> None:
    assert physical_warnings(bright(0.99)) == ()
    for dyes in ((), (YELLOW,), (BRIGHTENER, ORANGE)):
        assert physical_warnings(with_sigma(measurement(7, *dyes).measured)) == ()


def test_more_than_a_perfect_white_is_said_with_its_wavelength() -> None:
    (warning,) = physical_warnings(bright(1.05))
    assert warning.code == "more-than-white"
    assert warning.values == {
        "fraction": pytest.approx(1.05),
        "input_nm": pytest.approx(460),
        "material": "glow",
    }


@pytest.mark.parametrize(("total", "sigma"), [(1.09, None), (1.12, 0.01), (1.39, 0.1)])
def test_up_to_the_limit_and_its_sigma_is_only_said(total: float, sigma: float | None) -> None:
    assert len(physical_warnings(bright(total, sigma))) == 1


@pytest.mark.parametrize(("total", "sigma"), [(1.11, None), (1.14, 0.01), (1.41, 0.1)])
def test_beyond_the_limit_is_refused(total: float, sigma: float | None) -> None:
    with pytest.raises(
        DataError, match=rf"460 nm .* 'glow', got {total:.3f} ± .*percent$"
    ) as caught:
        physical_warnings(bright(total, sigma))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("value", "sigma"), [(-0.019, 0.0), (-0.049, 0.01), (np.nan, 0.0)])
def test_slightly_negative_or_unknown_reflectance_passes(value: float, sigma: float) -> None:
    assert physical_warnings(dark(value, sigma)) == ()


@pytest.mark.parametrize(("value", "sigma"), [(-0.021, 0.0), (-0.051, 0.01)])
def test_negative_reflectance_is_refused(value: float, sigma: float) -> None:
    with pytest.raises(DataError, match=rf"'soot' .* got {value:.4f} ± {sigma:.4f} at 410 nm"):
        physical_warnings(dark(value, sigma))


def test_a_sample_without_reflectance_is_judged_by_its_re_radiation() -> None:
    truth = replace(measurement(0, YELLOW).truth, reflectance=np.full(41, np.nan))
    assert physical_warnings(truth) == ()


@pytest.mark.usefixtures("shared_data")
def test_real_samples_pass_and_two_golf_balls_are_said() -> None:
    warnings = {sample.name: physical_warnings(sample) for sample in bfc450.samples()}
    assert len(warnings) == 97
    assert {name for name, each in warnings.items() if each} == {"GOLF", "GOLFYE"}
    yellow = of_code(warnings["GOLFYE"], "more-than-white").values
    assert yellow["fraction"] == pytest.approx(1.068, abs=0.0005)
    assert yellow["input_nm"] == 540
