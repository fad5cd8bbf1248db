"""Oracle: frames clipped, or not, by the test."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings, strategies as st

from labrig.reduce.saturation import clip_level, count_levels, is_clipped

Levels = npt.NDArray[np.float64]
BLACK, WHITE = 1000.0, 15000.0
SIDE = 120


def _scene(shape: str, highest: float) -> Levels:
    """Mean levels of a frame with light up to about `highest`."""
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    light = {
        "flat": np.ones((SIDE, SIDE)),
        "gradient": x,
        "bump": np.exp(-((x - 0.5) ** 2 + (y - 0.5) ** 2) * 20),
        "disc": 0.05 + 0.95 / (1 + np.exp((np.hypot(x - 0.5, y - 0.5) - 0.3) / 0.01)),  # a lens
        "colours": np.tile([[0.5, 1.0], [1.0, 0.3]], (SIDE // 2, SIDE // 2)),
    }[shape]
    return np.asarray(BLACK + (highest - BLACK) * light)


def _frame(mean: Levels, electrons_per_dn: float, step: int, seed: int) -> npt.NDArray[np.uint16]:
    """With photon noise; `step`: levels that are left out by a lossy or multiplied file."""
    rng = np.random.default_rng(seed)
    count_levels = BLACK + rng.poisson((mean - BLACK) * electrons_per_dn) / electrons_per_dn
    count_levels = count_levels + rng.normal(0, 2, mean.shape)
    return np.asarray(np.clip(np.rint(count_levels / step) * step, 0, 65535), dtype=np.uint16)


scenes = st.sampled_from(["flat", "gradient", "bump", "disc", "colours"])
gains = st.floats(0.2, 20)
steps = st.sampled_from([1, 2, 4, 16])


@settings(max_examples=30, deadline=None)
@given(
    shape=scenes,
    highest=st.floats(2000, 16000),
    electrons_per_dn=gains,
    step=steps,
    seed=st.integers(0, 2**32 - 1),
)
def test_noise_that_is_not_clipped_is_never_a_plateau(
    shape: str, highest: float, electrons_per_dn: float, step: int, seed: int
) -> None:
    frame = _frame(_scene(shape, highest), electrons_per_dn, step, seed)
    assert clip_level(frame, BLACK, WHITE) == WHITE


@settings(max_examples=30, deadline=None)
@given(
    noise=st.sampled_from(["normal", "uniform", "exponential"]),
    middle=st.floats(1000, 15000),
    width=st.floats(0, 3000),
    seed=st.integers(0, 2**32 - 1),
)
def test_nor_is_noise_of_any_kind_and_width(
    noise: str, middle: float, width: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    shape = (SIDE, SIDE)
    spread = {
        "normal": rng.normal(0, width, shape),
        "uniform": rng.uniform(-width, width, shape),
        "exponential": rng.exponential(width, shape),
    }[noise]
    frame = np.clip(np.rint(middle + spread), 0, 65535).astype(np.uint16)
    assert clip_level(frame, BLACK, WHITE) == WHITE


@settings(max_examples=25, deadline=None)
@given(
    shape=scenes.filter(lambda shape: shape != "flat"),
    full=st.integers(9000, 14990),
    electrons_per_dn=st.floats(0.2, 4),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_sensor_that_is_full_below_white_is_found(
    shape: str, full: int, electrons_per_dn: float, seed: int
) -> None:
    frame = np.minimum(_frame(_scene(shape, 1.5 * full), electrons_per_dn, 1, seed), full)
    assert clip_level(frame, BLACK, WHITE) == full


def test_a_few_pixels_at_one_level_are_none() -> None:
    frame = _frame(_scene("gradient", 9000), 1, 1, 0)
    frame[3, :49] = 14000
    assert clip_level(frame, BLACK, WHITE) == WHITE
    frame[3, :50] = 14000
    assert clip_level(frame, BLACK, WHITE) == 14000


def test_a_frame_without_noise_tells_nothing() -> None:
    assert clip_level(np.full((SIDE, SIDE), 14000, np.uint16), BLACK, WHITE) == WHITE
    steps = np.repeat(np.arange(8000, 14000, 500), 1200).reshape(120, 120).astype(np.uint16)
    assert clip_level(steps, BLACK, WHITE) == WHITE


def test_above_white_the_files_level_holds() -> None:
    frame = np.minimum(_frame(_scene("gradient", 20000), 1, 1, 0), 15800)
    assert clip_level(frame, BLACK, WHITE) == WHITE


def test_a_real_photograph_is_clipped_where_it_is(real_data: Path) -> None:
    """14 bits of a Nikon, 432 pixels at 16383; had its file said 20000."""
    path = real_data / "isp/isp_DSC_1339_768x512_rggb_u16le.raw"
    pixels = np.fromfile(path, "<u2").reshape(512, 768)
    assert clip_level(pixels, 600, 20000) == 16383
    assert clip_level(pixels[pixels < 16383].reshape(1, -1), 600, 20000) == 20000


def test_a_region_is_clipped_if_its_mean_suffers() -> None:
    """Noise beyond white that does not count as clipping takes nothing worth a σ from the mean."""
    light = np.random.default_rng(1).normal(100.0, 10.0, 100_000)
    for white, clipped in ((100 + 10 * 3.3, False), (100 + 10 * 2.8, True)):
        assert is_clipped(np.count_nonzero(light >= white), light.size) == clipped
        if not clipped:
            assert light.mean() - np.minimum(light, white).mean() < 3e-4 * 10.0
    assert is_clipped([0, 1, 2], [1000, 1000, 1000]).tolist() == [False, False, True]


@pytest.mark.parametrize("side", [50, 400])
def test_levels_are_counted_without_what_is_left_out(side: int) -> None:
    """Small planes and large ones are counted in ways of their own."""
    rng = np.random.default_rng(side)
    plane = rng.integers(1000, 1020, (side, side)).astype(np.uint16)
    plane[0, :7] = 65535
    for left_out in (None, plane > 1015):
        kept = plane.ravel() if left_out is None else plane[~left_out]
        levels, pixels = count_levels(plane, left_out)
        assert dict(zip(levels.tolist(), pixels.tolist(), strict=True)) == {
            level: int((kept == level).sum()) for level in set(kept.tolist())
        }
