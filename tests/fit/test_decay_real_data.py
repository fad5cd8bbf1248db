"""Decays that other laboratories measured (../shared/data/README.md)."""

from pathlib import Path

import numpy as np
import pytest

from labrig.fit import fit_decay

DECAYS = Path(__file__).parents[3] / "shared" / "data" / "decay"
pytestmark = [
    pytest.mark.shared_data,
    pytest.mark.skipif(not DECAYS.is_dir(), reason="no ../shared/data beside the checkout"),
]


def _strontium_aluminate() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Afterglow of SrAl2O4:Eu,Dy at 524 nm from 1.2 s after the light went off at 330 s."""
    path = DECAYS / "perslqy_sao" / "sample_400_524_300s.txt"
    t, counts = np.genfromtxt(path, skip_header=1, usecols=(0, 1), unpack=True)
    after = t >= 331.2
    return t[after] - 330, counts[after], np.sqrt(np.maximum(counts[after], 5))


@pytest.mark.parametrize(("n_states", "mean_square"), [(1, 49.6), (2, 3.85), (3, 1.66)])
def test_strontium_aluminate(n_states: int, mean_square: float) -> None:
    t, counts, sigma = _strontium_aluminate()
    fit = fit_decay(t, counts, sigma, n_states=n_states, offset_sigma=np.inf)
    # Every count weighs 1.45: the values scatter more than √counts.
    assert fit.sigma_factor == pytest.approx(1.245, rel=0.01)
    assert fit.sigma_factor**2 * fit.chi2 / len(t) == pytest.approx(mean_square, rel=0.005)
    assert any("not describe this decay" in line for line in fit.warnings)
    if n_states < 3:
        assert any("describes this decay better" in line for line in fit.warnings)
    if n_states == 2:
        fast, slow = fit.states
        assert fast.k_r_per_s == pytest.approx(0.01046, rel=0.03)
        assert slow.k_r_per_s == pytest.approx(0.00205, rel=0.03)
        assert fast.amplitude == pytest.approx(10851, rel=0.03)
        assert slow.amplitude == pytest.approx(3514, rel=0.03)
        assert fit.offset == pytest.approx(35.6, rel=0.03)


def test_quartz_luminescence_has_three_components() -> None:
    path = DECAYS / "cran_luminescence" / "cw_osl_bt607_quartz.csv"
    t, counts = np.genfromtxt(path, skip_header=1, delimiter=",", unpack=True)
    fit = fit_decay(t, counts, np.sqrt(np.maximum(counts, 1)), offset_sigma=np.inf)
    assert fit.n_states == 3
    assert fit.states[0].k_r_per_s > 2
