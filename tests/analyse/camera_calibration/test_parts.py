"""Photon transfer, factors and linearity of frames that were made up: are values and σ right?"""

import numpy as np
import pytest
from numpy.typing import NDArray

from labrig.analyse.camera_calibration.factors import CardFrame, fit_factors
from labrig.analyse.camera_calibration.linearity import fit_linearity
from labrig.analyse.camera_calibration.photon_transfer import photon_transfer, scatter
from labrig.errors import DataError
from labrig.reduce import RawFrame
from tests.pulls import assert_sigma_is_right

FloatArray = NDArray[np.float64]

GAIN, READ_E, BLACK = 2.0, 8.0, 1000.0
WHOLE = (0.0, 0.0, 1.0, 1.0)


def frame(rng: np.random.Generator, electrons: float, fraction: float = 0.0) -> RawFrame:
    """Photons, charge shared with four neighbours, reading; a shaded card that flickers."""
    shape = (80, 96)
    shading = 1 - 0.2 * np.linspace(-1, 1, shape[1]) ** 2
    light = rng.poisson(electrons * shading * (1 + 0.01 * rng.standard_normal()), shape)
    around = sum(np.roll(light, step, axis) for axis in (0, 1) for step in (-1, 1))
    kept = (1 - 4 * fraction) * light + fraction * around + READ_E * rng.standard_normal(shape)
    mosaic = np.rint(kept / GAIN + BLACK).astype(np.uint16)
    return RawFrame(mosaic, "RGGB", (BLACK,) * 4, 60_000.0)


@pytest.mark.parametrize("fraction", [0.0, 0.03])
def test_gain_is_right_and_as_uncertain_as_it_says(fraction: float) -> None:
    pulls, read = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        lit = [
            scatter(frame(rng, level, fraction), frame(rng, level, fraction), WHOLE, 0.0)
            for level in (500, 2000, 8000, 20000)
        ]
        dark = [
            scatter(frame(rng, 0, fraction), frame(rng, 0, fraction), WHOLE, 0.0) for _ in range(2)
        ]
        found = photon_transfer(100, lit, dark)
        assert found.neighbours_share_noise == (fraction > 0)
        pulls.append((found.noise.gain_e_per_dn - GAIN) / found.noise.gain_e_per_dn_sigma)
        read.append(found.noise.read_noise_e)
    assert abs(np.mean(pulls)) < 1.0
    assert 0.5 < np.std(pulls) < 1.7
    assert np.mean(read) == pytest.approx(READ_E, rel=0.03)


def test_light_without_noise_is_no_photon_transfer() -> None:
    rng = np.random.default_rng(1)
    dark = scatter(frame(rng, 0), frame(rng, 0), WHOLE, 0.0)
    with pytest.raises(DataError, match="at two levels"):
        photon_transfer(100, [dark], [dark])
    flat = RawFrame(np.full((80, 96), 5000, np.uint16), "RGGB", (BLACK,) * 4, 60_000.0)
    still = scatter(flat, flat, WHOLE, 0.0)
    with pytest.raises(DataError, match="rises with the light"):
        photon_transfer(100, [still, still], [dark])


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
