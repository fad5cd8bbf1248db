"""Charge and decay fitted together: known states, their σ, and real data."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labrig.fit import ChargeFit, fit_charge_and_decay
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.results import OneSided
from tests.pulls import assert_sigma_is_right
from tests.warned import codes, of_code

ON_S, OFF_S = 20.0, 220.0
T_S = np.concatenate([np.arange(0.0, 400.0, 1.0), np.geomspace(400.0, 3000.0, 200)])


def growth(_: float, r: FloatArray, kappa: float, k: float, b: float) -> FloatArray:
    return np.asarray((1 - r) * kappa - k * np.maximum(r, 0) ** b)


def light(
    states: list[tuple[float, float, float, float]],
    stimulated: float = 1.0,
    prompt: float = 0.0,
    t_s: FloatArray = T_S,
) -> FloatArray:
    """Λ (k rᵇ + η κ r) of states (κ, k, b, Λ), integrated as it stands."""
    total = np.where((t_s >= ON_S) & (t_s < OFF_S), prompt, 0.0)
    for kappa, k, b, reradiation in states:
        start = np.zeros(1)
        for begin, end, lamp in ((ON_S, OFF_S, kappa), (OFF_S, t_s[-1] + 1, 0.0)):
            own = (t_s >= begin) & (t_s < end)
            solved = solve_ivp(
                growth, (begin, end), start, args=(lamp, k, b), t_eval=[*t_s[own], end],
                rtol=1e-9, atol=1e-12, method="LSODA",
            )  # fmt: skip
            r = np.maximum(solved.y[0, :-1], 0.0)
            total[own] += reradiation * (k * r**b + stimulated * lamp * r)
            start = solved.y[:, -1]
    return total


def fitted(values: FloatArray, sigma: FloatArray | float | None, **options: object) -> ChargeFit:
    return fit_charge_and_decay(
        T_S, values, sigma, light_on_s=ON_S, light_off_s=OFF_S, **options  # type: ignore[arg-type]
    )  # fmt: skip


@pytest.mark.campaign
def test_a_state_that_saturates_is_known_with_its_sigma() -> None:
    kappa, k, b, noise = 0.012, 0.03, 1.6, 0.3
    t_s = np.concatenate(
        [np.arange(0.0, 20, 2), np.arange(22.0, 218, 5), np.geomspace(223.0, 3000, 40)]
    )
    truth = light([(kappa, k, b, 4e4)], prompt=30.0, t_s=t_s)
    pulls = []
    for seed in range(100, 160):
        values = truth + noise * np.random.default_rng(seed).standard_normal(len(t_s))
        fit = fit_charge_and_decay(
            t_s, values, noise, light_on_s=ON_S, light_off_s=OFF_S, states=1, order="general"
        )
        (state,) = fit.states
        assert state.kappa_per_s is not None
        assert state.k_r_per_s is not None
        assert fit.warnings == ()
        told = (state.order, state.kappa_per_s, state.k_r_per_s, fit.prompt, fit.dark)
        true = (b, kappa, k, 30.0, 0.0)
        pulls.append([(m.value - x) / m.sigma for m, x in zip(told, true, strict=True)])
    assert np.mean(pulls, axis=0) == pytest.approx(np.zeros(5), abs=3.5 / np.sqrt(60))
    assert_sigma_is_right(pulls)


def test_first_order_stays_first_order() -> None:
    truth = light([(0.01, 0.02, 1.0, 3e4)], stimulated=0.0)
    for seed in range(1):
        values = truth + np.random.default_rng(seed).standard_normal(len(truth))
        fit = fitted(values, 1.0, light_stimulated=0.0)
        assert fit.candidates[fit.chosen].label == "1 state of first order"
        assert fit.states[0].exponent is None
        assert fit.states[0].decay_time_s is not None
        assert fit.states[0].decay_time_s.value == pytest.approx(50.0, rel=0.01)


@pytest.mark.campaign
def test_two_states_of_general_order() -> None:
    truth = light([(0.004, 0.2, 1.8, 2e4), (0.001, 0.004, 1.3, 2e4)], prompt=10.0)
    noise = np.random.default_rng(3).standard_normal(len(truth))
    fit = fitted(truth + 0.1 * noise, 0.1)
    assert fit.candidates[fit.chosen].label == "2 states of general order"
    assert [state.order.value for state in fit.states] == pytest.approx([1.8, 1.3], abs=0.06)
    assert fit.chi2_charge == pytest.approx(1.0, abs=0.3)


def test_a_state_of_first_order_and_one_of_second_keep_their_places() -> None:
    """The rate at lamp off orders them: τ of an order near 1 is without end."""
    t_s = np.concatenate(
        [np.arange(0.0, 20, 2), np.arange(22.0, 218, 5), np.geomspace(223, 900, 80)]
    )
    truth = light([(0.02, 0.08, 1.0, 1500.0), (0.01, 0.02, 2.0, 5000.0)], t_s=t_s)
    held = []
    for seed in range(4):
        noise = np.random.default_rng(seed).standard_normal(len(t_s))
        fit = fit_charge_and_decay(
            t_s, truth + 0.05 * noise, 0.05, light_on_s=ON_S, light_off_s=OFF_S, states=2,
            order="general",
        )  # fmt: skip
        first, second = fit.states
        assert (first.order.value < 1.3, second.order.value > 1.7) == (True, True)
        rate = first.rate_at_off_per_s
        assert abs(rate.value - 0.08) < 4 * rate.sigma < 0.03
        assert (first.exponent is None) == (first.decay_time_s is None)
        if first.order.value == 1:
            held.append(first.order)
            assert "< 1." in str(fit)
    assert 0 < len(held) < 4
    for order in held:
        assert isinstance(order, OneSided)
        assert 0 < order.limit - 1 < 0.2
        assert order.sigma > 0


def test_without_saturation_only_the_decay_is_told() -> None:
    truth = light([(2e-5, 40.0, 2.0, 1e7)])
    values = truth + 0.2 * np.random.default_rng(5).standard_normal(len(truth))
    fit = fitted(values, 0.2, states=1, order="general")
    (state,) = fit.states
    assert (state.kappa_per_s, state.k_r_per_s, state.r0) == (None, None, None)
    assert state.exponent is not None
    assert abs(state.exponent.value - 2.0) < 4 * state.exponent.sigma < 0.2
    assert "charge-unsaturated" in codes(fit.warnings)


def test_counts_tell_their_sigma() -> None:
    truth = light([(0.012, 0.03, 1.6, 4e5)]) + 40.0
    counts = 1.4 * np.random.default_rng(2).poisson(truth / 1.4)
    fit = fitted(counts.astype(float), None, states=1)
    assert fit.chi2_decay == pytest.approx(1.0, abs=0.3)
    assert fit.states[0].order.value == pytest.approx(1.6, abs=0.05)
    assert fit.dark.value == pytest.approx(40.0, abs=4 * fit.dark.sigma)


def test_a_model_that_misses_the_light_says_so() -> None:
    """A trap with retrapping: neither its charge nor its decay is of general order."""
    n, step, course = 0.0, 0.05, []
    for t_s in np.arange(0.0, 1000.0, step):
        lamp = 0.006 if ON_S <= t_s < OFF_S else 0.0
        trapped = 0.05 * (1 - n) / (0.05 * (1 - n) + n) if n + lamp > 0 else 0.0
        free = lamp + 0.03 * n
        course.append(1e4 * free * (1 - trapped))
        n += step * (free * trapped - 0.03 * n)
    t_s = np.arange(0.0, 1000.0, 1.0)
    values = np.array(course)[:: int(1 / step)]
    values = values + 0.1 * np.random.default_rng(0).standard_normal(len(values))
    fit = fit_charge_and_decay(t_s, values, 0.1, light_on_s=ON_S, light_off_s=OFF_S, states=1)
    assert fit.misfit > 2
    warned = of_code(fit.warnings, "model-misfit").values
    assert warned["factor"] == pytest.approx(fit.misfit**0.5)
    assert warned["chi2_charge"] == fit.chi2_charge
    assert warned["chi2_decay"] == fit.chi2_decay


@pytest.mark.parametrize(
    ("t_s", "values", "sigma", "light_s", "said"),
    [
        (T_S, np.ones_like(T_S), 1.0, (220.0, 20.0), "lamp off after it was on"),
        (T_S, np.ones_like(T_S), 1.0, (4000.0, 5000.0), "got 0 and 0"),
        (T_S, np.full_like(T_S, np.nan), 1.0, (20.0, 220.0), "expected finite values"),
        (T_S, np.sin(T_S), 1.0, (20.0, 220.0), "none above the noise"),
        (T_S, np.ones_like(T_S), 0.0, (20.0, 220.0), "expected σ > 0"),
        (T_S, np.ones_like(T_S), None, (20.0, 220.0), "give their σ"),
        (T_S[:5], np.ones_like(T_S), 1.0, (20.0, 220.0), "one value for each time"),
        (np.zeros_like(T_S), np.ones_like(T_S), 1.0, (20.0, 220.0), "different times"),
    ],
)
def test_bad_readings_are_refused(
    t_s: FloatArray,
    values: FloatArray,
    sigma: float | None,
    light_s: tuple[float, float],
    said: str,
) -> None:
    with pytest.raises(FitError, match=said):
        fit_charge_and_decay(t_s, values, sigma, light_on_s=light_s[0], light_off_s=light_s[1])


def test_strontium_aluminate(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Profiles of the orders and rates take three quarters of the time.
    monkeypatch.setattr("labrig.fit.charge.fit.charge_intervals", lambda *_, **__: {})
    table = shared_data / "decay/perslqy_sao/sample_400_524_300s.txt"
    t_s, counts = np.genfromtxt(table, skip_header=1, usecols=(0, 1), unpack=True)
    fit = fit_charge_and_decay(t_s, counts, None, light_on_s=30.0, light_off_s=330.0)
    assert fit.candidates[fit.chosen].label == "2 states of general order"
    assert fit.chi2_charge < 2.6
    assert fit.chi2_decay < 1.3
    assert 1.6 < fit.states[0].order.value < 1.9
    # The charge is still missed by more than noise, and does not saturate.
    assert fit.misfit > 1
    assert fit.states[0].kappa_per_s is None
