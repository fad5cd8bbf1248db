"""A variable filter: bands, positions, and what a camera sees through it."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.optics import (
    Bands,
    Lvf,
    Spectrum,
    WavelengthMap,
    nominal_lvf,
    read_camera,
    signal_through,
)
from labrig.optics.lvf import peak_shape

BENT = WavelengthMap(np.array([550.0, -170.0, 6.0]), (0.0, 800.0), np.diag([0.01, 0.04, 0.09]))


@given(fwhm=st.floats(5, 60), skew=st.floats(-0.8, 0.8))
def test_the_width_at_half_height_is_the_width(fwhm: float, skew: float) -> None:
    x = np.linspace(-120, 120, 240_001)
    shape = peak_shape(x, fwhm, skew)
    above = x[shape >= 0.5]
    assert np.ptp(above) == pytest.approx(fwhm, abs=0.003)
    assert shape.max() == pytest.approx(1.0)
    assert abs(x[shape.argmax()]) < 0.002
    if abs(skew) > 0.01:
        assert np.sign(above[0] + above[-1]) == np.sign(skew)


@given(wavelength_nm=st.floats(390.0, 720.0))
def test_the_map_goes_both_ways(wavelength_nm: float) -> None:
    position = BENT.position(wavelength_nm)
    assert BENT.wavelength_nm(position)[0] == pytest.approx(wavelength_nm, abs=1e-9)


def test_the_map_says_how_well_it_is_known() -> None:
    middle, end = BENT.sigma_nm([400.0, 800.0])
    assert middle == pytest.approx(0.1)
    assert end == pytest.approx(np.sqrt(0.14))
    assert not BENT.rising
    with pytest.raises(ValueError, match="which the strip shows"):
        BENT.position(730.0)
    with pytest.raises(ValueError, match="does not rise or fall"):
        WavelengthMap(np.array([550.0, 10.0, 80.0]), (0.0, 1.0))


def test_a_narrow_line_draws_the_band() -> None:
    lvf = nominal_lvf(BENT, np.arange(400.0, 701.0, 2.0), leakage=0.01)
    line = Spectrum("line", np.array([549.9, 550.0, 550.1]), np.array([0.0, 10.0, 0.0]))
    camera = read_camera("canon_eos_5d_mark_ii")
    seen = signal_through(lvf, camera, line)
    assert seen.shape == (151, 3)
    drawn = seen[:, 1] / camera.at([550.0])[0, 1]
    np.testing.assert_allclose(drawn, lvf.transmission(np.array([550.0]))[:, 0], rtol=1e-3)
    assert drawn[0] == pytest.approx(0.01, rel=0.01)


def test_positions_in_between() -> None:
    lvf = nominal_lvf(BENT, np.arange(400.0, 701.0, 10.0))
    half = (lvf.position[4] + lvf.position[5]) / 2
    between = lvf.at([half, lvf.position[7]])
    assert between.bands.centre_nm[0] == pytest.approx(BENT.wavelength_nm(half)[0], abs=0.01)
    assert between.bands.centre_nm[1] == lvf.bands.centre_nm[7]
    with pytest.raises(ValueError, match="where the filter is known"):
        lvf.at([0.0, 10.0])


def test_a_filter_that_goes_to_and_fro_is_refused() -> None:
    three = np.ones(3)
    centres = np.array([400.0, 500.0, 450.0])
    with pytest.raises(ValueError, match="rise or fall along the filter"):
        Lvf(np.arange(3.0), Bands(centres, 25 * three, 0 * three, three, 0 * three))


@pytest.mark.parametrize("skew", [0.0, 0.3])
def test_light_that_passes_twice_is_squared(skew: float) -> None:
    one = np.ones(3)
    bands = Bands(np.array([450.0, 550.0, 650.0]), 25 * one, skew * one, 0.5 * one, 1e-3 * one)
    lvf = Lvf(np.array([0.0, 0.5, 1.0]), bands)
    nm = np.arange(400.0, 701.0, 5.0)
    np.testing.assert_allclose(lvf.twice().transmission(nm), lvf.transmission(nm) ** 2, atol=1e-12)
    # The bands alone are already the square, but for what leaks beside them.
    np.testing.assert_allclose(
        lvf.twice().bands.transmission(nm), lvf.transmission(nm) ** 2, atol=2e-3
    )
