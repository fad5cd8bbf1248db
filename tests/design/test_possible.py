"""Wishes that cannot be met are named, with the nearest that can; others raise no alarm."""

import numpy as np
import pytest

from labrig.design import Design, Keys, LightProgramme, solve, spectral_bands, three_bands
from tests.design.scenes import COLOURED, OFTEN_S, Truth, keys_of

RGB = three_bands()
CHARGE = LightProgramme.checked([0.0, 60.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
GREEN = np.array([0.001, 0.01, 0.002])


def designed(time_s: list[float], factors: list[float], light: LightProgramme = CHARGE) -> Design:
    """A design of keys in one green at times after the start."""
    keys = Keys.checked(0, time_s, np.multiply.outer(factors, GREEN))
    return solve(light, keys, RGB, albedo=0.2)


def test_what_fades_is_possible() -> None:
    assert designed([61.0, 80.0, 200.0], [1.0, 0.5, 0.1]).impossible == ()


def test_a_passive_material_raises_no_alarm() -> None:
    """Table 1's order of magnitude: the energy that leaves is less than what is absorbed."""
    truth = Truth.of([0.03], [[0.001, 0.004, 0.02]], [[0.3, 4.0, 3.0]], [0.3, 0.3, 0.3])
    design = solve(COLOURED, keys_of(truth, COLOURED, OFTEN_S), RGB)
    assert design.impossible == ()
    assert 0 < design.emitted_over_absorbed[0] < 1


def test_brighter_later_needs_light_between() -> None:
    (wish,) = designed([61.0, 80.0, 100.0], [0.5, 1.0, 0.2]).impossible
    assert wish.keys == (0, 1)
    assert "only fades" in wish.reason
    again = LightProgramme.checked([0.0, 60.0, 70.0, 75.0], [[1.0] * 3, [0.0] * 3] * 2)
    assert not any(
        len(wish.keys) == 2 for wish in designed([61.0, 80.0], [0.5, 1.0], again).impossible
    )


def test_the_nearest_to_a_rise_is_reached() -> None:
    """What is said to be possible is possible: both keys at their weighted mean."""
    rising = designed([61.0, 80.0], [0.5, 1.0])
    weights = 1 / np.array([0.5, 1.0]) ** 2
    mean = float(weights @ [0.5, 1.0] / weights.sum())
    assert f"{np.pi * mean * GREEN[1]:.3g}" in rising.impossible[0].nearest
    wishes = designed([61.0, 80.0], [mean, mean]).impossible
    assert not any(wish.keys for wish in wishes)


def test_a_glow_needs_light_before_it() -> None:
    late = LightProgramme.checked([0.0, 50.0, 60.0], [[0.0] * 3, [1.0] * 3, [0.0] * 3])
    (wish,) = designed([10.0, 61.0], [1.0, 1.0], late).impossible
    assert (wish.keys, wish.nearest) == ((0,), "black")


def test_more_light_than_was_absorbed_is_named_with_the_factor() -> None:
    bright = designed([61.0, 2000.0], [100.0, 90.0])
    assert [wish.keys for wish in bright.impossible] == [()]
    ratio = float(bright.emitted_over_absorbed[0])
    assert ratio > 1
    dimmer = designed([61.0, 2000.0], [100.0 / ratio, 90.0 / ratio])
    assert dimmer.impossible == ()
    assert float(dimmer.emitted_over_absorbed[0]) == pytest.approx(1.0, rel=1e-3)


def test_the_energy_balance_is_that_of_a_long_integration() -> None:
    """π ∬ L dλ dt by many radiances in the dark and in the light, over what is absorbed."""
    design = designed([61.0, 80.0], [1.0, 0.5])
    for order in (1.0, 1.5):
        if order != 1:
            design = solve(CHARGE, design.keys, RGB, albedo=0.2, order=order)
        times = np.concatenate([np.linspace(0, 60, 301)[:-1], 60 + np.geomspace(1e-2, 1e6, 500)])
        glow = (
            design.radiance_at(0, times)
            - design.albedo * CHARGE.at(np.zeros(len(times), dtype=np.intp), times) / np.pi
        )
        emitted = float(np.trapezoid(np.pi * glow @ RGB.energy, times))
        absorbed = 60 * 0.8 * float(RGB.energy.sum())
        assert design.emitted_over_absorbed[0] == pytest.approx(emitted / absorbed, rel=2e-3)


def test_negative_channels_are_out_of_gamut() -> None:
    keys = Keys.checked(0, [61.0], [[-0.002, 0.01, 0.002]])
    (wish,) = solve(CHARGE, keys, RGB, albedo=0.2).impossible
    assert "gamut" in wish.reason
    assert wish.nearest.startswith("[0, ")


def test_a_colour_beyond_the_spectral_locus_is_out_of_gamut_and_a_spectral_one_is_not() -> None:
    bands = spectral_bands(np.arange(400.0, 701.0, 20.0))
    light = np.zeros((2, bands.count))
    light[0] = 0.01
    programme = LightProgramme.checked([0.0, 60.0], light)
    spectral = bands.to_rgb[:, 6] / bands.to_rgb[:, 6].max() * 1e-3
    assert spectral.min() < 0
    allowed = solve(programme, Keys.checked(0, [61.0], [spectral]), bands, albedo=0.0)
    assert allowed.impossible == ()
    beyond = spectral - np.array([0.3, 0.0, 0.3]) * spectral.max()
    (wish,) = solve(programme, Keys.checked(0, [61.0], [beyond]), bands, albedo=0.0).impossible
    assert "no light" in wish.reason


def test_every_wish_is_one_line() -> None:
    for wish in designed([61.0, 80.0, 100.0], [50.0, 100.0, 200.0]).impossible:
        assert "\n" not in str(wish)
        assert "nearest that is possible" in str(wish)


def weak_light(design: Design) -> float:
    """Energy that weak light of one channel makes leave, over that which is absorbed of it."""
    energy = design.bands.energy
    ratios = [
        np.pi * sum(
            k_e[band] * float(emitted @ energy)
            for k_e, emitted in zip(design.k_e_per_s, design.reradiation, strict=True)
        ) / ((1 - design.albedo[band]) * energy[band])
        for band in range(3)
    ]  # fmt: skip
    return float(max(ratios))


@pytest.mark.parametrize("albedo", [0.3, None])
def test_the_nearest_that_keeps_the_energy(albedo: float | None) -> None:
    """Two places of different light that are to glow alike: full states would, at any light."""
    light = LightProgramme.checked(
        [0.0, 600.0], [[[0.6, 0.5, 0.4], [0.0] * 3], [[0.9, 0.6, 0.6], [0.0] * 3]]
    )
    keys = Keys.checked(
        [0, 1, 0], [601.0, 620.0, 690.0], np.multiply.outer([4.0, 2.5, 0.7], GREEN / 10)
    )
    free, kept = (solve(light, keys, RGB, albedo=albedo, energy=each) for each in ("free", "kept"))
    assert kept.keeps_energy
    assert weak_light(kept) <= 1 + 1e-6
    assert not free.keeps_energy
    assert weak_light(free) > 1
    assert free.cost <= kept.cost * (1 + 1e-6)
    assert kept.delta_e2000.max() < free.delta_e2000.max() + 0.5


def test_too_bright_a_glow_is_as_bright_as_can_be() -> None:
    keys = Keys.checked(0, [61.0, 80.0], np.multiply.outer([100.0, 80.0], GREEN))
    kept = solve(CHARGE, keys, RGB, albedo=0.2, energy="kept")
    assert weak_light(kept) == pytest.approx(1, abs=1e-3)
    assert kept.delta_e2000.max() > 5
    assert kept.emitted_over_absorbed[0] < 1


def test_what_keeps_the_energy_is_left_as_it_is() -> None:
    keys = Keys.checked(0, [61.0, 80.0, 200.0], np.multiply.outer([1.0, 0.5, 0.1], GREEN / 100))
    free, kept = (solve(CHARGE, keys, RGB, albedo=0.2, energy=each) for each in ("free", "kept"))
    np.testing.assert_array_equal(free.reradiation, kept.reradiation)
