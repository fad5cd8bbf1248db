"""Intervals of decays, charges and excitations: when they are given, and by which limits."""

from pathlib import Path

import numpy as np
import pytest

from labrig.fit import DecayFit, fit_charge_and_decay, fit_decay
from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.foundation.arrays import FloatArray
from labrig.material import dark_concentration, lit_concentration, read_material
from labrig.results import read_fitted_decay, write_fitted_decay
from labrig.sim.lamp import WAVELENGTH_NM
from tests.fit import truths
from tests.fit.charged_samples import Bench, lvf_windows

T_S: FloatArray = 0.5 + 4.5 * np.arange(40.0)


def fitted(decay: truths.Decay, sigma: float, seed: int = 1, **options: object) -> DecayFit:
    noise = sigma * np.random.default_rng(seed).standard_normal(len(T_S))
    values = truths.exposed(decay, T_S, np.full(len(T_S), 0.5)) + noise
    return fit_decay(T_S, values, sigma, exposure_s=0.5, **options)  # type: ignore[arg-type]


ONE = truths.exponentials((0.02, 1.0))
TWO = truths.exponentials((0.08, 1.0), (0.015, 0.4))


def test_a_state_that_is_well_known_has_its_sigma_only() -> None:
    fit = fitted(ONE, 0.01, n_states=1)
    assert not fit.intervals
    assert "profile" not in str(fit)
    asked = fitted(ONE, 0.01, n_states=1, intervals=True)
    (state,) = fit.states
    interval = asked.intervals["k_r_per_s 1"]
    sigma = state.k_r_per_s_sigma
    assert interval.high_68 - interval.value == pytest.approx(sigma, rel=0.05)
    assert interval.value - interval.low_95 == pytest.approx(1.96 * sigma, rel=0.05)
    assert asked.states == fit.states


def test_a_slow_state_that_is_hardly_known_has_an_interval_by_itself(tmp_path: Path) -> None:
    fit = fitted(TWO, 0.04, n_states=2)
    interval, state = fit.intervals["k_r_per_s 2"], fit.states[1]
    assert interval.value == pytest.approx(state.k_r_per_s)
    lifetime = fit.intervals["lifetime_s 2"]
    assert lifetime.differs_from(state.k_r_per_s_sigma / state.k_r_per_s**2)
    assert lifetime.high_95 == pytest.approx(1 / interval.low_95)
    assert "1/k 2 / s" in str(fit)
    path = tmp_path / "fit.json"
    write_fitted_decay(path, fit)
    assert read_fitted_decay(path).intervals == fit.intervals


def test_an_interval_is_wider_by_the_factor_of_sigma() -> None:
    """σ that are too small by 3 are multiplied, and limits move out with them."""
    noise = 0.03 * np.random.default_rng(3).standard_normal(len(T_S))
    values = truths.exposed(ONE, T_S, np.full(len(T_S), 0.5)) + noise
    right, small = (
        fit_decay(T_S, values, sigma, exposure_s=0.5, n_states=1, intervals=True)
        for sigma in (0.03, 0.01)
    )
    assert small.sigma_factor > 2
    widths = [
        each.intervals["k_r_per_s 1"].high_95 - each.intervals["k_r_per_s 1"].low_95
        for each in (right, small)
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.3)


def test_an_exponential_fitted_by_becquerels_law_has_an_upper_limit_of_its_order() -> None:
    fit = fitted(ONE, 0.02, law="becquerel")
    order, exponent = fit.intervals["kinetic_order"], fit.intervals["exponent"]
    assert order.low_95 == 1.0
    assert order.is_one_sided
    assert 1.0 < order.high_95 < 1.6
    assert np.isinf(exponent.high_95)
    assert exponent.low_95 == pytest.approx(order.high_95 / (order.high_95 - 1))


def test_a_law_that_is_well_known_has_limits_near_its_sigma() -> None:
    fit = fitted(truths.stretched(30.0, 0.6), 0.005, law="stretched", intervals=True)
    law = fit.chosen_law
    assert law is not None
    for name, measured in law.parameters.items():
        interval = fit.intervals[name]
        assert interval.value == pytest.approx(measured.value, rel=1e-3)
        assert interval.high_68 - interval.low_68 == pytest.approx(2 * measured.sigma, rel=0.1)


def charged(order: float, sigma: float) -> tuple[FloatArray, FloatArray]:
    t_s = np.concatenate([np.arange(0.0, 200.0, 4.0), np.geomspace(203.0, 1500.0, 40)])
    level = lit_concentration(0.0, 0.01, 0.05, order, np.minimum(t_s, 200.0))
    level = dark_concentration(level, 0.05, order, np.maximum(t_s - 200, 0.0))
    light = 0.05 * level**order + np.where(t_s < 200, 0.01 * level, 0.0)
    return t_s, light + sigma * np.random.default_rng(4).standard_normal(len(t_s))


def test_an_order_at_its_bound_has_an_upper_limit_and_a_rate_with_two() -> None:
    t_s, light = charged(1.0, 1e-4)
    fit = fit_charge_and_decay(
        t_s, light, 1e-4, light_on_s=0.0, light_off_s=200.0, states=1, order="general"
    )
    assert list(fit.intervals) == ["order 1", "exponent 1"]
    fit = fit_charge_and_decay(
        t_s, light, 1e-4, light_on_s=0.0, light_off_s=200.0, states=1, order="general",
        intervals=True,
    )  # fmt: skip
    order = fit.intervals["order 1"]
    assert order.low_95 == 1.0
    assert 1.0 < order.high_95 < 1.3
    # At an order of 1 it is 1/k.
    lifetime_s = fit.intervals["lifetime_at_off_s 1"]
    assert lifetime_s.low_95 < 20.0 < lifetime_s.high_95
    assert '"interval_95": [\n' in fit.to_json()


RATE, LAMP = 0.03, RelativeSigmas(0.005, 0.01)


def test_rates_of_excitation_have_limits_about_the_truth() -> None:
    bench = Bench(read_material("blue-paint"), seed=3)
    series = [
        bench.series("bare", np.ones((1, len(WAVELENGTH_NM))), (600.0,), shots=4, every_s=25.0),
        bench.series("LVF", lvf_windows(np.array([420.0, 460.0])), (16.0, 128.0), shots=2),
    ]
    plain = fit_excitation(series, [RATE], [1.0], LAMP)
    fit = fit_excitation(series, [RATE], [1.0], LAMP, plain, intervals="all")
    assert not plain.intervals
    (state,), (truth,) = fit.states, bench.material.states
    interval = fit.intervals["k_r_per_s 1"]
    assert interval.low_95 < truth.k_r_per_s < interval.high_95
    assert interval.high_68 - interval.low_68 == pytest.approx(2 * state.k_r_per_s_sigma, rel=0.2)
    for band, k_e in enumerate(truth.k_e_per_s or (), start=1):
        limits = fit.intervals[f"k_e_per_s 1 {band}"]
        assert 0.0 <= limits.low_95 <= limits.value <= limits.high_95
        assert k_e < 1.5 * limits.high_95 + 1e-4
