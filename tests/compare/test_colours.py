"""Colours: their white, three channels against a spectrum, predictions against photographs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from labrig.compare import three_channels
from labrig.compare.figures import spectra_figure
from labrig.compare.glow import compare_glow, glow_of
from labrig.compare.nalbach2017 import TABLE_1, emission
from labrig.compare.residuals import equally_weighted, fits_by_states, residuals
from labrig.compare.viewing import viewing
from labrig.foundation.errors import DataError, UsageError
from labrig.material import Material, State, dark_concentration, read_material
from labrig.optics import (
    CIE_1931,
    CIE_2015,
    CameraResponse,
    Spectrum,
    observer,
    read_camera,
    white_xyz,
)
from labrig.report.figure_style import figure_style
from tests.report.made import AMPLITUDES, RATES, WEIGHTS, decay_series

CAMERA = read_camera("canon_eos_5d_mark_ii")
EYE = observer(CIE_2015)


def spectrum_of(name: str) -> Spectrum:
    found = emission(read_material(name))
    assert found is not None
    return found


def as_the_eye(mixed: NDArray[np.float64]) -> CameraResponse:
    """A camera whose curves are a linear transform of the observer's."""
    return CameraResponse("eye", EYE.wavelength_nm, EYE.functions @ mixed)


def test_whites_are_the_published_ones() -> None:
    eye = observer(CIE_1931)
    np.testing.assert_allclose(white_xyz("D65", eye), [0.9504, 1, 1.0888], atol=3e-4)
    np.testing.assert_allclose(white_xyz("A", eye), [1.0985, 1, 0.3558], atol=3e-4)
    with pytest.raises(UsageError, match="did you mean 'D65'"):
        white_xyz("D66", eye)


mixing = st.lists(st.floats(-1, 1), min_size=9, max_size=9).map(lambda m: np.reshape(m, (3, 3)))


@settings(max_examples=20)
@given(
    mixing.filter(lambda m: abs(np.linalg.det(m)) > 0.05),
    st.sampled_from([*TABLE_1, "double-wide"]),
    st.sampled_from(["D65", "D50", "E"]),
)
def test_a_camera_that_sees_as_the_eye_does_errs_in_nothing(
    mixed: NDArray[np.float64], name: str, white: str
) -> None:
    found = three_channels(spectrum_of(name), as_the_eye(mixed), white)
    assert found.delta_e < 1e-4
    assert found.xyz.max() > 0


def test_another_camera_errs() -> None:
    shifted = as_the_eye(np.eye(3))
    shifted = replace(shifted, wavelength_nm=shifted.wavelength_nm + 10.0)
    assert three_channels(spectrum_of("double-wide"), shifted).delta_e > 1
    assert three_channels(spectrum_of("double-wide"), CAMERA).delta_e > 0.1


def test_what_three_functions_can_make_is_not_missed() -> None:
    made = Spectrum("made", EYE.wavelength_nm, EYE.functions @ np.array([0.2, 0.5, 0.3]))
    assert three_channels(made, CAMERA).missed < 1e-3
    line = Spectrum("line", np.array([530.0, 531.0, 532.0]), np.array([0.0, 1.0, 0.0]))
    assert three_channels(line, CAMERA).missed > 0.9
    with pytest.raises(DataError, match="dark"):
        three_channels(Spectrum("uv", np.array([300.0, 310.0]), np.ones(2)), CAMERA)


def test_spectra_are_drawn_inside_of_their_figure() -> None:
    found = [three_channels(spectrum_of(name), CAMERA) for name in TABLE_1[:4]]
    with figure_style():
        figure = spectra_figure(found)
        figure.canvas.draw()
        width, height = figure.get_size_inches() * figure.dpi
        assert len(figure.axes) == 4
        for axes in figure.axes:
            box = axes.get_tightbbox()
            assert box is not None
            assert 0 <= box.x0 < box.x1 <= width
            assert 0 <= box.y0 < box.y1 <= height


SERIES = decay_series()


def truth() -> NDArray[np.float64]:
    x = np.multiply.outer(SERIES.exposure_s, RATES)
    means = np.exp(-np.multiply.outer(SERIES.t_s, RATES)) * -np.expm1(-x) / x
    return np.asarray(np.multiply.outer(means @ AMPLITUDES, WEIGHTS))


@pytest.mark.parametrize("normalisation", ["all", "each"])
def test_a_prediction_of_the_photographs_themselves_is_exact(normalisation: str) -> None:
    glow = compare_glow(
        SERIES,
        {"same": SERIES.values, "brighter": 1.1 * SERIES.values},
        viewing(CAMERA, "D65", normalisation),
    )
    assert glow.most("same") == pytest.approx(0, abs=1e-9)
    assert glow.mean("brighter") > 0.5
    brightest = (glow.photographed / white_xyz("D65", observer(CIE_1931))).max(axis=1)
    if normalisation == "each":
        np.testing.assert_allclose(brightest, 1.0)
    else:
        assert brightest.max() == pytest.approx(1.0)
        assert brightest[-1] < 0.1


def test_noise_alone_is_reported_as_it_is() -> None:
    glow = compare_glow(SERIES, {"true": truth()}, viewing(CAMERA), flicker=0.007)
    assert glow.mean_noise == pytest.approx(glow.mean("true"), rel=0.35)


def test_a_camera_without_colours_has_none_to_compare() -> None:
    series = decay_series(channels=("L",))
    with pytest.raises(DataError, match="R, G, B"):
        compare_glow(series, {"same": series.values}, viewing(None))
    dark = replace(SERIES, values=-np.ones_like(SERIES.values))
    with pytest.raises(DataError, match="too dim"):
        compare_glow(dark, {"same": dark.values}, viewing(None))


def test_two_states_take_all_that_one_leaves_of_two() -> None:
    exact = replace(SERIES, values=truth())
    fits = fits_by_states(exact, 0.0, equally_weighted)
    found = residuals(exact, fits, "equal")
    assert found.rms[1] == found.last[1] == 1
    assert max(found.rms[2], found.last[2]) < 1e-3
    assert found.supported[2] == 2


def test_the_glow_of_a_kinetic_order_is_the_fall_of_its_concentration() -> None:
    series = decay_series()
    state = State(k_r_per_s=0.3, kinetic_order=1.8, r0=0.4, amplitude=1.0)
    material = Material(name="x", kind="phosphor", states=(state,))
    glow = glow_of(material, series, None)
    ends_s = series.t_s + series.exposure_s
    level, later = (dark_concentration(0.4, 0.3, 1.8, t_s) for t_s in (series.t_s, ends_s))
    expected = level - later
    assert glow[:, 1] / glow[0, 1] == pytest.approx(expected / expected[0], rel=1e-9)
