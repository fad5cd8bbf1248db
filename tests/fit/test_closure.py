"""Closure: charging predicted from rates per band against charging itself."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from labrig.fit.excitation import closure
from labrig.foundation.errors import DataError
from labrig.protocols.excitation.report import closure_picture
from labrig.report import figure_style

CHARGES_S = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0])
LAMP: dict[str, Any] = {
    "irradiance": np.array([0.3, 0.6, 0.74]),
    "k_e_per_s": np.array([[0.02, 0.05, 0.004], [0.1, 0.03, 0.01]]),
    "k_r_per_s": np.array([0.03, 0.2]),
    "full_level": np.array([1000.0, 2000.0]),
    "r0": np.array([0.05, 0.0]),
    "dark_s": 0.6,
    "exposure_s": 2.0,
}


def charged() -> NDArray[np.float64]:
    """Levels by an integrator that does not know the exact steps."""
    kappa = LAMP["k_e_per_s"] @ LAMP["irradiance"]
    levels = []
    for charge_s in CHARGES_S:
        on = solve_ivp(
            lambda _, r: (1 - r) * kappa - LAMP["k_r_per_s"] * r,
            (0, charge_s),
            LAMP["r0"],
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
        )
        t_s = LAMP["dark_s"] + np.linspace(0, LAMP["exposure_s"], 2001)
        glow = (on.y[:, -1] * LAMP["full_level"]) @ np.exp(-np.outer(LAMP["k_r_per_s"], t_s))
        levels.append(np.trapezoid(glow, t_s) / LAMP["exposure_s"])
    return np.array(levels)


LEVELS = charged()


def test_it_predicts_what_an_integrator_finds() -> None:
    closed = closure(CHARGES_S, LEVELS, np.ones(8), **LAMP)
    np.testing.assert_allclose(closed.predicted, LEVELS, rtol=1e-6)
    assert closed.rms_percent < 1e-4


def test_deviations_are_reported_in_percent_and_sigma() -> None:
    closed = closure(CHARGES_S, 1.05 * LEVELS, 0.05 * LEVELS, **LAMP)
    assert closed.rms_percent == pytest.approx(5.0, rel=1e-4)
    assert closed.rms_sigma == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("charges", [CHARGES_S, CHARGES_S + 60.0, CHARGES_S[:1]])
def test_its_picture_is_labelled_and_inside(charges: NDArray[np.float64]) -> None:
    closed = closure(charges, LEVELS[: len(charges)], np.ones(len(charges)), **LAMP)
    picture = closure_picture(closed)
    assert f"{closed.rms_percent:.2g} %" in picture.caption
    with figure_style():
        figure = picture.figure()
    figure.canvas.draw()
    width, height = figure.get_size_inches() * figure.dpi
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box is not None
        assert axes.get_ylabel()
        assert 0 <= box.x0 < box.x1 <= width
        assert 0 <= box.y0 < box.y1 <= height
    assert figure.axes[-1].get_xlabel() == "Charge / s"


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"sigma": np.zeros(8)}, "σ above 0"),
        ({"level": LEVELS[:3]}, "as many levels"),
        ({"level": np.full(8, np.nan)}, "finite"),
        ({"k_e_per_s": np.ones((2, 2))}, "k_e of shape (2, 3)"),
    ],
)
def test_what_does_not_fit_is_one_clear_line(changed: dict[str, Any], said: str) -> None:
    given = {"charge_s": CHARGES_S, "level": LEVELS, "sigma": np.ones(8)} | LAMP | changed
    with pytest.raises(DataError) as caught:
        closure(**given)
    assert said in str(caught.value)
