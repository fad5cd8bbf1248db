"""σ of values that come without, and of the rates that follow.

Many more cases and seeds: `tests.acceptance.coverage_table_sigma`.
"""

from itertools import product

import numpy as np
import pytest

from labrig.fit import fit_decay
from labrig.foundation.errors import FitError
from tests.acceptance.coverage_table_sigma import DECAYS, NOISES, coverage
from tests.fit import truths
from tests.pulls import assert_sigma_is_right
from tests.warned import codes

T_S = np.linspace(0.5, 200, 60)


@pytest.mark.campaign
def test_sigma_of_values_and_rates_is_right() -> None:
    pulls = []
    for decay, noise in product(("1 state", "2 states"), ("constant", "2000 counts")):
        found = coverage(DECAYS[decay], NOISES[noise], len(T_S), range(100, 125))
        # 60 values of each of 25 seeds: the standard error of the ratio is 2 %.
        assert 0.92 < found.sigma_ratio < 1.1, (decay, noise)
        assert found.refused == 0
        pulls += found.pulls.ravel().tolist()
    assert_sigma_is_right(pulls)


@pytest.mark.parametrize("noise", ["constant", "2000 counts"])
@pytest.mark.parametrize(
    "decay", ["power law", pytest.param("stretched exponential", marks=pytest.mark.campaign)]
)
def test_a_decay_of_another_law_is_not_taken_for_noise(decay: str, noise: str) -> None:
    found = coverage(DECAYS[decay], NOISES[noise], len(T_S), range(100, 110))
    assert 0.9 < found.sigma_ratio < 1.12


@pytest.mark.campaign
def test_rates_of_too_few_states_scatter_by_their_sigma() -> None:
    """Three exponentials in a power law: without the misfit's curvature σ is a third too small."""
    found = coverage(DECAYS["power law"], NOISES["2000 counts"], 100, range(100, 136))
    assert_sigma_is_right(found.pulls)


def test_sigma_does_not_grow_with_the_misfit_of_too_few_states() -> None:
    rng = np.random.default_rng(3)
    values = DECAYS["2 states"].signal(T_S) + 0.003 * rng.normal(size=len(T_S))
    fit = fit_decay(T_S, values, None, n_states=1)
    assert np.median(fit.sigma) == pytest.approx(0.003, rel=0.2)
    assert fit.reduced_chi2 > 50
    assert "residuals-correlated" in codes(fit.warnings)


def test_noise_of_counting_is_told_from_constant_noise() -> None:
    rng = np.random.default_rng(4)
    t_s = np.linspace(0, 200, 400)
    counts = rng.poisson(2000 * np.exp(-0.03 * t_s)).astype(np.float64)
    scatter = fit_decay(t_s, counts, None).scatter
    assert scatter is not None
    assert scatter.at_brightest == pytest.approx(np.sqrt(2000), rel=0.2)
    assert scatter.at_faintest < 5
    assert 380 < scatter.dof < 399


def test_sigma_has_the_unit_of_the_values_and_their_order() -> None:
    rng = np.random.default_rng(5)
    values = truths.exponentials((0.03, 1.0))(T_S) + 0.01 * rng.normal(size=len(T_S))
    fit = fit_decay(T_S, values, None)
    shuffled = rng.permutation(len(T_S))
    other = fit_decay(T_S[shuffled], 1e6 * values[shuffled], None)
    assert other.sigma == pytest.approx(1e6 * fit.sigma[shuffled], rel=1e-6)
    assert other.states[0].k_r_per_s_sigma == pytest.approx(fit.states[0].k_r_per_s_sigma, rel=1e-6)


def test_a_few_values_without_sigma_leave_the_rate_open() -> None:
    fit = fit_decay([0.0, 10.0, 20.0], [1.0, 0.62, 0.35], None)
    assert np.isinf(fit.states[0].k_r_per_s_sigma)
    assert "sigma-from-few-values" in codes(fit.warnings)


def test_flicker_needs_sigma() -> None:
    with pytest.raises(FitError, match="to separate flicker from other noise"):
        fit_decay(T_S, np.exp(-0.03 * T_S), None, flicker=0.007)


def test_exact_values_are_no_misfit_and_their_sigma_an_upper_bound() -> None:
    t_s = np.linspace(0, 200, 100)
    fit = fit_decay(t_s, np.exp(-0.05 * t_s), None)
    assert fit.states[0].k_r_per_s == pytest.approx(0.05, rel=1e-9)
    assert codes(fit.warnings) == ["sigma-upper-bound"]
