"""Decays that other laboratories measured."""

from pathlib import Path

import numpy as np
import pytest

from labrig.fit import fit_decay
from tests.warned import codes, of_code

#: Mean squared weighted residual by the number of states, of an independent fit.
MEAN_SQUARES = {1: 49.6, 2: 3.85, 3: 1.66}


@pytest.mark.parametrize("level", [2, 4])
def test_halves_of_a_time_resolved_luminescence_agree(real_data: Path, level: int) -> None:
    """Every other channel of 0.26 ns; with more light there are two states: the slower one."""
    table = np.genfromtxt(real_data / "trpl_grossmann/sample1.csv", delimiter=",", skip_header=4)
    table = table[(table[:, 0] > 20) & (table[:, 0] < 400)]
    t_s, counts = table[:, 0] * 1e-9, table[:, level]
    even, odd = (
        fit_decay(t_s[half::2], counts[half::2], np.sqrt(np.maximum(counts[half::2], 1)),
                  offset_sigma=np.inf).states[-1]
        for half in (0, 1)
    )  # fmt: skip
    sigma = np.hypot(even.k_r_per_s_sigma, odd.k_r_per_s_sigma)
    assert abs(even.k_r_per_s - odd.k_r_per_s) < 3 * sigma
    assert sigma < 0.05 * even.k_r_per_s


def test_strontium_aluminate(shared_data: Path) -> None:
    """Afterglow of SrAl2O4:Eu,Dy at 524 nm from 1.2 s after the light went off at 330 s."""
    path = shared_data / "decay/perslqy_sao/sample_400_524_300s.txt"
    t, counts = np.genfromtxt(path, skip_header=1, usecols=(0, 1), unpack=True)
    t, counts = t[t >= 331.2] - 330, counts[t >= 331.2]
    for n_states, mean_square in MEAN_SQUARES.items():
        assert_described(t, counts, n_states, mean_square)


def assert_described(t: np.ndarray, counts: np.ndarray, n_states: int, mean_square: float) -> None:
    sigma = np.sqrt(np.maximum(counts, 5))
    fit = fit_decay(t, counts, sigma, n_states=n_states, offset_sigma=np.inf)
    # Every count weighs 1.45: the values scatter more than √counts.
    assert fit.sigma_factor == pytest.approx(1.245, rel=0.01)
    assert fit.sigma_factor**2 * fit.chi2 / len(t) == pytest.approx(mean_square, rel=0.005)
    assert "residuals-correlated" in codes(fit.warnings)
    if n_states < 3:
        assert of_code(fit.warnings, "rates-descriptive").values["delta_bic"] > 0
    if n_states == 2:
        fast, slow = fit.states
        assert fast.k_r_per_s == pytest.approx(0.01046, rel=0.03)
        assert slow.k_r_per_s == pytest.approx(0.00205, rel=0.03)
        assert fast.amplitude == pytest.approx(10851, rel=0.03)
        assert slow.amplitude == pytest.approx(3514, rel=0.03)
        assert fit.offset == pytest.approx(35.6, rel=0.03)


def test_quartz_luminescence_has_three_components(shared_data: Path) -> None:
    path = shared_data / "decay/cran_luminescence/cw_osl_bt607_quartz.csv"
    t, counts = np.genfromtxt(path, skip_header=1, delimiter=",", unpack=True)
    fit = fit_decay(t, counts, np.sqrt(np.maximum(counts, 1)), offset_sigma=np.inf)
    assert fit.n_states == 3
    assert fit.states[0].k_r_per_s > 2
