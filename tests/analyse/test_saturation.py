"""Saturation and the rates after several charges, against the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.acquire import read_rig_file
from labrig.analyse.series_fit import fit_series
from labrig.bench import open_bench
from labrig.foundation.errors import DataError
from labrig.process import process_and_report
from labrig.protocols.saturation.analysis import (
    analyse,
    charge_level,
    charged,
    compare_levels,
    compare_rates,
    growth,
)
from labrig.protocols.saturation.result import Curve, PatchSaturation, SaturationResult
from labrig.results import Measured, Series
from tests.analyse.recorded import part_of
from tests.analyse.small_runs import HALF, SATURATION
from tests.analyse.spectral_bench import record
from tests.results.made import assert_read_back
from tests.warned import codes

T_S = np.arange(1.0, 120.0, 4.0)


def true_level(rig: Path, charge_s: float) -> float:
    with open_bench(read_rig_file(rig), str(rig)) as bench:
        assert bench.room is not None
        room = bench.room.room
        room.switch_lamp(True)
        bench.room.clock.sleep(charge_s)
        room.switch_lamp(False)
        bench.room.clock.sleep(1.0)
        level = room.truth().patches[0].states[0].concentration
    assert level is not None
    return level


def test_two_lights_tell_how_far_a_sample_is_charged(tmp_path: Path) -> None:
    done = process_and_report(record(tmp_path, SATURATION | HALF, seed=2))
    assert isinstance(done.result, SaturationResult)
    (patch,) = done.result.patches.values()
    assert patch.time_saturation == "saturated in time"
    (level,) = patch.levels
    assert abs(level.r - true_level(tmp_path / "rig.yaml", 1200.0)) < 3 * level.sigma
    assert level.sigma < 0.05
    assert level.assessment == "no"
    assert len(patch.curves) == 6
    assert not patch.rates.differ
    assert patch.order is not None
    assert patch.order.verdict == "first order"
    assert "charge-incomplete" in codes(done.result.warnings)
    assert_read_back(done.result)
    given_noise = replace(patch, rates=replace(patch.rates, noise_dof=np.inf))
    assert_read_back(replace(done.result, patches={"sample": given_noise}))
    rows = (done.report.parent / "saturation.csv").read_text().splitlines()
    assert len(rows) == 1 + 6
    time_saturation, of_level, rates, order, *budgets = done.lines
    assert all(line.startswith("budget") for line in budgets)
    assert "saturated in time" in time_saturation
    assert of_level.endswith("assumption r(0) = 1: no")
    assert "rates are the same after all 6 charges" in rates
    assert "no sign of a kinetic order above 1" in order
    assert "order-sample" in done.report.read_text()
    assert "The weaker light was 50 % of the full one (σ 2 % of that)" in done.report.read_text()


@pytest.mark.campaign
def test_a_power_laws_rates_depend_on_the_charge(tmp_path: Path) -> None:
    part = part_of(
        record(tmp_path, SATURATION | {"charges": ["20 s", "60 min"], "for": "150 s"},
               sample="power-law")
    )  # fmt: skip
    result = analyse(part)
    (patch,) = result.patches.values()
    assert patch.time_saturation == "not saturated"
    assert patch.levels == ()
    assert patch.rates.differ
    assert "rates-depend-on-charge" in codes(result.warnings)
    attempts = [attempt for attempt in part.run.attempts if attempt.unit != "full-2"]
    run = replace(part.run, attempts=attempts)
    with pytest.raises(DataError, match="two or more complete decays"):
        analyse(replace(part, run=run))


@given(
    k=st.floats(1e-3, 0.3),
    times=st.floats(0.02, 20.0),
    fraction=st.floats(0.1, 0.8),
    charge_s=st.floats(60.0, 7200.0),
)
def test_the_level_is_what_was_charged(
    k: float, times: float, fraction: float, charge_s: float
) -> None:
    kappa = times * k
    full, weak = charged(kappa, k, charge_s), charged(fraction * kappa, k, charge_s)
    found = charge_level(weak / full, 1e-4, fraction, 0.0, k, (charge_s, charge_s))
    assert found.r == pytest.approx(full, rel=1e-6)
    assert found.sigma > 0


@pytest.mark.parametrize(
    ("ratio", "r", "assessment"), [(0.5, 0.0, "no"), (0.999, 1.0, "yes"), (0.4, 0.0, "no")]
)
def test_ends_of_the_range_are_levels_too(ratio: float, r: float, assessment: str) -> None:
    found = charge_level(ratio, 0.002, 0.5, 0.01, 0.03, (5400.0, 5400.0))
    assert found.r == pytest.approx(r, abs=0.01)
    assert found.assessment == assessment


def decay(rates: list[float], amplitudes: list[float], seed: int) -> Curve:
    t_s = np.arange(1.0, 120.0, 4.0)
    true = np.exp(-np.outer(t_s, rates)) @ np.array(amplitudes)
    sigma = 0.005 * true + 0.001
    noise = sigma * np.random.default_rng(seed).standard_normal(len(t_s))
    return Curve(t_s, np.zeros_like(t_s), true + noise, sigma, 0.0)


def test_p_values_of_rates_that_are_the_same_are_even() -> None:
    p_values = [
        compare_rates(
            [decay([0.05], [1.0], seed), decay([0.05], [0.3], 1000 + seed)], [0.04]
        ).p_value
        for seed in range(60)
    ]
    assert np.quantile(p_values, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.12)


def test_rates_are_not_judged_where_exponentials_do_not_fit() -> None:
    curves = [decay([0.1, 0.01], [1.0, fraction], seed) for seed, fraction in ((0, 0.3), (1, 0.28))]
    test = compare_rates(curves, [0.05])
    assert test.misfit
    assert not compare_rates(curves, [0.1, 0.01]).misfit


def test_noise_that_is_known_badly_is_no_misfit() -> None:
    """Twelve frames tell a flicker to a quarter; one that was found too low is no other law."""
    curves = [decay([0.05], [1.0], seed) for seed in range(6)]
    told_low = [replace(one, sigma=one.sigma / 1.5) for one in curves]
    assert compare_rates(told_low, [0.05]).misfit
    assert not compare_rates(told_low, [0.05], noise_dof=9.0).misfit
    of_two = [decay([0.2, 0.005], [1.0, 0.3], seed) for seed in range(6)]
    assert compare_rates(of_two, [0.05], noise_dof=9.0).misfit


def test_rates_that_differ_by_a_few_per_cent_are_distinguished() -> None:
    curves = [decay([0.05], [1.0], 0), decay([0.053], [0.3], 1)]
    test = compare_rates(curves, [0.04])
    assert test.differ
    assert test.own_per_s[:, 0] == pytest.approx([0.05, 0.053], rel=0.02)


def test_a_state_that_a_decay_lacks_has_no_rate_there() -> None:
    curves = [decay([0.1, 0.01], [1.0, 0.2], 3), decay([0.1, 0.01], [0.001, 0.0], 53)]
    test = compare_rates(curves, [0.1, 0.01])
    assert test.own_per_s[0] == pytest.approx([0.1, 0.01], rel=0.1)
    lacking = np.isnan(test.own_per_s)
    assert lacking[1].any()
    assert not lacking[0].any()
    assert (np.isinf(test.own_sigma_per_s) == lacking).all()
    assert (test.own_sigma_per_s > 0).all()


def series_of(curve: Curve) -> Series:
    one, text = np.ones(len(curve.t_s)), ("",) * len(curve.t_s)
    value, sigma = curve.value[:, None], curve.sigma[:, None]
    return Series(curve.t_s, one, value, sigma, np.zeros(1), ("G",), one, one, text, text, text)


def judged(curves: list[Curve], rates: list[float]) -> PatchSaturation:
    """Compare decays as an analysis does, the last one fitted with as many states as rates."""
    none = Measured(0.0, 0.01)
    return PatchSaturation(
        fit_series(series_of(curves[-1]), len(rates)),
        ("full",) * len(curves), np.ones(len(curves)),
        {str(number): curve for number, curve in enumerate(curves)},
        compare_rates(curves, rates), none, none, (), compare_levels(curves),
    )  # fmt: skip


def power_law(seed: int, scale: float) -> Curve:
    """Twelve frames at times of their own, as a run takes them against a lamp that beats."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(1.0, 60.0, 5.0) + rng.uniform(0.0, 4.0, 12)
    true = scale * (1 + t_s / 15) ** -1.3
    sigma = 0.004 * true + 1e-4
    noise = sigma * rng.standard_normal(12)
    return Curve(t_s, np.zeros_like(t_s), true + noise, sigma, 0.0)


def test_growth_is_right_whatever_the_times_of_the_frames() -> None:
    """Power laws, which the fit of two exponentials does not assume."""
    pulls = []
    for seed in range(100):
        before, last = power_law(seed, 1.0), power_law(1000 + seed, 1.03)
        fit = fit_series(series_of(last), 2)
        found = [growth(before, last, fit, at_end=at_end) for at_end in (False, True)]
        pulls.append([(one.value - 0.03) / one.sigma for one in found])
    assert np.mean(pulls, axis=0) == pytest.approx([0.0, 0.0], abs=0.3)
    assert np.std(pulls, axis=0) == pytest.approx([1.0, 1.0], abs=0.2)


def test_a_fall_that_no_law_describes_is_told() -> None:
    """A shape that lasts the longer the less it was charged, but bent otherwise than an order's."""
    curves = []
    for seed, (light, rate) in enumerate(((1.0, 0.08), (0.3, 0.05), (0.1, 0.03))):
        true = light * np.exp(-((rate * T_S) ** 1.3))
        sigma = 0.005 * true + 1e-4
        noise = sigma * np.random.default_rng(seed).standard_normal(len(T_S))
        curves.append(Curve(T_S, np.zeros_like(T_S), true + noise, sigma, 0.0))
    found = judged(curves, [0.05])
    assert found.order is not None
    assert found.order.verdict == "neither"
    assert found.is_of_no_law


def test_two_states_that_are_filled_unequally_are_a_law() -> None:
    curves = [
        decay([0.1, 0.01], amplitudes, seed)
        for seed, amplitudes in enumerate(([1.0, 0.2], [0.5, 0.19], [0.2, 0.15]))
    ]
    found = judged(curves, [0.08, 0.02])
    assert found.order is not None
    order = replace(found.order, shift=Measured(-0.3, 0.01), difference_sigma=0.02)
    assert order.verdict == "neither"
    assert not replace(found, order=order).is_of_no_law
    one = replace(found.fit, states=found.fit.states[:1])
    assert replace(found, order=order, fit=one).is_of_no_law


def test_two_states_that_are_filled_unequally_are_no_order() -> None:
    """The rate at lamp off may shift with the charge as an order of that shape would have it."""
    curves = [
        decay([0.1, 0.01], amplitudes, seed)
        for seed, amplitudes in enumerate(([1.0, 0.2], [0.5, 0.19], [0.2, 0.15]))
    ]
    found = judged(curves, [0.08, 0.02])
    assert found.order is not None
    alike = replace(found.order, shift=Measured(found.order.shape.value, 0.01))
    assert alike.verdict == "general order"
    assert not replace(found, order=alike).is_of_general_order


def test_a_state_of_general_order_is_told_beside_many_exponentials() -> None:
    curves = []
    for seed, light in enumerate((1.0, 0.3, 0.1)):
        true = light / (1 + 0.05 * np.sqrt(light) * T_S) ** 2
        sigma = 0.005 * true + 1e-4
        noise = sigma * np.random.default_rng(seed).standard_normal(len(T_S))
        curves.append(Curve(T_S, np.zeros_like(T_S), true + noise, sigma, 0.0))
    found = judged(curves, [0.1, 0.03])
    assert found.is_of_general_order


def test_amplitudes_of_two_states_change_without_their_rates() -> None:
    curves = [decay([0.1, 0.01], [1.0, 0.2], 0), decay([0.1, 0.01], [0.5, 0.19], 1)]
    test = compare_rates(curves, [0.08, 0.02])
    assert not test.differ
    assert test.shared_per_s == pytest.approx([0.1, 0.01], rel=0.05)
    assert test.amplitude == pytest.approx(np.array([[1.0, 0.2], [0.5, 0.19]]), rel=0.05)
