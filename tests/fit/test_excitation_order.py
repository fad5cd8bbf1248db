"""Excitation of samples of general kinetic order, charged by an integrator."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.analyse import chosen_options
from labrig.fit.excitation import RelativeSigmas, closure, fit_excitation, levels_at_off
from labrig.fit.excitation.levels import levels
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import becquerel_of, read_material
from labrig.protocols.excitation.analysis.closure import predicted_charging
from labrig.protocols.excitation.analysis.orders import OrderFits
from labrig.protocols.excitation.options import ExcitationOptions
from labrig.protocols.excitation.result import PatchCharging
from labrig.results import Charge, ChargingSeries, Closure, EarlierCharges, FittedExcitation, Series
from labrig.sim.kinetics import KineticsSettings
from labrig.sim.simulation import LampSettings
from tests.fit.charged_samples import BARE, LVF, Bench, lvf_windows, two_states
from tests.results.made import decay_result
from tests.warned import codes

UNCERTAIN = RelativeSigmas(0.005, 0.01)
B = 1.5


def bench(order: float, irradiance: float = 4.0, seed: int = 1) -> Bench:
    kinetics = None if order == 1 else KineticsSettings(model="general_order", order=order)
    return Bench(read_material("blue-paint"), irradiance=irradiance, kinetics=kinetics, seed=seed)


def measured(sample: Bench) -> list[ChargingSeries]:
    """The bare lamp first: its irradiance is E."""
    bare = sample.series("bare lamp", BARE, (900.0,), shots=10, every_s=15.0)
    return [bare, sample.series("through LVF", LVF, (8.0, 64.0, 256.0), shots=5)]


def fitted(series: list[ChargingSeries], order: float | None) -> FittedExcitation:
    """From the fit of first order, which is quick."""
    near = fit_excitation(series, [0.03], [1.0], UNCERTAIN)
    return fit_excitation(series, [0.03], [1.0], UNCERTAIN, near, order)


def test_the_first_order_is_that_of_the_affine_steps() -> None:
    series = Bench(two_states()).series("LVF", LVF, (8.0, 64.0), wait_s=60.0, shots=3)
    series = replace(series, across=np.array([0.8, 1.2])[:, None, None] * np.ones((6, 8)))
    before = tuple(
        Charge(off_s - 30.0, off_s, np.empty(0), np.empty(0)) for off_s in (-90.0, -20.0)
    )
    series = replace(
        series, earlier=EarlierCharges(before, 2 * series.irradiance, series.rise, series.fade)
    )
    k_r, k_e = np.array([0.08, 0.015]), np.linspace(0.001, 0.1, 16).reshape(2, 8)
    affine, general = (levels(series, k_r, k_e, order) for order in (None, np.ones(2)))
    for ours, theirs in zip(general[:3], affine[:3], strict=True):
        assert ours == pytest.approx(theirs, rel=1e-4, abs=1e-5 * np.abs(theirs).max())


def test_a_state_that_is_not_there_may_lose_its_rate() -> None:
    """A decay of no exponential has one more state, whose slow rate no charge tells from none."""
    found = fit_excitation(measured(bench(1.0, seed=7)), [0.05, 1e-5], [0.5, 0.5], UNCERTAIN)
    there, not_there = found.states
    true = read_material("blue-paint").states[0].k_r_per_s
    assert there.k_r_per_s == pytest.approx(true, abs=4 * there.k_r_per_s_sigma)
    assert 0 < not_there.k_r_per_s < 1e-6
    # Rao's test has one degree of freedom for each state.
    assert 0 <= found.order_gain < 20
    assert np.isfinite(found.covariance).all()


def test_derivatives_of_levels_left_from_charges_before() -> None:
    """One charge after the other without a wait, then a fresh sample, and a full one."""
    series = Bench(two_states()).series("LVF", LVF[:2], (8.0, 64.0, 8.0, 20.0), 40.0, shots=3)
    charges = list(series.charges)
    charges[2] = replace(charges[2], fresh=True)
    charges[3] = replace(charges[3], saturated=True)
    series = replace(series, charges=tuple(charges))
    k_r, order = np.array([0.08, 0.015]), np.array([1.4, 2.3])
    k_e = np.linspace(0.001, 0.1, 16).reshape(2, 8)
    for function in (levels, levels_at_off):
        found = function(series, k_r, k_e, order)
        for state in range(2):
            at = np.eye(2)[state]
            for slope, by in (
                (found.by_k_r[..., state], (1e-6 * at, 0.0, 0.0)),
                (found.by_k_e[..., state, 3], (0.0, 1e-6 * np.outer(at, np.eye(8)[3]), 0.0)),
                (found.by_order[..., state], (0.0, 0.0, 1e-6 * at)),
            ):
                by_k_r, by_k_e, by_order = by
                up, down = (
                    function(series, k_r + s * by_k_r, k_e + s * by_k_e, order + s * by_order)
                    for s in (1, -1)
                )
                numeric = (up.value - down.value)[..., state] / 2e-6
                assert slope == pytest.approx(numeric, rel=1e-3, abs=1e-4 * np.abs(slope).max())


def test_order_rates_and_level_of_a_sample() -> None:
    sample = bench(B)
    found = fitted(measured(sample), None)
    (state,), (truth,) = found.states, sample.material.states
    assert found.warnings == ()
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.15)
    assert state.is_level_known
    assert state.kinetic_order_sigma < 0.05
    assert abs(state.kinetic_order - B) < 3 * state.kinetic_order_sigma
    assert abs(state.k_r_per_s - truth.k_r_per_s) < 3 * state.k_r_per_s_sigma
    assert abs(state.amplitude - sample.amplitudes()[0]) < 3 * state.amplitude_sigma
    off_k_e = state.k_e_per_s - np.array(truth.k_e_per_s)
    assert (np.abs(off_k_e) < 3 * state.k_e_per_s_sigma + 1e-5).all()
    assert found.covariance_parameters[-1] == "kinetic_order 1"
    assert np.sqrt(found.covariance[-1, -1]) == pytest.approx(state.kinetic_order_sigma)
    off = found.at_off[0]
    law = becquerel_of(float(off.r0[0]), state.k_r_per_s, state.kinetic_order)
    assert off.decay_time_s[0] == pytest.approx(1 / (law.shape * law.rate_per_s))


@pytest.mark.campaign
def test_what_a_weak_charge_does_not_tell_is_not_known() -> None:
    """κ, k_r and r(0) scale each other; the decay of the charge is known for all that."""
    sample = bench(B, irradiance=0.05)
    found = fitted(measured(sample), None)
    (state,), off = found.states, found.at_off[0]
    assert not state.is_level_known
    assert state.k_r_per_s_sigma > 0.3 * state.k_r_per_s
    assert off.amplitude_sigma[0] < 0.05 * off.amplitude[0]
    assert off.decay_time_s_sigma[0] < 0.6 * off.decay_time_s[0]
    assert "charge-unsaturated" in codes(found.warnings)


def test_the_order_is_chosen_by_the_data_or_told() -> None:
    for order in (1.0, B):
        series = measured(bench(order, seed=3))
        fits = OrderFits(series, decay_result((0.03, 10.0)), UNCERTAIN, states_given=False)
        choice = fits.chosen("auto")
        fit = choice.fitted(series)
        assert fit.are_orders_fitted == (order != 1)
        assert [model.order for model in fit.models] == ([1.0] if order == 1 else [1.0, None])
    held = fits.chosen("1").fitted(series)
    assert held.is_first_order
    assert "order-contradicted" in codes(held.warnings)
    told = fits.chosen("1.5").fitted(series)
    assert told.states[0].kinetic_order == B
    assert told.states[0].kinetic_order_sigma == 0
    assert not told.are_orders_fitted
    assert told.chi2 == pytest.approx(fit.chi2, abs=12)
    again = replace(choice, best=fit).fitted(series)
    assert again.chi2 == pytest.approx(fit.chi2, abs=0.01)


def test_a_slow_state_that_may_be_none_does_not_mislead_the_orders() -> None:
    """A third exponential of the decay, weak and of any rate, is no start for two orders."""
    kinetics = KineticsSettings(model="general_order", order=B)
    sample = Bench(read_material("double-medium-bright"), kinetics=kinetics, seed=5)
    decay = decay_result((0.048, 586.0), (0.016, 396.0), (1.2e-4, 17.6))
    sigmas = (100.0, 60.0, 600.0)
    states = (
        replace(state, amplitude_sigma=sigma)
        for state, sigma in zip(decay.states, sigmas, strict=True)
    )
    fits = OrderFits(measured(sample), replace(decay, states=tuple(states)), UNCERTAIN, False)
    best = fits.chosen("auto").best
    assert [model.states for model in best.models] == [1, 2, 3]
    assert best.models[1].reduced_chi2 < 1.1


@pytest.mark.parametrize("text", ["second", "0.5", "5", "nan"])
def test_what_is_no_order_is_one_line(text: str) -> None:
    with pytest.raises(UsageError, match=f"--order: expected auto, free or .* got '{text}'"):
        chosen_options(ExcitationOptions, {"order": text})


def test_closure_predicts_the_bent_charge() -> None:
    sample = bench(B)
    series = sample.series("bare lamp", BARE, (4.0, 16.0, 64.0, 256.0), 3000.0, shots=1)
    (truth,) = sample.material.states
    charge_s = [charge.off_s - charge.on_s for charge in series.charges]
    level = series.values[:, 0, 1]
    known = {
        "irradiance": series.irradiance[0],
        "k_e_per_s": [truth.k_e_per_s],
        "k_r_per_s": [truth.k_r_per_s],
        "full_level": sample.amplitudes(),
        "dark_s": [charge.start_s[0] - charge.off_s for charge in series.charges],
        "exposure_s": 0.5,
    }
    bent = closure(charge_s, level, 0.02 * level, **known, kinetic_order=B)
    assert bent.rms_percent < 2.0
    assert closure(charge_s, level, 0.02 * level, **known).rms_percent > 10


@pytest.mark.parametrize("order", [None, np.array([B, 2.0])])
def test_charges_of_the_series_before_are_not_forgotten(order: FloatArray | None) -> None:
    """Two series of the same sites are one, of which the second begins later."""
    whole = Bench(two_states()).series("LVF", LVF, (256.0, 64.0, 8.0), wait_s=120.0, shots=3)
    *before, last = whole.charges
    later = replace(
        whole, charges=(last,), values=whole.values[6:], sigma=whole.sigma[6:],
        earlier=EarlierCharges(tuple(before), whole.irradiance, whole.rise, whole.fade),
    )  # fmt: skip
    rates = np.array([0.08, 0.015]), np.linspace(0.001, 0.1, 16).reshape(2, 8), order
    for name in ("value", "by_k_r", "by_k_e"):
        expected, found = (getattr(levels(series, *rates), name) for series in (whole, later))
        assert found == pytest.approx(expected[6:], rel=1e-9)
    forgotten = levels(replace(later, earlier=None), *rates).value
    assert (forgotten < 0.9 * levels(later, *rates).value)[..., 1].all()


@pytest.mark.campaign
def test_closure_knows_what_earlier_charges_left() -> None:
    """A sample that was charged for long two minutes before the first charge that is predicted."""
    sample = bench(B, seed=4)
    whole = sample.series("bare lamp", BARE, (256.0, 4.0, 16.0, 64.0, 256.0), 400.0, shots=4)
    direct = replace(
        whole, charges=whole.charges[1:], values=whole.values[4:], sigma=whole.sigma[4:],
        earlier=EarlierCharges(whole.charges[:1], whole.irradiance, whole.rise, whole.fade),
    )  # fmt: skip
    through = sample.series("through LVF", LVF, (8.0, 64.0, 256.0), shots=5)
    fit = fitted([direct, through], B)
    one, three = np.ones(1), np.ones((1, 3))
    whole_strip = Series(
        one, one, three, three, np.zeros(3), ("R", "G", "B"), one, one, ("",), ("",), ("",)
    )

    def predicted(direct: ChargingSeries) -> Closure:
        charging = PatchCharging(through, direct, np.ones(1), whole_strip)
        found = predicted_charging(charging, UNCERTAIN, lambda _: fit)
        assert found is not None
        return found

    def first_off(closed: Closure) -> float:
        return float(closed.measured[0] / closed.predicted[0] - 1)

    known, forgotten = predicted(direct), predicted(replace(direct, earlier=None))
    assert known.rms_sigma < 2
    assert abs(first_off(known)) < 0.05
    assert first_off(forgotten) > 0.1


def noisy(series: ChargingSeries, rng: np.random.Generator) -> ChargingSeries:
    """Exact values with the bench's noise."""
    bench_ = bench(B)
    sigma = np.sqrt(bench_.read_noise**2 + series.values / (bench_.photons * 0.5))
    flicker = bench_.flicker * rng.normal(size=(len(sigma), 1, 1))
    values = series.values * (1 + flicker) + sigma * rng.normal(size=sigma.shape)
    return replace(series, values=values, sigma=sigma)


@pytest.mark.campaign
def test_the_sigma_of_an_order_is_its_scatter() -> None:
    """With a lamp as steady as the fit is told, and sites enough for all bands; rms 1 ± 0.041."""
    exact = replace(
        bench(B), flicker=0.0, read_noise=1e-3, photons=1e12,
        lamp=LampSettings(warm_up_deficit=0.0),
    )  # fmt: skip
    sites = lvf_windows(np.linspace(405.0, 690.0, 14))
    clean = [
        exact.series("bare lamp", BARE, (900.0,), shots=10, every_s=15.0),
        exact.series("through LVF", sites, (8.0, 64.0, 256.0), shots=5),
    ]
    near, pulls = None, []
    for seed in range(200, 320):
        rng = np.random.default_rng(seed)
        series = [noisy(each, rng) for each in clean]
        near = fit_excitation(series, [0.03], [1.0], RelativeSigmas(0.005), near, None)
        (state,) = near.states
        pulls.append((state.kinetic_order - B) / state.kinetic_order_sigma)
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.15)
