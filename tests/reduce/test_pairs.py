"""Temporal noise from pairs of frames: against the noise that was put in."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from labrig.reduce import SeriesFrame, measure, read_raw, reduce_patches, reduce_series
from labrig.results import Series

WriteDng = Callable[..., bytes]
Floats = npt.NDArray[np.float64]

HEIGHT, WIDTH = 72, 96
PATCH = (20, 18, 30, 36)
READ_DN, ROW_DN, RATE_PER_S, BRIGHT_DN = 6.0, 3.0, 0.03, 4000.0
TIMES_S: Floats = np.asarray(0.5 + 5.0 * np.arange(24))
#: Pixels of R, G and B in the patch, and its rows that have them.
PIXELS, ROWS = np.array([270, 540, 270]), np.array([18, 36, 18])
WEIGHTS = np.array([0.3, 1.0, 0.5])
COLOURS = np.tile([[0.3, 1.0], [1.0, 0.5]], (HEIGHT // 2, WIDTH // 2))


def recorded(
    folder: Path,
    write_dng: WriteDng,
    seed: int,
    *,
    scene: Floats | float = 1.0,
    row_dn: float = 0.0,
    flicker: float = 0.0,
    crosstalk: float = 0.0,
    times_s: Sequence[float] | Floats = TIMES_S,
) -> list[SeriesFrame]:
    """A decay of `scene`, relative brightness of every pixel, with photon, read and row noise.

    `crosstalk` is the fraction of a pixel's charge that each of its four neighbours shows instead.
    """
    rng = np.random.default_rng(seed)
    frames = []
    for number, t_s in enumerate(times_s):
        light = BRIGHT_DN * np.exp(-RATE_PER_S * t_s) * scene * COLOURS
        charge = rng.poisson(light * max(1 + flicker * rng.normal(), 0)).astype(np.float64)
        mosaic = 1000 + shared_with_neighbours(charge, crosstalk)
        mosaic = mosaic + READ_DN * rng.normal(size=mosaic.shape)
        mosaic = mosaic + row_dn * rng.normal(size=(HEIGHT, 1))
        path = folder / f"{seed}-{number:06d}.dng"
        path.write_bytes(write_dng(np.clip(np.rint(mosaic), 0, 15000)))
        frames.append(SeriesFrame(path, float(t_s), 1.0, 100.0, unit="decay"))
    return frames


def shared_with_neighbours(charge: Floats, fraction: float) -> Floats:
    around = sum(np.roll(charge, step, axis) for axis in (0, 1) for step in (-1, 1))
    return np.asarray((1 - 4 * fraction) * charge + fraction * around)


def expected_sigma(
    series: Series, row_dn: float = 0.0, scene: float = 1.0, crosstalk: float = 0.0
) -> Floats:
    """Photons, reading, rounding and rows, in DN of the patch's mean."""
    x, y, w, h = PATCH
    inside = np.zeros((HEIGHT, WIDTH))
    inside[y : y + h, x : x + w] = 1
    photons = []  # of R, G and B at a brightness of 1
    for level, pixels in zip(WEIGHTS, PIXELS, strict=True):
        fraction = shared_with_neighbours(inside * (level == COLOURS) / pixels, crosstalk)
        photons.append(np.sum(np.square(fraction) * COLOURS))
    light = BRIGHT_DN * np.exp(-RATE_PER_S * series.t_s) * scene
    variance = np.multiply.outer(light, photons) + (READ_DN**2 + 1 / 12) / PIXELS
    return np.asarray(np.sqrt(variance + row_dn**2 / ROWS))


@pytest.mark.parametrize("flicker", [pytest.param(0.0, marks=pytest.mark.campaign), 0.01])
@pytest.mark.parametrize("row_dn", [0.0, 3.0])
def test_noise_that_rows_share_is_counted(
    tmp_path: Path, write_dng: WriteDng, row_dn: float, flicker: float
) -> None:
    ratios = []
    for seed in range(3):
        frames = recorded(tmp_path, write_dng, seed, row_dn=row_dn, flicker=flicker)
        series = reduce_series(frames, PATCH)
        ratios.append(series.sigma / expected_sigma(series, row_dn))
    # 23 pairs of 15 degrees of freedom: σ to 4 % in each, the worst frame less well.
    assert np.mean(ratios) == pytest.approx(1, abs=0.05)
    assert np.abs(np.array(ratios) - 1).max() < 0.35


def expected_correlation(crosstalk: float) -> Floats:
    """Of the photon noise of the patch's means, R, G and B."""
    x, y, w, h = PATCH
    inside = np.zeros((HEIGHT, WIDTH))
    inside[y : y + h, x : x + w] = 1
    fractions = [
        shared_with_neighbours(inside * (level == COLOURS) / pixels, crosstalk)
        for level, pixels in zip(WEIGHTS, PIXELS, strict=True)
    ]
    covariance = np.array([[np.sum(a * b * COLOURS) for b in fractions] for a in fractions])
    length = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(length, length))


@pytest.mark.parametrize("crosstalk", [0.0, 0.04])
def test_charge_that_strays_correlates_the_channels(
    tmp_path: Path, write_dng: WriteDng, crosstalk: float
) -> None:
    found = []
    for seed in range(4):
        frames = recorded(tmp_path, write_dng, seed, crosstalk=crosstalk, times_s=TIMES_S[:12])
        correlation = reduce_series(frames, PATCH).correlation
        assert correlation is not None
        assert np.linalg.eigvalsh(correlation).min() > 0
        found.append(correlation)
    expected = expected_correlation(crosstalk)
    assert expected[0, 1] > 7 * crosstalk - 1e-9
    # 11 pairs of 15 degrees of freedom, 4 times: 0.04 each.
    assert np.mean(found, axis=0) == pytest.approx(expected, abs=0.12)


def test_rows_read_together_correlate_the_channels(tmp_path: Path, write_dng: WriteDng) -> None:
    """All of the noise in the dark; R and B have no row in common, G has all of them."""
    frames = recorded(tmp_path, write_dng, 1, row_dn=30.0, scene=0.01)
    correlation = reduce_series(frames, PATCH).correlation
    assert correlation is not None
    red_green, red_blue, green_blue = correlation[[0, 0, 1], [1, 2, 2]]
    assert red_green == pytest.approx(0.7, abs=0.1)
    assert green_blue == pytest.approx(0.7, abs=0.1)
    assert red_blue == pytest.approx(0.0, abs=0.15)


def test_too_few_frames_tell_no_correlation(tmp_path: Path, write_dng: WriteDng) -> None:
    frames = recorded(tmp_path, write_dng, 1, crosstalk=0.04, times_s=[0.5, 5.5])
    assert reduce_series(frames, PATCH).correlation == pytest.approx(np.eye(3))


def test_dark_frames_tell_the_noise_of_reading(tmp_path: Path, write_dng: WriteDng) -> None:
    """A decay that is faint at its end only says little of it by itself."""
    noise = {"row_dn": ROW_DN, "crosstalk": 0.03}

    def faintest(series: Series) -> float:
        return float(np.mean((series.sigma / expected_sigma(series, **noise))[-8:]))

    alone, with_darks = [], []
    for seed in range(5):
        frames = recorded(tmp_path, write_dng, seed, times_s=TIMES_S[:16], **noise)
        darks = recorded(tmp_path, write_dng, 100 + seed, times_s=np.zeros(12), scene=0.0, **noise)
        alone.append(faintest(reduce_series(frames, PATCH)))
        with_darks.append(faintest(reduce_series(frames, PATCH, darks)))
    assert np.mean(with_darks) == pytest.approx(1, abs=0.05)
    assert np.std(with_darks) < 0.8 * np.std(alone)


def test_dark_frames_of_different_exposures_are_no_pair(
    tmp_path: Path, write_dng: WriteDng
) -> None:
    """Where rows start from different levels, they differ by more than noise."""
    rng = np.random.default_rng(5)
    frames = recorded(tmp_path, write_dng, 1)
    start = 1000 + 40 * rng.random((HEIGHT, 1)) * np.ones(WIDTH)
    darks = []
    for number, exposure_s in enumerate([0.5, 2.0, 8.0] * 2):
        current = rng.poisson(3 * exposure_s, start.shape)
        mosaic = start + current + READ_DN * rng.normal(size=start.shape)
        path = tmp_path / f"dark-{number}.dng"
        path.write_bytes(write_dng(np.rint(mosaic)))
        darks.append(SeriesFrame(path, 0.0, exposure_s, 100.0))
    series = reduce_series(frames, PATCH, darks)
    assert np.mean(series.sigma / expected_sigma(series)) == pytest.approx(1, abs=0.1)


def test_neighbours_and_structure_of_the_sample_do_not_matter(
    tmp_path: Path, write_dng: WriteDng
) -> None:
    """Bright paint around a dim, rough patch: a single frame takes both for noise."""
    rng = np.random.default_rng(1)
    x, y, w, h = PATCH
    scene = np.full((HEIGHT, WIDTH), 3.0)
    scene[y : y + h, x : x + w] = 0.2 * (1 + 0.1 * rng.normal(size=(h, w)))
    frames = recorded(tmp_path, write_dng, 1, scene=np.maximum(scene, 0.0))
    series = reduce_series(frames, PATCH)
    ratio = series.sigma / expected_sigma(series, scene=0.2)
    assert ratio.mean() == pytest.approx(1, abs=0.08)
    alone = measure(read_raw(frames[0].path), PATCH).channels["G"].sigma
    assert alone > 1.5 * series.sigma[0, 1]


def test_narrow_patches_of_few_frames_have_the_noise_of_all_together(
    tmp_path: Path, write_dng: WriteDng
) -> None:
    """A bright stripe along the patches, dark beside: a single frame mixes its noise with the dark.

    Brightness falls by half from patch to patch, so that each has its own.
    """
    wide, high, top = 6, 12, 30
    patches = {f"{x}": (x, top, wide, high) for x in range(12, 84, wide)}
    scene = np.zeros((HEIGHT, WIDTH))
    scene[top : top + high] = 0.5 ** (np.arange(WIDTH) / wide / 2)
    frames = recorded(tmp_path, write_dng, 3, scene=scene, times_s=TIMES_S[:5])
    found = reduce_patches(frames, patches)
    ratio = []
    for x, y, w, h in patches.values():
        series = found[f"{x}"]
        here = (scene * COLOURS)[y : y + h, x : x + w]
        for channel, level in enumerate(WEIGHTS):
            of_channel = COLOURS[y : y + h, x : x + w] == level
            light = BRIGHT_DN * np.exp(-RATE_PER_S * series.t_s) * here[of_channel].mean()
            expected = np.sqrt((light + READ_DN**2 + 1 / 12) / of_channel.sum())
            ratio.append(series.sigma[:, channel] / expected)
    # 12 patches of 4 pairs and 5 degrees of freedom: σ to 5 % of each channel.
    assert np.abs(np.mean(np.reshape(ratio, (-1, 3, 5)), axis=(0, 2)) - 1).max() < 0.12
    assert np.mean(ratio) == pytest.approx(1, abs=0.08)


def test_clipped_frames_are_in_no_pair(tmp_path: Path, write_dng: WriteDng) -> None:
    """Where pixels are full, nothing scatters: the rest of the series must not hear of it."""
    times_s = np.concatenate([np.full(12, -60.0), TIMES_S])
    series = reduce_series(recorded(tmp_path, write_dng, 2, times_s=times_s), PATCH)
    assert (series.usable == (times_s > 0)).all()
    seen = series.take(np.flatnonzero(series.usable))
    assert np.mean(seen.sigma / expected_sigma(seen)) == pytest.approx(1, abs=0.07)


def test_a_bright_frame_before_dark_ones_tells_its_own_noise(
    tmp_path: Path, write_dng: WriteDng
) -> None:
    """Scaled to a dark frame, it leaves nothing of its noise in the difference."""
    ratios = []
    for seed in range(30, 35):
        times_s = [0.0, *(400.0 + TIMES_S)]
        series = reduce_series(recorded(tmp_path, write_dng, seed, times_s=times_s), PATCH)
        ratios.append(series.sigma / expected_sigma(series))
    assert np.median(ratios, axis=0)[0] == pytest.approx(1, abs=0.25)
    assert np.max(np.abs(np.log(ratios)[:, 0])) < np.log(2)
    assert np.median(ratios, axis=0)[1:].mean() == pytest.approx(1, abs=0.1)


def test_few_frames_say_each_for_itself(tmp_path: Path, write_dng: WriteDng) -> None:
    frames = recorded(tmp_path, write_dng, 4, times_s=TIMES_S[:3])
    series = reduce_series(frames, PATCH)
    for frame, sigma in zip(frames, series.sigma, strict=True):
        alone = measure(read_raw(frame.path), PATCH).channels
        assert sigma.tolist() == [alone[name].sigma for name in series.channels]


def test_frames_without_noise_have_an_uncertainty(tmp_path: Path, write_dng: WriteDng) -> None:
    path = tmp_path / "still.dng"
    path.write_bytes(write_dng(np.full((HEIGHT, WIDTH), 1234)))
    frames = [SeriesFrame(path, float(t_s), 1.0, 100.0) for t_s in TIMES_S]
    series = reduce_series(frames, PATCH)
    assert (series.sigma > 0).all()
    assert np.isfinite(series.sigma).all()
