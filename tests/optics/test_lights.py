"""Lights by name, wavelength or file."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.foundation import colour_science
from labrig.foundation.errors import UsageError
from labrig.optics import CIE_1931, illuminant, is_narrow, lab, observer, read_light


def test_illuminants_are_those_of_the_cie() -> None:
    assert_allclose(read_light("A").at([560.0, 300.0]), [100, 0.930483], rtol=1e-6)
    assert_allclose(illuminant("D65").at([300.0, 780.0]), [0.0341, 63.3828], rtol=1e-3)


def test_what_is_labrigs_own_is_that_of_colour_science() -> None:
    colour = colour_science.load()
    for name in ("D65", "A"):
        theirs = colour.SDS_ILLUMINANTS[name]
        assert_allclose(illuminant(name).wavelength_nm, theirs.wavelengths, rtol=0)
        assert_allclose(illuminant(name).value, theirs.values, rtol=0)
    functions = colour.MSDS_CMFS[CIE_1931]
    assert_allclose(observer(CIE_1931).functions, functions.values, rtol=1e-9)
    white = np.array([0.95, 1.0, 1.09])
    xyz = np.random.default_rng(1).uniform(0, 1.2, (200, 3)) ** 4
    expected = colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white))
    assert_allclose(lab(xyz, white), expected, atol=1e-9)


def test_a_wavelength_is_a_narrow_light() -> None:
    light = read_light("452.5 nm")
    assert_allclose(np.trapezoid(light.value, light.wavelength_nm), 10)
    assert_allclose(np.average(light.wavelength_nm, weights=light.value), 452.5)
    assert is_narrow(light)
    assert not is_narrow(read_light("D65"))


def test_a_file_is_a_light(tmp_path: Path) -> None:
    path = tmp_path / "led.csv"
    path.write_text("wavelength_nm,value\n440,0\n450,2\n470,0\n")
    assert read_light(path).at([460.0]) == [1.0]


@pytest.mark.parametrize(
    ("name", "message"),
    [("D66", "D65"), ("50nm", "200 nm"), ("missing.csv", "no such file"), ("", "illuminant")],
)
def test_what_is_no_light_is_refused(name: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        read_light(name)
