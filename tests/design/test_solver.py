"""Materials are found from their own glow; what keys do not tell is said."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from labrig.design import (
    Design,
    Keys,
    LightProgramme,
    solve,
    spectral_bands,
    three_bands,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from tests.design.scenes import COLOURED, OFTEN_S, Truth, film, keys_of

RGB = three_bands()
ONE_STATE = Truth.of([0.05], [[0.002, 0.03, 0.2]], [[0.1, 4.0, 2.0]], [0.1, 0.3, 0.2])
TWO_STATES = Truth.of(
    [0.3, 0.02],
    [[0.01, 0.05, 0.3], [0.001, 0.02, 0.05]],
    [[0.2, 1.0, 3.0], [2.0, 5.0, 1.0]],
    [0.3, 0.2, 0.1],
)


def estimate(design: Design, name: str) -> tuple[float, float, bool]:
    found = next(each for each in design.estimates if each.name == name)
    return found.value, found.sigma, found.is_determined


@pytest.mark.parametrize(
    ("truth", "n_states"), [(ONE_STATE, 1), (TWO_STATES, 2)], ids=["one state", "two states"]
)
def test_a_material_is_found_from_its_exact_glow(truth: Truth, n_states: int) -> None:
    keys = keys_of(truth, COLOURED, OFTEN_S)
    design = solve(COLOURED, keys, RGB, n_states=n_states)
    np.testing.assert_allclose(design.k_r_per_s, truth.k_r, rtol=2e-3)
    np.testing.assert_allclose(design.k_e_per_s, truth.k_e, rtol=2e-2, atol=1e-5)
    np.testing.assert_allclose(design.reradiation, truth.reradiation, rtol=2e-2, atol=1e-3)
    np.testing.assert_allclose(design.albedo, truth.albedo, atol=1e-4)
    assert design.delta_e2000.max() < 0.05


def test_an_order_is_found() -> None:
    truth = Truth.of([0.3], [[0.01, 0.05, 0.3]], [[0.5, 4.0, 2.0]], [0.2, 0.2, 0.2], order=1.7)
    keys = keys_of(truth, COLOURED, OFTEN_S)
    design = solve(COLOURED, keys, RGB, order=None)
    assert design.order == pytest.approx(1.7, abs=0.02)
    assert design.cost < 1e-3 * solve(COLOURED, keys, RGB).cost
    fixed = solve(COLOURED, keys, RGB, order=1.7)
    np.testing.assert_allclose(fixed.k_r_per_s, truth.k_r, rtol=1e-2)


def test_its_radiance_is_that_of_the_rate_equation_at_any_time() -> None:
    design = solve(COLOURED, keys_of(TWO_STATES, COLOURED, OFTEN_S), RGB, n_states=2)
    found = Truth(design.k_r_per_s, design.k_e_per_s, design.reradiation, design.albedo)
    times = np.array([1.0, 4.9, 27.0, 33.3, 119.0, 170.0, 1000.0])
    expected = found.radiance(COLOURED, 0, times)
    np.testing.assert_allclose(design.radiance_at(0, times), expected, rtol=1e-6, atol=1e-12)


def test_two_places_tell_more_than_one() -> None:
    """One place sees blue light only, the other red light only."""
    irradiance = np.zeros((2, 2, 3))
    irradiance[0, 0, 2], irradiance[1, 0, 0] = 1.0, 1.0
    light = LightProgramme.checked([0.0, 30.0], irradiance)
    truth = Truth.of([0.04], [[0.01, 0.0, 0.08]], [[1.0, 3.0, 0.5]], [0.0, 0.0, 0.0])
    times = np.array([31.0, 40.0, 60.0])
    wanted = np.concatenate([truth.radiance(light, place, times) for place in (0, 1)])
    keys = Keys.checked([0] * 3 + [1] * 3, [*times, *times], wanted)
    design = solve(light, keys, RGB, albedo=0.0)
    assert design.k_e_per_s[0, 2] / design.k_e_per_s[0, 0] > 5
    value, _, is_known = estimate(design, "k_e G")
    assert (value, is_known) == (0.0, False)
    assert design.delta_e2000.max() < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_a_noisy_glow_gives_parameters_within_three_sigma_or_undetermined(seed: int) -> None:
    rng = np.random.default_rng(seed)
    exact = keys_of(ONE_STATE, COLOURED, OFTEN_S)
    sigma = 0.01 * exact.luminance(RGB)[:, np.newaxis]
    noisy = Keys(exact.place, exact.time_s, exact.radiance + sigma * rng.normal(size=(16, 3)))
    design = solve(COLOURED, noisy, RGB, key_sigma=0.01)
    truths = {"k_r": 0.05, "k_e R": 0.002, "k_e G": 0.03, "k_e B": 0.2}
    truths |= {"Λ G": 4.0, "Λ B": 2.0, "albedo G": 0.3}
    for name, truth in truths.items():
        value, its_sigma, is_known = estimate(design, name)
        assert is_known
        assert abs(value - truth) < 4 * its_sigma


def test_sigma_is_the_spread_over_many_noisy_glows() -> None:
    """A σ that is 20 % too large or too small fails: the pulls' spread is 0.93 ± 0.06."""
    exact = keys_of(ONE_STATE, COLOURED, OFTEN_S)
    sigma = 0.01 * exact.luminance(RGB)[:, np.newaxis]
    pulls = []
    for seed in range(30):
        rng = np.random.default_rng([7, seed])
        wanted = exact.radiance + sigma * rng.normal(size=exact.radiance.shape)
        design = solve(COLOURED, Keys(exact.place, exact.time_s, wanted), RGB, key_sigma=0.01)
        for name, truth in (("k_r", 0.05), ("k_e B", 0.2), ("Λ G", 4.0), ("albedo G", 0.3)):
            value, its_sigma, _ = estimate(design, name)
            pulls.append((value - truth) / its_sigma)
    spread = float(np.sqrt(np.mean(np.square(pulls))))
    assert 0.82 < spread < 1.12


def test_what_no_key_tells_is_said_to_be_undetermined() -> None:
    """After one weak light, k_e and Λ are known as a product only."""
    light = LightProgramme.checked([0.0, 1.0], [[0.1, 0.1, 0.1], [0.0, 0.0, 0.0]])
    keys = Keys.checked(0, [2.0, 10.0], [[0.1, 0.5, 0.2], [0.05, 0.25, 0.1]])
    design = solve(light, keys, RGB, albedo=0.0)
    assert estimate(design, "k_r")[2]
    assert not estimate(design, "k_e R + G + B")[2]
    assert not estimate(design, "Λ G")[2]
    assert design.cost < 1e-12


def test_a_key_that_fights_is_named() -> None:
    light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    glow = np.exp(-0.1 * np.array([1.0, 5.0, 10.0, 20.0]))[:, np.newaxis] * [0.1, 0.5, 0.2]
    glow[2] *= 3
    keys = Keys.checked(0, [11.0, 15.0, 20.0, 30.0], glow)
    design = solve(light, keys, RGB, albedo=0.0)
    worst = design.conflicts[0]
    assert worst.key == 2
    without = Keys.checked(0, np.delete(keys.time_s, 2), np.delete(glow, 2, axis=0))
    assert solve(light, without, RGB, albedo=0.0).cost < 1e-10 < design.cost


def test_faint_keys_count_unless_squares_are_plain() -> None:
    light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    wanted = [[0.1, 1.0, 0.1], [0.05, 0.6, 0.05], [0.0001, 0.001, 0.0001]]
    keys = Keys.checked(0, [10.5, 11.0, 60.0], wanted)
    faint = [
        abs(float(np.log(solve(light, keys, RGB, albedo=0, weights=weights).got_rgb[2, 1] / 0.001)))
        for weights in ("luminance", "plain")
    ]
    assert faint[0] < faint[1]


def test_a_black_key_does_not_outweigh_the_others() -> None:
    light = LightProgramme.checked([0.0, 60.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    glow = np.multiply.outer([1.0, 0.3, 0.0], [0.001, 0.01, 0.004])
    keys = Keys.checked(0, [61.0, 90.0, 400.0], glow)
    design = solve(light, keys, RGB, albedo=0.5)
    assert design.delta_e2000[:2].max() < 1
    assert design.got_rgb[2].max() < 1e-3 * glow.max()


def test_colours_of_spectral_bands_are_met_by_smooth_spectra() -> None:
    bands = spectral_bands(np.linspace(400, 700, 9))
    irradiance = np.zeros((2, 8))
    irradiance[0] = np.linspace(0.02, 0.005, 8)
    light = LightProgramme.checked([0.0, 60.0], irradiance)
    times = np.array([61.0, 70.0, 93.0])
    fading = np.exp(-0.1 * (times - 60))[:, np.newaxis]
    keys = Keys.checked(0, times, fading * [0.05, 0.3, 0.2])
    design = solve(light, keys, bands, albedo=0.3)
    assert design.delta_e2000.max() < 0.1
    assert (design.reradiation >= 0).all()
    roughness = np.abs(np.diff(design.reradiation[0], 2)).max() / design.reradiation.max()
    assert roughness < 1


def test_spectra_are_met_band_by_band() -> None:
    bands = spectral_bands(np.linspace(400, 700, 5))
    irradiance = np.zeros((4, 4))
    irradiance[0, 0], irradiance[2, 1] = 1.0, 1.0
    light = LightProgramme.checked([0.0, 20.0, 60.0, 80.0], irradiance)
    truth = Truth.of([0.03], [[0.1, 0.02, 0.0, 0.0]], [[0.1, 1.0, 0.5, 0.0]], [0.2] * 4)
    times = [10.0, 25.0, 50.0, 70.0, 85.0, 150.0]
    design = solve(light, keys_of(truth, light, times), bands)
    np.testing.assert_allclose(design.reradiation, truth.reradiation, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(design.k_e_per_s[0, :2], [0.1, 0.02], rtol=1e-3)


def test_a_thousand_keys_are_met() -> None:
    times = np.linspace(0.5, 240, 1000)
    design = solve(COLOURED, keys_of(ONE_STATE, COLOURED, times), RGB)
    np.testing.assert_allclose(design.k_r_per_s, [0.05], rtol=1e-4)


def test_light_from_the_begin_alone_needs_no_other_programme() -> None:
    """Without any light there is nothing but black."""
    light = LightProgramme.checked([0.0], [[0.0, 0.0, 0.0]])
    design = solve(light, Keys.checked(0, [5.0], [[0.0, 0.1, 0.0]]), RGB)
    assert not design.got_rgb.any()
    assert [wish.keys for wish in design.impossible] == [(0,)]


@pytest.mark.parametrize("seed", range(2))
def test_no_random_material_is_closer(seed: int) -> None:
    """What is found is lower than each of 100 materials whose Λ and albedo are best for it."""
    light, keys = film(seed, frames=40)
    best = solve(light, keys, RGB).cost
    rng = np.random.default_rng([3, seed])
    lit = light.at(keys.place, keys.time_s) / np.pi
    weight = 1 / keys.luminance(RGB)
    for _ in range(100):
        glow = emissions(light, keys, 10 ** rng.uniform(-3, 1.5, 3), 10 ** rng.uniform(-2, 1))
        cost = 0.0
        for band in range(3):
            columns = weight[:, np.newaxis] * np.column_stack([glow, lit[:, band]])
            fit = lsq_linear(columns, weight * keys.radiance[:, band], ([0, 0], [np.inf, 1]))
            cost += 2 * float(fit.cost)
        assert best <= cost * (1 + 1e-9)


def emissions(light: LightProgramme, keys: Keys, k_e: FloatArray, k_r: float) -> FloatArray:
    """Emission of a state at the keys, by a step from each frame to the next."""
    found = []
    for time in keys.time_s.tolist():
        level, ends = 0.0, np.append(light.begin_s[1:], np.inf)
        for begin, end, lit in zip(light.begin_s, ends, light.irradiance[0], strict=True):
            lasts = max(0.0, min(float(end), time) - float(begin))
            kappa = float(k_e @ lit)
            steady = kappa / (kappa + k_r)
            level = steady + (level - steady) * np.exp(-(kappa + k_r) * lasts)
        found.append(k_r * level)
    return np.array(found)


@pytest.mark.parametrize(
    ("times", "radiance", "place"),
    [
        ([], np.zeros((0, 3)), 0),
        ([1.0], [[np.nan, 0, 0]], 0),
        ([np.inf], [[1.0, 0, 0]], 0),
        ([1.0, 1.0], [[0.1, 0, 0], [0.2, 0, 0]], 0),
        ([1.0], [[0.1, 0]], 0),
        ([1.0], [[0.1, 0, 0]], 5),
        (np.arange(6000.0), np.ones((6000, 3)), 0),
    ],
    ids=["none", "NaN", "endless", "contradiction", "two channels", "no place", "too many"],
)
def test_improper_keys_are_refused_in_one_line(times: object, radiance: object, place: int) -> None:
    with pytest.raises(UsageError) as error:
        solve(COLOURED, Keys.checked(place, times, radiance), RGB)  # type: ignore[arg-type]
    assert "\n" not in str(error.value)
    assert "expected" in str(error.value)


def test_improper_lights_are_refused() -> None:
    for begin, light in (
        ([0.0, 0.0], np.zeros((2, 3))),
        ([0.0], [[-1.0, 0, 0]]),
        ([0.0], [[np.nan, 0, 0]]),
        ([], np.zeros((0, 3))),
        ([0.0, 1.0], np.zeros((3, 3))),
    ):
        with pytest.raises(UsageError, match="expected"):
            LightProgramme.checked(begin, light)


def test_an_albedo_that_no_key_sees_is_none_and_said_to_be_open() -> None:
    light = LightProgramme.checked([0.0, 60.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    wanted = np.multiply.outer([1.0, 0.5, 0.1], [0.001, 0.01, 0.002])
    keys = Keys.checked(0, [61.0, 80.0, 150.0], wanted)
    free, black = (solve(light, keys, three_bands(), albedo=albedo) for albedo in (None, 0.0))
    assert free.cost == black.cost
    assert free.albedo.tolist() == [0, 0, 0]
    names = [each.name for each in free.estimates if not each.is_determined]
    assert {"albedo R", "albedo G", "albedo B"} <= set(names)
    assert len(free.estimates) == len(black.estimates) + 3


def test_a_design_near_another_stays_in_its_basin() -> None:
    light = LightProgramme.checked([0.0, 60.0], [[1.0, 0.8, 0.6], [0.0, 0.0, 0.0]])
    keys = Keys.checked(0, [61.0, 80.0], np.multiply.outer([1.0, 0.5], [0.001, 0.01, 0.002]))
    first = solve(light, keys, three_bands(), albedo=0.3)
    glowing = light.irradiance[0] + [[0.0, 0.0, 0.0], [1e-4, 2e-3, 3e-4]]
    again = solve(
        LightProgramme.checked(light.begin_s, glowing), keys, three_bands(), albedo=0.3, near=first
    )
    # Not told apart by the keys, but for the little that is reflected.
    assert np.abs(np.log(again.k_e_per_s / first.k_e_per_s)).max() < np.log(4)
    reflected = 0.3 * 2e-3 / np.pi
    k_r = np.log((0.01 - reflected) / (0.005 - reflected)) / 19
    np.testing.assert_allclose(again.k_r_per_s, k_r, rtol=5e-3)
    assert again.delta_e2000.max() < 0.05
