"""Unweighted least squares: rates, amplitudes and σ are those that NIST certifies."""

from pathlib import Path

import numpy as np
import pytest

import labrig
from labrig.analyse import TableFitOptions, fit_table
from labrig.foundation.errors import FitError, UsageError
from labrig.results import FittedDecay

#: Lanczos3 of the Statistical Reference Datasets of NIST, in the public domain: x is 0, 0.05, ….
LANCZOS3 = """2.5134 2.0443 1.6684 1.3664 1.1232 .92690 .76790 .63890 .53380 .44790 .37760 .31970
.27200 .23250 .19970 .17230 .14930 .13010 .11380 .10000 .08830 .07830 .06980 .06240"""
Y = np.array(LANCZOS3.split(), dtype=np.float64)
X = np.arange(24) / 20
#: Rate and amplitude of each state by falling rate, with standard deviations.
CERTIFIED = np.array(
    [
        [4.9863565084e00, 3.4436403035e-02, 1.5825685901e00, 5.8371576281e-02],
        [2.9515951832e00, 1.0766312506e-01, 8.4400777463e-01, 4.1488663282e-02],
        [9.5498101505e-01, 9.7041624475e-02, 8.6816414977e-02, 1.7197908859e-02],
    ]
)
RESIDUAL = 2.9923229172e-05


def numbers(fit: FittedDecay) -> np.ndarray:
    return np.array(
        [[s.k_r_per_s, s.k_r_per_s_sigma, s.amplitude, s.amplitude_sigma] for s in fit.states]
    )


@pytest.mark.parametrize(("x_scale", "y_scale"), [(1.0, 1.0), (1e-12, 1e12), (1e12, 1e-12)])
def test_certified_digits(x_scale: float, y_scale: float) -> None:
    fit = labrig.fit_decay(X * x_scale, Y * y_scale, "equal", n_states=3)
    expected = CERTIFIED * [1 / x_scale, 1 / x_scale, y_scale, y_scale]
    np.testing.assert_allclose(numbers(fit), expected, rtol=2e-9)
    assert fit.scatter is not None
    assert fit.scatter.constant == pytest.approx(RESIDUAL * y_scale, rel=2e-9)
    assert (fit.scatter.dof, fit.warnings) == (18, ())


def test_a_table_has_them_whatever_its_sigma(tmp_path: Path) -> None:
    path = tmp_path / "lanczos3.csv"
    rows = [f"{y},{x},{0.1 * y}" for x, y in zip(X, Y, strict=True)]
    path.write_text("\n".join(["y,x,y_sigma", *rows]), encoding="utf-8")
    (fitted,) = fit_table(path, TableFitOptions(states=3, weights="equal"))
    np.testing.assert_allclose(numbers(fitted.fit), CERTIFIED, rtol=2e-9)
    np.testing.assert_allclose(fitted.series.sigma, RESIDUAL, rtol=2e-9)
    assert fitted.fit.warnings == ()
    with pytest.raises(UsageError, match=r"--flicker: expected none"):
        fit_table(path, TableFitOptions(weights="equal", flicker="0.7 %"))


def test_exact_values_are_fitted_to_their_last_digits() -> None:
    x = np.arange(40) / 10
    y = np.array([float(f"{v:.8g}") for v in 3 * np.exp(-2 * x) + np.exp(-x / 2) + 1])
    fit = labrig.fit_decay(x, y, "equal", offset_sigma=np.inf)
    assert (fit.n_states, fit.warnings) == (2, ())
    np.testing.assert_allclose(numbers(fit)[:, [0, 2]], [[2.0, 3.0], [0.5, 1.0]], rtol=1e-6)
    assert fit.offset == pytest.approx(1.0, rel=1e-6)


def test_sigma_of_residuals_covers_the_truth() -> None:
    x = np.linspace(0, 5, 40)
    squares = []
    for seed in range(16):
        y = 1e3 * np.exp(-x) + 5 * np.random.default_rng([5, seed]).standard_normal(40)
        state = labrig.fit_decay(x, y, "equal", n_states=1).states[0]
        squares.append(((state.k_r_per_s - 1) / state.k_r_per_s_sigma) ** 2)
    # 16 squares of Student's t with 38 degrees of freedom: 1.06 ± 0.4.
    assert 0.35 < np.mean(squares) < 2.2


def test_another_word_for_sigma_is_refused() -> None:
    with pytest.raises(FitError, match="'equal'"):
        labrig.fit_decay(X, Y, "same")
