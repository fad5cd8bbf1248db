"""Photon transfer, factors and linearity of frames that were made up: are values and σ right?"""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.calibration import Noise
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.protocols.camera_calibration.analysis.factors import CardFrame, fit_factors
from labrig.protocols.camera_calibration.analysis.linearity import Bend, fit_bend, fit_linearity
from labrig.protocols.camera_calibration.analysis.photon_transfer import (
    Pair,
    measure_pair,
    photon_transfer,
)
from labrig.protocols.camera_calibration.result import PhotonTransfer
from labrig.reduce import RawFrame
from tests.pulls import assert_sigma_is_right

GAIN, READ_E, BLACK = 2.0, 8.0, 1000.0
WHOLE = (0.0, 0.0, 1.0, 1.0)
#: A sensor whose numbers are in proportion to the light.
LINEAR = Bend(np.zeros(2), 1e-8 * np.eye(2), 12_000.0)


def frame(rng: np.random.Generator, electrons: float, fraction: float = 0.0) -> RawFrame:
    """Photons, charge shared with four neighbours, reading; a shaded card that flickers."""
    shape = (80, 96)
    shading = 1 - 0.2 * np.linspace(-1, 1, shape[1]) ** 2
    light = rng.poisson(electrons * shading * (1 + 0.01 * rng.standard_normal()), shape)
    around = sum(np.roll(light, step, axis) for axis in (0, 1) for step in (-1, 1))
    kept = (1 - 4 * fraction) * light + fraction * around + READ_E * rng.standard_normal(shape)
    mosaic = np.rint(kept / GAIN + BLACK).astype(np.uint16)
    return RawFrame(mosaic, "RGGB", (BLACK,) * 4, 60_000.0)


def measured(one: RawFrame, other: RawFrame) -> Pair:
    return measure_pair(one, other, WHOLE, 0.0)


def calibrated(seed: int, fraction: float) -> PhotonTransfer:
    rng = np.random.default_rng(seed)
    lit = [
        measured(frame(rng, level, fraction), frame(rng, level, fraction)) for level in (800, 16000)
    ]
    dark = [measured(frame(rng, 0, fraction), frame(rng, 0, fraction))]
    return photon_transfer(100, lit, dark, LINEAR)


def test_gain_is_right_and_as_uncertain_as_it_says() -> None:
    noises = [calibrated(seed, 0.0).noise for seed in range(220)]
    assert_sigma_is_right([(one.gain_e_per_dn - GAIN) / one.gain_e_per_dn_sigma for one in noises])
    assert np.mean([one.read_noise_e for one in noises]) == pytest.approx(READ_E, rel=0.01)


def test_charge_that_neighbours_share_is_no_gain() -> None:
    """Each of four neighbours gets 3 % of a pixel's charge, and gives of its own."""
    found = [calibrated(seed, 0.03) for seed in range(40)]
    assert np.mean([one.shared for one in found]) == pytest.approx(0.24, rel=0.2)
    assert all(one.neighbours_share_noise for one in found)
    pulls = [(one.noise.gain_e_per_dn - GAIN) / one.noise.gain_e_per_dn_sigma for one in found]
    assert abs(np.mean(pulls)) < 0.6


def test_light_without_noise_is_no_photon_transfer() -> None:
    rng = np.random.default_rng(1)
    dark = measured(frame(rng, 0), frame(rng, 0))
    with pytest.raises(DataError, match="at two levels"):
        photon_transfer(100, [dark], [dark], LINEAR)
    flat = RawFrame(np.full((80, 96), 5000, np.uint16), "RGGB", (BLACK,) * 4, 60_000.0)
    still = measured(flat, flat)
    with pytest.raises(DataError, match="half a step of the camera's numbers"):
        photon_transfer(100, [still, still], [dark], LINEAR)


@pytest.mark.parametrize("loss", [-0.05, 0.03])
def test_a_bend_near_white_is_no_gain(loss: float) -> None:
    """Light of other, unknown brightness in every frame; a sensor that loses some at white."""
    white_dn, pulls, bends = 12_000.0, [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)

        def bent(light_dn: float, rng: np.random.Generator = rng) -> RawFrame:
            colours = np.tile([[0.6, 1.0], [1.0, 0.4]], (40, 48))
            light = rng.poisson(GAIN * light_dn * colours * (1 + 0.01 * rng.standard_normal()))
            signal = light / GAIN * (1 - loss * light / GAIN / white_dn)
            noise = READ_E / GAIN * rng.standard_normal(signal.shape)
            return RawFrame(
                np.rint(signal + noise + BLACK).astype(np.uint16), "RGGB", (BLACK,) * 4, 60_000.0
            )

        pairs = [(bent(level), bent(level)) for level in (600, 2000, 4000, 6000, 8000)]
        pixels = [one.mosaic.astype(float) - BLACK for pair in pairs for one in pair]
        means = np.array([[each[::2, ::2].mean(), each[::2, 1::2].mean(), each[1::2, 1::2].mean()]
                          for each in pixels])  # fmt: skip
        sigma = np.sqrt(means / GAIN + 20.0) / np.sqrt(means.size * 64)
        bend = fit_bend(means, sigma, np.zeros(len(means), np.intp), white_dn)
        dark = [measured(bent(0.0), bent(0.0))]
        found = photon_transfer(100, [measured(*pair) for pair in pairs], dark, bend)
        pulls.append((found.noise.gain_e_per_dn - GAIN) / found.noise.gain_e_per_dn_sigma)
        bends.append(found.bend.value)
    assert_sigma_is_right(pulls)
    assert abs(np.mean(pulls)) < 0.5
    assert np.mean(bends) == pytest.approx(-loss, rel=0.15)


SHAPE = (160, 160)
SPREADS = {"even": 1.0, "in a part of a step": 0.25, "of all pixels alike": 0.0}


def dark_pair(rng: np.random.Generator, noise_dn: float, levels_dn: FloatArray) -> Pair:
    numbers = [
        np.rint(BLACK + levels_dn + noise_dn * rng.standard_normal(SHAPE)).astype(np.uint16)
        for _ in range(2)
    ]
    return measured(*(RawFrame(each, "RGGB", (BLACK,) * 4, 60_000.0) for each in numbers))


def read_noise(dark: Pair) -> Noise:
    rng = np.random.default_rng(1)
    lit = [measured(frame(rng, 9000), frame(rng, 9000)) for _ in range(2)]
    return photon_transfer(100, lit, [dark], LINEAR).noise


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.05, 3.0), st.floats(0.0, 1.0), st.sampled_from(list(SPREADS)), st.integers(0, 10**6)
)
def test_read_noise_is_right_or_below_a_limit_wherever_black_lies_in_a_step(
    noise_dn: float, level_dn: float, spread: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    levels = level_dn + SPREADS[spread] * rng.standard_normal(SHAPE)
    noise = read_noise(dark_pair(rng, noise_dn, levels))
    read, sigma = noise.read_noise_e, noise.read_noise_e_sigma
    # σ of the gain is that of the read noise in electrons, too.
    expected = noise_dn * noise.gain_e_per_dn
    if noise.read_noise_is_limit:
        assert read > 0.95 * expected
        assert read < 0.35 * noise.gain_e_per_dn
    else:
        assert abs(read - expected) < 5 * sigma
        assert sigma < 0.35 * read
    assert not noise.read_noise_is_limit or noise_dn < 0.3
    if spread == "even":
        assert not noise.read_noise_is_limit


@pytest.mark.parametrize("noise_dn", [0.8, 1.0])
def test_sigma_of_read_noise_is_right_of_many_pairs_whose_levels_are_half_a_step_apart(
    noise_dn: float,
) -> None:
    """What all pairs share is not averaged, and pairs are not chosen by what they scatter."""
    levels = 0.1 + 0.5 * (np.arange(SHAPE[1]) % 2) * np.ones(SHAPE)
    bright = np.random.default_rng(1)
    lit = [measured(frame(bright, 9000), frame(bright, 9000)) for _ in range(2)]
    pulls = []
    for seed in range(80):
        rng = np.random.default_rng([21, seed])
        found = photon_transfer(
            100, lit, [dark_pair(rng, noise_dn, levels) for _ in range(4)], LINEAR
        )
        noise, gain = found.noise, found.noise.gain_e_per_dn
        by_gain = noise.read_noise_e * noise.gain_e_per_dn_sigma / gain
        sigma = np.sqrt(noise.read_noise_e_sigma**2 - by_gain**2)
        pulls.append((noise.read_noise_e - noise_dn * gain) / sigma)
    assert_sigma_is_right(pulls)
    assert abs(np.mean(pulls)) < 0.4


def test_numbers_in_steps_of_four_are_rounded_to_four() -> None:
    rng = np.random.default_rng(5)
    fine = dark_pair(rng, 0.8, rng.standard_normal(SHAPE))
    numbers = [4 * np.rint((1000 + 5 * rng.standard_normal(SHAPE)) / 4) for _ in range(2)]
    coarse = measured(*(RawFrame(each.astype(np.uint16), "RGGB", (BLACK,) * 4, 6e4)
                        for each in numbers))  # fmt: skip
    assert (fine.scatter.step_dn, coarse.scatter.step_dn) == (1, 4)
    noise = read_noise(coarse)
    assert noise.read_noise_e / noise.gain_e_per_dn == pytest.approx(5.0, rel=0.02)


def bracket(rng: np.random.Generator, flicker: float) -> list[CardFrame]:
    """A lamp that loses 2 % in a unit; 10 ms are really 10.3 ms, ISO 200 is really 196."""
    frames = []

    def add(unit: str, role: str, number: int, exposure_s: float, iso: float) -> None:
        true = exposure_s * (1.03 if exposure_s == 0.01 else 1.0) * (0.98 if iso == 200 else 1.0)
        light = np.log(true * iso) - 0.001 * number + flicker * rng.standard_normal()
        frames.append(
            CardFrame(unit, role, 10.0 * number, exposure_s, iso, None, float(light), 1e-4)
        )

    for number in range(20):
        add("repeats", "repeat", number, 0.02, 100)
        add("shutter", "bracket", number, (0.02, 0.01, 0.1, 0.05)[number % 4], 100)
        add("iso", "bracket", number, 0.02, (100, 200)[number % 2])
    return frames


def test_factors_and_flicker_are_right_and_as_uncertain_as_they_say() -> None:
    pulls, flickers = [], []
    for seed in range(60):
        found = fit_factors(bracket(np.random.default_rng(seed), 0.007), 100, None)
        assert [one.setting for one in found.shutter] == [0.01, 0.02, 0.05, 0.1]
        assert (found.shutter[-1].factor, found.aperture) == (1.0, ())
        shutter, gain = found.shutter[0], found.iso_gain[1]
        pulls += [(shutter.factor - 1.03) / shutter.sigma, (gain.factor - 0.98) / gain.sigma]
        flickers.append(found.flicker)
    assert_sigma_is_right(pulls)
    assert abs(np.mean(pulls)) < 0.35
    value, sigma = np.array([(one.value, one.sigma) for one in flickers]).T
    assert np.mean(value) == pytest.approx(0.007, rel=0.04)
    assert np.std(value) == pytest.approx(np.mean(sigma), rel=0.35)


def test_too_few_frames_have_no_factors() -> None:
    with pytest.raises(DataError, match="is the card lit"):
        fit_factors([], 100, None)


def test_a_bent_sensor_is_seen_through_flicker() -> None:
    """One that compresses by 3 % at full range; every frame is of another, unknown brightness."""
    rng = np.random.default_rng(3)
    light = np.geomspace(100, 9000, 80) * np.exp(0.05 * rng.standard_normal(80))
    true = np.outer(light, [0.6, 1.0, 0.4])
    level = true * (1 - 0.03 * true / 10_000)
    sigma = np.sqrt(level) / 30
    seen = level + sigma * rng.standard_normal(level.shape)
    found = fit_linearity(seen, sigma, np.zeros(80, np.intp), 10_000.0, None)
    assert found is not None
    expected = np.log(1 - 0.03 * np.array(found.level_dn) / 10_000)
    # An even power at all levels cannot be told; a slope of it is left in both.
    assert np.abs(np.array(found.deviation) - expected).max() < 0.004
    assert abs(found.deviation[-1]) > 4 * found.sigma[-1]


def test_a_dark_level_that_is_a_little_wrong_is_no_bend() -> None:
    rng = np.random.default_rng(4)
    true = np.outer(np.geomspace(100, 9000, 80), [0.6, 1.0, 0.4])
    sigma = np.sqrt(true) / 30
    seen = true + sigma * rng.standard_normal(true.shape) + [0.5, 0.0, -0.5]
    found = fit_linearity(seen, sigma, np.zeros(80, np.intp), 10_000.0, None)
    assert found is not None
    assert (np.abs(found.deviation) < 3 * np.array(found.sigma)).all()


def test_a_monochrome_sensor_cannot_tell_its_linearity_like_this() -> None:
    level = np.geomspace(100, 9000, 20)[:, np.newaxis]
    assert fit_linearity(level, 0.01 * level, np.zeros(20, np.intp), 1e4, None) is None
