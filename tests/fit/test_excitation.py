"""Excitation rates from samples that the fit's own formulae did not charge."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from labrig.fit.excitation import RelativeSigmas, fit_excitation as fit, levels_at_off
from labrig.fit.excitation.levels import levels
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.foundation.errors import FitError
from labrig.material import Material, dark_step, read_material
from labrig.results import (
    Charge,
    ChargingSeries,
    EarlierCharges,
    FittedExcitation,
    OneSided,
    Transient,
)
from tests.fit.charged_samples import BARE, DOOR_S, WEIGHTS, Bench, lvf_windows, two_states
from tests.pulls import assert_sigma_is_right
from tests.warned import codes, of_code

LVF = lvf_windows(np.linspace(405, 695, 12))
CHARGES_S = (8, 32, 64, 128, 256)
LAMP = 0.01


def measured(bench: Bench) -> list[ChargingSeries]:
    """The bare lamp first: its irradiance is E."""
    bare = bench.series("bare lamp", BARE, [1800.0], shots=30, every_s=6.0)
    return [bare, bench.series("through LVF", LVF, CHARGES_S)]


def fitted(bench: Bench, series: list[ChargingSeries]) -> FittedExcitation:
    rates = 1.1 * np.array([state.k_r_per_s for state in bench.material.states])
    return fit(series, rates, bench.amplitudes(), RelativeSigmas(bench.flicker, LAMP))


@pytest.mark.parametrize(
    "material",
    [read_material("blue-paint"), read_material("purple-paint"), two_states()],
    ids=lambda material: str(material.name),
)
def test_rates_and_levels_of_a_material(material: Material) -> None:
    bench = Bench(material)
    found = fitted(bench, measured(bench))
    assert found.warnings == ()
    assert 0.9 < found.reduced_chi2 < 1.1
    true_level = bench.level_at_off(BARE, 1800.0)
    bare = found.at_off[0]
    assert np.abs(bare.r0 - true_level).max() < 3 * bare.r0_sigma.max()
    for state, truth, full in zip(found.states, material.states, bench.amplitudes(), strict=True):
        assert abs(state.k_r_per_s - truth.k_r_per_s) < 3 * state.k_r_per_s_sigma
        assert abs(state.amplitude - full) < 3 * state.amplitude_sigma
        assert state.amplitude_sigma < 0.03 * full
        k_e = np.array(truth.k_e_per_s)
        assert (np.abs(state.k_e_per_s - k_e) < 3 * state.k_e_per_s_sigma + 1e-5).all()
        strong = k_e >= 0.002
        assert state.seen[strong].all()
        assert state.k_e_per_s[strong] == pytest.approx(k_e[strong], rel=0.15)
        assert (k_e[~strong] < state.k_e_upper_per_s[~strong] + 1e-5).all()


@pytest.mark.campaign
def test_errors_are_as_large_as_their_sigma() -> None:
    material = read_material("blue-paint")
    (true,) = material.states
    pulls = []
    for seed in range(100, 132):
        bench = Bench(material, seed=seed, lamp_scatter=LAMP)
        (state,) = fitted(bench, measured(bench)).states
        (full,) = bench.amplitudes()
        k_e = np.array(true.k_e_per_s)
        error = (state.k_e_per_s - k_e) / state.k_e_per_s_sigma
        pulls += [
            (state.k_r_per_s - true.k_r_per_s) / state.k_r_per_s_sigma,
            (state.amplitude - full) / state.amplitude_sigma,
            *error[k_e >= 0.002],
        ]
    assert_sigma_is_right(pulls)


def test_a_glow_left_from_the_charge_before_is_reckoned_with() -> None:
    """The same within its σ, without hours of waiting in between."""
    bench = Bench(read_material("white-paint"))
    rate = bench.material.states[0].k_r_per_s
    hurried = bench.series("through LVF", LVF, CHARGES_S[::-1], wait_s=80.0, shots=10)
    assert np.exp(-rate * 80.0) > 0.02
    bare, _ = measured(bench)
    (state,) = fitted(bench, [bare, hurried]).states
    k_e = np.array(bench.material.states[0].k_e_per_s)
    assert (np.abs(state.k_e_per_s - k_e) < 3 * state.k_e_per_s_sigma + 1e-5).all()


def test_ignoring_the_fade_after_short_charges_would_be_seen() -> None:
    bench = Bench(read_material("green-paint"), flicker=0.0, read_noise=0.01, photons=1e5)
    bare = bench.series("bare lamp", BARE, [100.0], shots=30, every_s=1.0)
    brief = bench.series("through LVF", LVF, (1.5, 2.0, 3.0), shots=6, every_s=1.0)
    dark_at_once = Transient.none(brief.irradiance.shape[1])
    (right,) = fitted(bench, [bare, brief]).states
    (wrong,) = fitted(bench, [replace(one, fade=dark_at_once) for one in (bare, brief)]).states
    assert abs(right.k_e_per_s[0] - 0.1) < 3 * right.k_e_per_s_sigma[0]
    assert wrong.k_e_per_s[0] > 1.03 * right.k_e_per_s[0]


def test_saturation_taken_for_granted_as_in_the_paper() -> None:
    """Λ is then what the decay shows, and k_e absorbs what the level was wrong by."""
    bench = Bench(read_material("blue-paint"))
    bare, lvf = measured(bench)
    (charge,) = bare.charges
    granted = replace(bare, charges=(replace(charge, saturated=True),))
    joint, paper = fitted(bench, [bare, lvf]), fitted(bench, [granted, lvf])
    assert paper.at_off[0].r0 == pytest.approx([1.0])
    assert paper.states[0].amplitude == pytest.approx(joint.at_off[0].amplitude[0], rel=0.01)
    assert paper.states[0].k_e_per_s[1] > 1.5 * joint.states[0].k_e_per_s[1]


def test_weak_light_leaves_the_level_unknown_and_says_so() -> None:
    bench = Bench(read_material("blue-paint"), irradiance=0.02)
    found = fitted(bench, measured(bench))
    assert of_code(found.warnings, "charge-unsaturated").values["sigma_percent"] >= 100
    assert (
        found.at_off[0].amplitude_sigma[0] / found.at_off[0].amplitude[0]
        < found.states[0].amplitude_sigma / found.states[0].amplitude / 5
    ), "a is measured, Λ and r(0) are not"


@pytest.mark.parametrize(("irradiance", "seed"), [(0.1, 25), (0.02, 22)])
def test_the_search_ends_where_one_from_the_truth_does(irradiance: float, seed: int) -> None:
    """Far from saturation and with the light known to 10 %: amplitudes have hardly an upper end."""
    bench = Bench(two_states(), irradiance=irradiance, seed=seed)
    light_sigma = 0.1
    off = np.exp(light_sigma * bench.random.normal(size=(len(LVF), 1)))
    each_site = light_sigma * np.eye(len(LVF))[:, :, None] * np.ones(8)
    through = replace(
        bench.series("through LVF", LVF * off, (8, 16, 32, 64)),
        irradiance=bench.irradiances(LVF),
        site_modes=each_site,
    )
    series = [bench.series("bare lamp", BARE, (8, 64, 600), every_s=6.0), through]
    found = fitted(bench, series)
    states = zip(found.states, bench.material.states, bench.amplitudes(), strict=True)
    truth = replace(
        found,
        states=tuple(
            replace(
                state,
                k_r_per_s=true.k_r_per_s,
                amplitude=amplitude,
                k_e_per_s=np.array(true.k_e_per_s),
            )
            for state, true, amplitude in states
        ),
        channel_weights=WEIGHTS,
    )
    rates = [state.k_r_per_s for state in bench.material.states]
    from_truth = fit(
        series, rates, bench.amplitudes(), RelativeSigmas(bench.flicker, LAMP), near=truth
    )
    assert found.chi2 == pytest.approx(from_truth.chi2, abs=0.01)


def test_a_sample_that_is_no_phosphor_of_these_states_is_reported() -> None:
    bench = Bench(two_states())
    series = measured(bench)
    found = fit(series, [0.03], [1.0], RelativeSigmas(bench.flicker, LAMP))
    assert found.reduced_chi2 > 2
    assert of_code(found.warnings, "model-misfit").values["reduced_chi2"] > 2


@pytest.mark.parametrize("convex", [True, False])
def test_charging_by_another_law_is_told_from_the_lamps_scatter(convex: bool) -> None:
    """A sample that takes the less light the emptier it is, or the more: its short charges differ.

    The fit could make good for it by a lamp that is darker the shorter it shines.
    """
    bench = Bench(read_material("blue-paint"))
    bare, through = measured(bench)
    emptied = -0.15 if convex else 0.15
    charged = np.repeat([charge.off_s - charge.on_s for charge in through.charges], 12)
    bent = 1 + emptied * np.exp(-charged / 40.0)[:, None, None]
    found = fitted(bench, [bare, replace(through, values=bent * through.values)])
    assert (of_code(found.warnings, "rate-equation-misfit").values["trend"] > 0) == convex


def measured_in_frames(bench: Bench) -> list[ChargingSeries]:
    """Photographs of 2 s after charges through the filter, of 0.2 s by the bare lamp.

    The filter takes a tenth of the frame, the whole sample two thirds.
    """
    through = bench.series("through LVF", LVF, CHARGES_S, exposure_s=2.0)
    bare = bench.series("bare lamp", np.tile(BARE, (len(LVF), 1)), [20.0, 1800.0], exposure_s=0.2)
    return [
        replace(one, frame_light=np.broadcast_to(light[:, None], one.values.shape).copy())
        for one, part in ((through, 0.1), (bare, 0.66))
        for light in [part * one.values.mean(axis=1)]
    ]


def test_light_of_the_frame_over_all_sites_excites_nothing() -> None:
    """Without it weakly exciting bands have rates that are the frame's light."""
    bench = Bench(read_material("blue-paint"))
    series = [
        replace(one, values=one.values + 0.03 * one.frame_light)
        for one in measured_in_frames(bench)
        if one.frame_light is not None
    ]
    sigmas = RelativeSigmas(bench.flicker, LAMP, scale=0.005)
    ignored = fit(series, [0.03], [1.0], sigmas)
    found = fit(series, [0.03], [1.0], replace(sigmas, veil=0.02))
    k_e = np.array(bench.material.states[0].k_e_per_s)
    state, other = found.states[0], ignored.states[0]
    assert (np.abs(state.k_e_per_s - k_e) < 3 * state.k_e_per_s_sigma).all()
    assert (np.abs(other.k_e_per_s - k_e) > 4 * other.k_e_per_s_sigma).any()
    assert ignored.veil is None
    assert found.veil is not None
    assert not isinstance(found.veil, OneSided)
    assert abs(found.veil.value - 0.03) < 3 * found.veil.sigma < 0.06


def test_a_veil_that_is_not_seen_has_a_limit() -> None:
    for seed in (11, 12):
        bench = Bench(read_material("blue-paint"), seed=seed)
        sigmas = RelativeSigmas(bench.flicker, LAMP, scale=0.005, veil=0.02)
        veil = fit(measured_in_frames(bench), [0.03], [1.0], sigmas).veil
        assert isinstance(veil, OneSided)
        assert veil.value == 0
        assert 0.01 < veil.limit < 1.645 * 0.02


@pytest.mark.parametrize("missing", [0.0, 0.02])
def test_a_camera_whose_large_signals_fall_short_is_told(missing: float) -> None:
    bench = Bench(read_material("blue-paint"))
    series = measured_in_frames(bench)
    collected = [
        one.values * np.concatenate([charge.exposure_s for charge in one.charges])[:, None, None]
        for one in series
    ]
    largest = max(float(each.max()) for each in collected)
    series = [
        replace(one, values=one.values * (1 - missing * each / largest))
        for one, each in zip(series, collected, strict=True)
    ]
    found = fit(series, [0.03], [1.0], RelativeSigmas(bench.flicker, LAMP, scale=0.005))
    assert ("sensor-nonlinear" in codes(found.warnings)) == (missing > 0)


def test_irradiance_known_badly_goes_into_every_rate() -> None:
    bench = Bench(read_material("blue-paint"))
    series = measured(bench)
    alone = fitted(bench, series).states[0]
    rough = fit(series, [0.03], [1.0], RelativeSigmas(bench.flicker, LAMP, irradiance=0.05)).states[
        0
    ]
    expected = np.hypot(alone.k_e_per_s_sigma, 0.05 * alone.k_e_per_s)
    assert rough.k_e_per_s_sigma == pytest.approx(expected, rel=1e-3)
    assert rough.k_r_per_s_sigma == pytest.approx(alone.k_r_per_s_sigma, rel=1e-3)


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in (2, 3))]
)
def test_a_dark_level_that_wanders_counts_for_no_more_than_it_tells(seed: int) -> None:
    """A sensor warms and cools between photographs: dim ones would tell a wrong rate."""
    bench = Bench(read_material("red-paint"), read_noise=0.01, photons=1e4, seed=seed)
    random = np.random.default_rng(seed)
    series = [
        replace(one, values=one.values + random.normal(0.0, 0.3, (len(one.values), 1, 1)))
        for one in measured(bench)
    ]
    found = fit(
        series, [0.02], [1.0], RelativeSigmas(bench.flicker, LAMP, common_mode=(0.3, 0.3, 0.3))
    )
    (state,), (truth,) = found.states, bench.material.states
    assert 0.95 < found.reduced_chi2 < 1.05
    assert abs(state.k_r_per_s - truth.k_r_per_s) < 3 * state.k_r_per_s_sigma
    assert fitted(bench, series).reduced_chi2 > 100


def test_values_not_measured_and_fresh_samples() -> None:
    bench = Bench(read_material("blue-paint"))
    bare, lvf = measured(bench)
    values = lvf.values.copy()
    values[::3, 2] = np.nan
    fresh = tuple(replace(charge, fresh=True) for charge in lvf.charges)
    found = fitted(bench, [bare, replace(lvf, values=values, charges=fresh)])
    assert found.dof < fitted(bench, [bare, lvf]).dof
    assert np.isnan(found.residuals[1][0, 2]).all()
    assert found.states[0].k_e_per_s[1] == pytest.approx(0.05, rel=0.1)


def one_after_another(bench: Bench) -> list[ChargingSeries]:
    """Charges by the lamp itself soon after those through the filter, which have left much."""
    through = bench.series("through LVF", LVF, CHARGES_S, 100.0)
    everywhere = np.tile(BARE, (len(LVF), 1))
    direct = bench.series("bare lamp", everywhere, [3.0, 10.0, 240.0], 100.0)
    later_s = through.charges[-1].off_s + 100.0 - direct.charges[0].on_s
    charges = tuple(
        replace(
            one, on_s=one.on_s + later_s, off_s=one.off_s + later_s, start_s=one.start_s + later_s
        )
        for one in direct.charges
    )
    earlier = EarlierCharges(through.charges, through.irradiance, through.rise, through.fade)
    return [through, replace(direct, charges=charges, earlier=earlier)]


@pytest.mark.parametrize(("order", "defining"), [(None, 0), (1.0, 1)])
def test_the_jacobian_is_that_of_the_residuals(order: float | None, defining: int) -> None:
    through, direct = one_after_another(Bench(two_states()))
    random = np.random.default_rng(4)
    charges = tuple(replace(one, cold_deficit=0.3) for one in through.charges)
    modes = random.normal(0, 0.05, (3, *through.irradiance.shape))
    across = np.exp(random.normal(0, 0.1, (2, *through.irradiance.shape)))
    through = replace(
        through,
        charges=charges,
        site_modes=modes,
        across=across,
        arriving=np.stack([np.ones(8), np.linspace(0.3, 0.8, 8)]),
        frame_light=0.4 * through.values,
        veil_shapes=np.linspace(-1.0, 1.0, len(LVF))[None],
    )
    direct = replace(direct, frame_light=0.4 * direct.values)
    problem = ExcitationProblem(
        [through, direct],
        2,
        1,
        RelativeSigmas(
            0.005,
            0.01,
            cold_deficit=0.03,
            scale=0.02,
            defining=defining,
            offset=(0.1, 0.2, 0.3),
            common_mode=(0.2, 0.1, 0.3),
            veil=0.02,
            veil_shape=0.01,
            evenness=0.1,
            start=0.1,
        ),
        order,
    )
    orders = np.ones(2) if order == 1 else np.array([1.4, 1.2])
    theta = problem.parameters.as_stated(
        np.array([0.07, 0.02]),
        np.array([2500.0, 500.0]),
        random.uniform(0.001, 0.1, (2, 8)),
        np.array([0.3, 1.0, 0.7]),
        orders,
    )
    columns = problem.parameters.columns
    theta[columns.scale], theta[columns.brightness], theta[columns.lacking] = 0.01, 0.005, 0.02
    theta[columns.off] = random.normal(0, 1.0, 3)
    theta[columns.offset] = 0.3, -0.2, 0.1
    theta[columns.veil] = 0.01, -0.005
    theta[columns.evenness] = random.normal(0, 0.02, len(LVF) - 1)
    theta[columns.start] = 0.002, 0.004
    problem.rewhiten(theta)
    _, jacobian = problem.residuals(theta)
    # Of each kind of parameter, along a direction in which all of them change.
    for place in columns:
        direction = np.zeros_like(theta)
        size = 1e-6 * np.maximum(np.abs(theta[place]), 1e-3)
        direction[place] = size * random.uniform(0.5, 1.5, len(size))
        after, before = (problem.residuals(theta + step)[0] for step in (direction, -direction))
        expected = jacobian @ direction
        change = (after - before) / 2
        assert change == pytest.approx(expected, rel=1e-4, abs=1e-5 * np.abs(expected).max())


def test_the_level_of_k_e_is_that_of_the_series_that_defines_e() -> None:
    """Light behind the filter that is stated 6 % too bright moves no rate that the lamp defines."""
    bench = Bench(two_states(), flicker=0.003, photons=200.0, seed=8)
    through, direct = one_after_another(bench)
    truth = np.array([state.k_e_per_s for state in bench.material.states])
    rates = [state.k_r_per_s for state in bench.material.states]

    def k_e(factor: float, defining: int) -> NDArray[np.float64]:
        series = [replace(through, irradiance=factor * through.irradiance), direct]
        uncertain = RelativeSigmas(0.003, 0.002, scale=0.04, defining=defining)
        rates_by_band = fit(series, rates, bench.amplitudes(), uncertain).k_e()
        return np.asarray(rates_by_band[truth > 0.1 * truth.max()])

    by_places, by_lamp = (np.mean(np.log(k_e(1.06, n) / k_e(1.0, n))) for n in (0, 1))
    assert by_places == pytest.approx(-np.log(1.06), abs=0.01)
    assert by_lamp == pytest.approx(0.0, abs=0.003)


def test_r0_has_the_error_of_its_own_charge() -> None:
    """A lamp that may be off by 5 % from charge to charge leaves more open than one by 0.1 %."""
    bench = Bench(two_states(), flicker=0.003, seed=9)
    series = one_after_another(bench)
    rates = [state.k_r_per_s for state in bench.material.states]
    sure, unsure = (
        fit(series, rates, bench.amplitudes(), RelativeSigmas(0.003, lamp, defining=1))
        for lamp in (0.001, 0.05)
    )
    assert (unsure.at_off[1].r0_sigma > 1.5 * sure.at_off[1].r0_sigma).all()
    assert sure.at_off[1].r0 == pytest.approx(unsure.at_off[1].r0, abs=0.05)


def test_what_earlier_charges_left_is_not_evenness() -> None:
    """Places differ by 3 %, and those that were charged through the filter glow on."""
    bench = Bench(two_states(), flicker=0.003, photons=200.0, seed=6)
    uneven = 1 + 0.03 * np.cos(np.linspace(0.0, 3.0, len(LVF)))
    uneven = uneven / np.exp(np.log(uneven).mean())
    through, direct = one_after_another(bench)
    # The bench charges each series from nothing: this is what the first left in the second.
    k_r = np.array([state.k_r_per_s for state in bench.material.states])
    k_e = np.array([state.k_e_per_s for state in bench.material.states])
    alone = levels(replace(direct, earlier=None), k_r, k_e).value
    left = (levels(direct, k_r, k_e).value - alone) @ bench.amplitudes()
    direct = replace(direct, values=direct.values + np.multiply.outer(left, WEIGHTS))
    assert np.ptp(left[0]) > 0.03 * direct.values[0, :, 1].mean()
    series = [
        replace(one, values=one.values * uneven[:, None], sigma=one.sigma * uneven[:, None])
        for one in (through, direct)
    ]
    sigmas = RelativeSigmas(bench.flicker, LAMP, scale=0.005, evenness=0.3)
    found = fit(series, k_r, bench.amplitudes(), sigmas)
    assert found.evenness == pytest.approx(uneven, rel=2e-3)
    assert 0.9 < found.reduced_chi2 < 1.1
    assert found.by_band is not None
    assert not found.by_band.rate.differs
    taken_for_even = fit(series, k_r, bench.amplitudes(), replace(sigmas, evenness=0.0))
    assert (taken_for_even.evenness == 1).all()
    assert taken_for_even.reduced_chi2 > 2


@pytest.mark.parametrize("order", [None, np.array([1.4, 2.3])])
def test_a_start_is_what_charges_before_have_left(order: NDArray[np.float64] | None) -> None:
    series = Bench(two_states()).series("LVF", LVF[:1], (60.0, 8.0, 32.0), 100.0, shots=3)
    k_r, k_e = np.array([0.08, 0.015]), np.linspace(0.001, 0.1, 16).reshape(2, 8)
    at_off, (first, *others) = levels_at_off(series, k_r, k_e, order).value[0], series.charges
    wait_s = others[0].on_s - first.off_s
    b = np.ones(2) if order is None else order
    start = dark_step(at_off, k_r, b, np.full((1, 2), wait_s))[0][0]
    later = replace(
        series, charges=tuple(others), values=series.values[3:], sigma=series.sigma[3:], start=start
    )
    whole = levels(series, k_r, k_e, order).value
    assert levels(later, k_r, k_e, order).value == pytest.approx(whole[3:], rel=1e-4)
    dark = levels(replace(later, start=None), k_r, k_e, order).value
    assert np.abs(dark / whole[3:] - 1).max() > 0.02


def test_what_was_left_at_the_start_is_found() -> None:
    """The slow one of two states, of a sample that was charged fully ten minutes ago."""
    bench = Bench(two_states(), flicker=0.003, photons=200.0, seed=7)
    through, direct = one_after_another(bench)
    k_r = np.array([state.k_r_per_s for state in bench.material.states])
    k_e = np.array([state.k_e_per_s for state in bench.material.states])
    start = np.array([0.0, 0.003])
    series = []
    for one in (through, direct):
        begun, alone = replace(one, start=start), replace(one, earlier=None)
        left = levels(begun, k_r, k_e).value - levels(alone, k_r, k_e).value
        values = one.values + np.multiply.outer(left @ bench.amplitudes(), WEIGHTS)
        series.append(replace(one, values=values))
    sigmas = RelativeSigmas(bench.flicker, LAMP, scale=0.005, evenness=0.3, start=0.1)
    found = fit(series, k_r, bench.amplitudes(), sigmas)
    assert 0.9 < found.reduced_chi2 < 1.1
    taken_for_dark = fit(series, k_r, bench.amplitudes(), replace(sigmas, start=0.0))
    assert taken_for_dark.chi2 > found.chi2 + 100


def test_levels_do_not_depend_on_how_a_wait_is_cut() -> None:
    bench = Bench(two_states(), flicker=0.0)
    series = bench.series("through LVF", LVF, (16, 64))
    first, second = series.charges
    pointless = Charge(first.off_s + 100, first.off_s + 102, np.zeros(0), np.zeros(0), 0.0)
    cut = replace(series, charges=(first, pointless, second))
    k_r = np.array([0.08, 0.015])
    k_e = np.array([state.k_e_per_s for state in bench.material.states])
    assert levels(cut, k_r, k_e).value == pytest.approx(levels(series, k_r, k_e).value, rel=1e-12)
    assert len(levels_at_off(cut, k_r, k_e).value) == 3


BAD = {
    "before the lamp has faded": lambda one: replace(
        one, charges=(replace(one.charges[0], start_s=one.charges[0].start_s - DOOR_S),)
    ),
    "outlast the lamp's rise": lambda one: replace(
        one, charges=(replace(one.charges[0], on_s=one.charges[0].off_s - 0.5),)
    ),
    "expected 'on' before 'off'": lambda one: replace(
        one, charges=(replace(one.charges[0], on_s=1e9),)
    ),
    "photographs of 1 sites": lambda one: replace(one, values=one.values[:5]),
    "irradiances of 0 or more": lambda one: replace(one, irradiance=-one.irradiance),
    "got none": lambda one: replace(one, values=np.full_like(one.values, np.nan)),
}


@pytest.mark.parametrize("said", BAD)
def test_series_that_cannot_be(said: str) -> None:
    bench = Bench(read_material("blue-paint"))
    (bare, _) = measured(bench)
    expected = "after the lamp has faded" if said.startswith("before") else said
    with pytest.raises(FitError, match=expected):
        fitted(bench, [BAD[said](bare)])


def test_nothing_glows() -> None:
    bench = Bench(read_material("blue-paint"))
    (bare, _) = measured(bench)
    with pytest.raises(FitError, match="did the lamp light"):
        fitted(bench, [replace(bare, values=-np.abs(bare.values))])
    with pytest.raises(FitError, match="same bands"):
        fitted(bench, [])


def test_transients_that_are_none() -> None:
    for t_s, left in (([0.0], [[1.0]]), ([0.1, 0.2], [[1.0], [0.0]]), ([0.0, 0.1], [1.0, 0.0])):
        with pytest.raises(FitError, match="that rise from 0 s"):
            Transient.sampled(t_s, left)


def test_a_transient_in_fewer_parts_gives_the_same_light() -> None:
    falling = np.stack([np.exp(-np.linspace(0, 3, 51)), np.linspace(1, 0, 51)], axis=1)
    whole = Transient.sampled(np.linspace(0, 0.2, 51) ** 2, falling)
    few = whole.in_parts(4)
    assert len(few.duration_s) == 4
    assert few.total_s == pytest.approx(whole.total_s)
    np.testing.assert_allclose(few.duration_s @ few.fraction, whole.duration_s @ whole.fraction)
    assert whole.in_parts(50) is whole


def test_a_site_under_uneven_light_has_the_mean_level_of_its_places() -> None:
    bench = Bench(read_material("blue-paint"))
    _, through = measured(bench)
    slope = np.linspace(-0.3, 0.3, through.irradiance.size).reshape(through.irradiance.shape)
    across = np.stack([1 - slope, 1 + slope])
    k_r, k_e = np.array([0.03]), np.full((1, through.irradiance.shape[1]), 0.05)
    uneven = levels(replace(through, across=across), k_r, k_e)
    each = [
        levels(replace(through, irradiance=through.irradiance * one), k_r, k_e) for one in across
    ]
    np.testing.assert_allclose(uneven.value, (each[0].value + each[1].value) / 2, rtol=1e-12)
    np.testing.assert_allclose(uneven.by_k_e, (each[0].by_k_e + each[1].by_k_e) / 2, rtol=1e-12)
    # A level saturates: less than that of the mean light.
    even = levels(through, k_r, k_e).value
    assert (uneven.value <= even * (1 + 1e-12)).all()
    assert (uneven.value < 0.995 * even).any()
