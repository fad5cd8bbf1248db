"""Temporal noise from pairs of frames: against the noise that was put in."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from labrig.reduce import Series, SeriesFrame, measure, read_raw, reduce_series

WriteDng = Callable[..., bytes]
Floats = npt.NDArray[np.float64]

HEIGHT, WIDTH = 72, 96
PATCH = (20, 18, 30, 36)
READ_DN, RATE_PER_S, BRIGHT_DN = 6.0, 0.03, 4000.0
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
    times_s: Sequence[float] | Floats = TIMES_S,
) -> list[SeriesFrame]:
    """A decay of `scene`, relative brightness of every pixel, with photon, read and row noise."""
    rng = np.random.default_rng(seed)
    frames = []
    for number, t_s in enumerate(times_s):
        light = BRIGHT_DN * np.exp(-RATE_PER_S * t_s) * scene * COLOURS
        mosaic = 1000 + rng.poisson(light * max(1 + flicker * rng.normal(), 0))
        mosaic = mosaic + READ_DN * rng.normal(size=mosaic.shape)
        mosaic = mosaic + row_dn * rng.normal(size=(HEIGHT, 1))
        path = folder / f"{seed}-{number:06d}.dng"
        path.write_bytes(write_dng(np.clip(np.rint(mosaic), 0, 15000)))
        frames.append(SeriesFrame(path, float(t_s), 1.0, 100.0, unit="decay"))
    return frames


def expected_sigma(series: Series, row_dn: float = 0.0, scene: float = 1.0) -> Floats:
    """Photons, reading, rounding and rows, in DN of the patch's mean."""
    signal = np.multiply.outer(BRIGHT_DN * np.exp(-RATE_PER_S * series.t_s) * scene, WEIGHTS)
    variance = (signal + READ_DN**2 + 1 / 12) / PIXELS + row_dn**2 / ROWS
    return np.asarray(np.sqrt(variance))


@pytest.mark.parametrize("flicker", [0.0, 0.01])
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


def test_clipped_frames_are_in_no_pair(tmp_path: Path, write_dng: WriteDng) -> None:
    """Where pixels are full, nothing scatters: the rest of the series must not hear of it."""
    times_s = np.concatenate([np.full(12, -60.0), TIMES_S])
    series = reduce_series(recorded(tmp_path, write_dng, 2, times_s=times_s), PATCH)
    assert (series.usable == (times_s > 0)).all()
    seen = series.take(np.flatnonzero(series.usable))
    assert np.mean(seen.sigma / expected_sigma(seen)) == pytest.approx(1, abs=0.07)


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
