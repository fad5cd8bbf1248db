"""σ of measured matrices: that of single entries, in every region, with and without repeats."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose

from labrig.foundation.errors import DataError
from labrig.material import (
    InstrumentNoise,
    ReradiationMatrix,
    corrected,
    instrument_noise,
    reradiates,
    with_sigma,
    without_spill,
)
from labrig.report import reradiation_text
from tests.material.reradiation import bfc450
from tests.material.reradiation.noisy_bands import FAR, REGIONS, ULTRAVIOLET, band_sigma
from tests.material.reradiation.synthetic import (
    BRIGHTENER,
    INPUT_NM,
    ORANGE,
    OUTPUT_NM,
    STOKES,
    YELLOW,
    Dye,
    measurement,
    noise_sigma,
)

#: A σ that is 20 % too large or too small is outside of it in every region.
TOLERANCE = 0.13


@cache
def real_tiles() -> tuple[list[ReradiationMatrix], list[ReradiationMatrix]]:
    """Tiles to learn the noise from, and others of the same days."""
    tiles = list(bfc450.tiles())
    return tiles[::2], tiles[1::2]


@pytest.mark.parametrize("common", [pytest.param(0.0, marks=pytest.mark.campaign), 0.75])
@pytest.mark.parametrize("dyes", [(YELLOW,), (BRIGHTENER, ORANGE)], ids=["one dye", "two dyes"])
def test_sigma_without_repeats_is_that_of_the_noise(common: float, dyes: tuple[Dye, ...]) -> None:
    samples = [measurement(seed, *dyes, common=common) for seed in range(20)]
    ratio = np.array([band_sigma(with_sigma(sample.measured)) / sample.sigma for sample in samples])
    for name, region in REGIONS.items():
        assert_allclose(np.mean(ratio[:, region]), 1, atol=TOLERANCE, err_msg=name)
    # Nothing is known of these columns: rather too large.
    assert 1 < np.mean(ratio[:, ULTRAVIOLET]) < 1.5


@pytest.mark.parametrize("common", [pytest.param(0.0, marks=pytest.mark.campaign), 0.75])
def test_sigma_with_repeats_is_that_of_the_noise(common: float) -> None:
    ratio = []
    for seed in range(12):
        sigma = noise_sigma(np.random.default_rng(seed))
        tiles = [
            measurement(1000 * seed + k, common=common, sigma=sigma).measured for k in range(40)
        ]
        sample = measurement(seed, YELLOW, common=common, sigma=sigma)
        estimated = with_sigma(sample.measured, instrument_noise(tiles))
        ratio.append(band_sigma(estimated) / sigma)
    for name, region in (REGIONS | {"ultraviolet": ULTRAVIOLET}).items():
        mean = np.mean(np.array(ratio)[:, region])
        assert_allclose(mean, 1, atol=TOLERANCE, err_msg=name)


def test_errors_are_as_large_as_sigma_says() -> None:
    pulls = []
    for seed in range(40):
        sample = measurement(seed, YELLOW, ORANGE, common=0.0)
        estimated = with_sigma(sample.measured)
        difference = (estimated.reradiation - sample.truth.reradiation) * 10
        pulls.append(difference / band_sigma(estimated))
    # A σ from a few entries is often too small by chance, which makes some pulls large.
    rms = np.sqrt(np.mean(np.array(pulls)[:, FAR & (INPUT_NM >= 440)] ** 2))
    assert_allclose(rms, 1.02, atol=0.1)


def test_a_dark_samples_reflectance_is_as_uncertain_as_its_neighbours() -> None:
    dark = replace(measurement(3).measured, reflectance=np.full(41, 0.0))
    estimated = with_sigma(dark)
    assert estimated.reflectance_sigma is not None
    diagonal = [band_sigma(estimated)[i, i + 8] for i in range(41)]
    assert_allclose(estimated.reflectance_sigma, diagonal)


def test_reflectance_is_less_certain_on_slopes_and_in_white() -> None:
    step = 0.1 + 0.8 / (1 + np.exp(-(OUTPUT_NM - 580) / 10))
    estimated = with_sigma(replace(measurement(3).measured, reflectance=step))
    assert estimated.reflectance_sigma is not None
    own = np.array([band_sigma(estimated)[i, i + 8] for i in range(41)])
    beyond = np.sqrt(estimated.reflectance_sigma**2 - own**2)
    assert_allclose(beyond[-1], 0.0016 * 0.9, rtol=0.01)
    assert_allclose(beyond[20], np.hypot(0.2 * (step[21] - step[19]) / 20, 0.0016 * 0.5), rtol=1e-9)


@settings(max_examples=15, deadline=None)
@given(scale=st.floats(1e-3, 1e3), row=st.integers(8, 28), size=st.floats(-1, 1))
def test_sigma_scales_with_the_noise_and_no_single_entry_rules_it(
    scale: float, row: int, size: float
) -> None:
    measured = measurement(row, common=0.0).measured
    before = band_sigma(with_sigma(measured))
    bad = measured.reradiation.copy()
    bad[row, row + 12] += size
    after = band_sigma(with_sigma(replace(measured, reradiation=bad * scale))) / scale
    assert_allclose(np.median(after / before), 1, atol=0.03)
    # An entry of up to six σ may be noise, and a larger one is none.
    assert (after / before).max() < 2


def test_numbers_stay_and_gaps_are_left_out() -> None:
    measured = measurement(5, YELLOW).measured
    gaps = measured.reradiation.copy()
    gaps[7] = np.nan
    found = with_sigma(replace(measured, reradiation=gaps))
    np.testing.assert_array_equal(found.reradiation, gaps)
    np.testing.assert_array_equal(found.reflectance, measured.reflectance)
    assert_allclose(band_sigma(found), band_sigma(with_sigma(measured)), rtol=0.4)


def test_what_gives_no_sigma_is_refused_in_one_line() -> None:
    sample = measurement(0, YELLOW)
    noise = instrument_noise([measurement(1).measured])
    other = sample.measured.rebinned(INPUT_NM[::2], OUTPUT_NM[::2])
    with pytest.raises(DataError, match="on the bands of 'sample 0'"):
        with_sigma(other, noise)
    with pytest.raises(DataError, match="zeros only"):
        with_sigma(sample.truth)
    above = np.where(STOKES, sample.measured.reradiation, np.nan)
    stokes = replace(sample.measured, reradiation=above)
    with pytest.raises(DataError, match=r"15 or more anti-Stokes entries .* got 0"):
        with_sigma(stokes)
    assert (band_sigma(with_sigma(stokes, noise)) > 0).all()
    with pytest.raises(DataError, match="got none"):
        instrument_noise([])
    with pytest.raises(ValueError, match="bands of 'sample 0'"):
        instrument_noise([sample.measured, other])
    column = sample.measured.reradiation.copy()
    column[:, 4] = np.nan
    with pytest.raises(DataError, match="at 340 nm"):
        instrument_noise([replace(sample.measured, reradiation=column)])


@pytest.mark.parametrize("emits", [True, False])
def test_one_light_suffices_to_tell_re_radiation(emits: bool) -> None:
    """LEDs measure single columns; what one of them excites has no neighbour that agrees."""
    nm = np.arange(400.0, 701.0, 10.0)
    noise = 1e-4 * np.random.default_rng(3).standard_normal((31, 31))
    values = np.full((31, 31), np.nan)
    values[:, [2, 12, 22]] = noise[:, [2, 12, 22]]
    if emits:
        values[6:10, 2] += 1e-3 * np.array([1.0, 2.0, 2.0, 1.0])
    matrix = replace(
        ReradiationMatrix.from_bands("", nm, nm, values),
        reradiation_sigma=np.full((31, 31), 1e-5),
    )
    assert reradiates(matrix) == emits
    told = reradiation_text(matrix)
    assert ("420 nm to" in told) == emits
    assert ("none above the noise" in told) != emits


@pytest.mark.usefixtures("shared_data")
class TestRealTiles:
    """Tiles do not re-radiate: what is there off the diagonal is the error."""

    def rms_pull(self, noise: InstrumentNoise | None) -> dict[str, float]:
        tiles = [with_sigma(tile, noise) for tile in real_tiles()[1]]
        pulls = np.array([tile.reradiation * 10 / band_sigma(tile) for tile in tiles])
        regions = REGIONS | {"ultraviolet": ULTRAVIOLET}
        return {name: np.sqrt(np.mean(pulls[:, each] ** 2)) for name, each in regions.items()}

    def test_pulls_of_other_tiles_with_and_without_repeats(self) -> None:
        learnt, alone = (self.rms_pull(it) for it in (instrument_noise(real_tiles()[0]), None))
        assert learnt == pytest.approx(dict.fromkeys(learnt, 1), abs=TOLERANCE)
        assert 0.7 < alone.pop("ultraviolet") < 1.2
        assert alone == pytest.approx(dict.fromkeys(alone, 1), abs=TOLERANCE)

    @pytest.mark.campaign
    def test_tiles_do_not_reradiate_and_papers_do(self) -> None:
        tiles = [tile for half in real_tiles() for tile in half]
        assert np.mean([reradiates(with_sigma(tile)) for tile in tiles]) < 0.02
        papers = [paper for paper in bfc450.samples() if paper.reradiated_fraction.max() > 0.15]
        assert len(papers) > 25
        assert all(reradiates(with_sigma(paper)) for paper in papers)

    @pytest.mark.campaign
    def test_pulls_of_sums_over_columns(self) -> None:
        tiles = [corrected(tile) for tile in real_tiles()[1]]
        sums = np.array([tile.reradiated_fraction[:40] for tile in tiles])
        sigmas = [tile.reradiated_fraction_sigma for tile in tiles]
        pulls = sums / np.array([sigma[:40] for sigma in sigmas if sigma is not None])
        for name, columns in {"ultraviolet": slice(0, 8), "430-600 nm": slice(13, 31)}.items():
            rms = np.sqrt(np.mean(pulls[:, columns] ** 2))
            assert_allclose(rms, 1, atol=TOLERANCE, err_msg=name)

    def test_scatter_of_reflectance_between_repeats(self) -> None:
        learnt, others = real_tiles()
        noise = instrument_noise(learnt)
        groups: list[list[ReradiationMatrix]] = []
        for tile in others:
            for group in groups:
                if np.median(abs(group[0].reflectance - tile.reflectance)) < 0.01:
                    group.append(tile)
                    break
            else:
                groups.append([tile])
        pulls = []
        for group in (group for group in groups if len(group) > 4):
            values = np.array([tile.reflectance for tile in group])
            sigma = np.array([with_sigma(tile, noise).reflectance_sigma for tile in group])
            pulls.append((values - values.mean(axis=0)) / sigma / np.sqrt(1 - 1 / len(group)))
        assert len(pulls) >= 10
        # One file in a hundred has a wrong row.
        scatter = 1.4826 * np.median(np.abs(np.concatenate(pulls)))
        assert_allclose(scatter, 1, atol=TOLERANCE)

    def test_spill_is_gone(self) -> None:
        learnt, others = real_tiles()
        noise = instrument_noise(learnt)
        rows = np.arange(1, 41)
        pulls = {}
        for name, change in (("before", lambda matrix: matrix), ("after", without_spill)):
            changed = [change(with_sigma(tile, noise)) for tile in others]
            above = [tile.reradiation[rows, rows + 7] * 10 for tile in changed]
            pulls[name] = np.array(above) / [band_sigma(tile)[rows, rows + 7] for tile in changed]
        assert np.sqrt(np.mean(pulls["before"] ** 2)) > 2.5
        assert 0.75 < np.sqrt(np.mean(pulls["after"] ** 2)) < 1.1
        assert abs(np.mean(pulls["after"])) < 0.25
