"""A linear frame: its sums are those of its pixels, and its variance is what frames scatter by."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings, strategies as st

from labrig.optics import Flat
from labrig.reduce import LinearFrame, RawFrame, SensorLayout
from labrig.reduce.linear_frame import cell_means_dn, saturated_cells
from labrig.reduce.photon_transfer import NoiseModel

Floats = npt.NDArray[np.float64]

HEIGHT, WIDTH, WHITE = 48, 64, 15_000.0
BLACK = {
    "RGGB": (1000.0, 1010.0, 990.0, 1005.0),
    "GBRG": (1000.0, 990.5, 1010.0, 995.0),
    "L": (7.0,),
}
GAIN, READ_E = 2.0, 8.0
DARK_DN = np.array([5.0, 3.0, 4.0])
FLAT = Flat(f_number=4.0, falloff=((-0.3, 0.05), (-0.25, 0.0), (-0.2, 0.0)))
NOISE = [NoiseModel((READ_E / GAIN) ** 2 + 1 / 12, 1 / GAIN)] * 3
areas = st.tuples(st.integers(0, 30), st.integers(0, 20), st.integers(4, 33), st.integers(4, 27))


def pixel(frame: LinearFrame, row: int, column: int) -> tuple[int, float, float]:
    """Channel, value and variance of one pixel, step by step."""
    raw = frame.raw
    side = raw.cfa_side
    position = side * (row % side) + column % side
    channel = raw.channels.index(raw.cfa[position])
    level = float(raw.mosaic[row, column]) - raw.black[position]
    dark = 0.0 if frame.dark_dn is None else float(frame.dark_dn[channel])
    lens = 1.0
    if frame.flat is not None:
        across, down = column + 0.5 - raw.width / 2, row + 0.5 - raw.height / 2
        rho2 = (across**2 + down**2) / ((raw.width / 2) ** 2 + (raw.height / 2) ** 2)
        lens += sum(c * rho2 ** (k + 1) for k, c in enumerate(frame.flat.falloff[channel]))
    variance = np.nan
    if frame.noise is not None:
        variance = float(frame.noise[channel].variance_dn2(np.array(level)))
    return channel, (level - dark) / lens, variance / lens**2


@settings(max_examples=25, deadline=None)
@given(st.sampled_from([*BLACK]), areas, st.booleans(), st.integers(0, 10**6))
def test_sums_over_a_region_are_those_of_its_pixels(
    cfa: str, area: tuple[int, int, int, int], calibrated: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    raw = RawFrame(
        rng.integers(900, 16_000, (HEIGHT, WIDTH)).astype(np.uint16), cfa, BLACK[cfa], WHITE
    )
    hot = rng.random((HEIGHT, WIDTH)) < 0.05
    frame = LinearFrame(raw, hot=hot)
    if calibrated and cfa != "L":
        frame = LinearFrame(raw, DARK_DN, FLAT, NOISE, hot)
    x, y, width, height = area
    value, variance, pixels, saturated = np.zeros((4, height, len(raw.channels)))
    for row, column in np.ndindex(height, width):
        if not hot[y + row, x + column]:
            channel, light, spread = pixel(frame, y + row, x + column)
            value[row, channel] += light
            variance[row, channel] += spread
            pixels[row, channel] += 1
            saturated[row, channel] += raw.mosaic[y + row, x + column] >= WHITE
    sums = frame.sums(area)
    np.testing.assert_allclose(sums.value_dn, value, rtol=1e-9, atol=1e-6)
    some = pixels > 0
    np.testing.assert_allclose(sums.variance_dn2[some], variance[some], rtol=1e-9)
    np.testing.assert_array_equal(sums.pixels, pixels)
    np.testing.assert_array_equal(sums.saturated, saturated)
    np.testing.assert_allclose(sums.mean_dn, value.sum(axis=0) / pixels.sum(axis=0), rtol=1e-9)
    np.testing.assert_allclose(
        frame.value_dn()[y : y + height, x : x + width], frame.value_dn(area), rtol=1e-12
    )


def photographed(rng: np.random.Generator, light_dn: float) -> RawFrame:
    """An even light through the lens: photons, reading, rounding."""
    black = np.tile(np.reshape(BLACK["RGGB"], (2, 2)), (HEIGHT // 2, WIDTH // 2))
    even = RawFrame((black + 1000).astype(np.uint16), "RGGB", BLACK["RGGB"], WHITE)
    lens = 1000 / LinearFrame(even, flat=FLAT).value_dn()
    dark = np.tile(DARK_DN[[[0, 1], [1, 2]]], (HEIGHT // 2, WIDTH // 2))
    electrons = rng.poisson(GAIN * (light_dn * lens + dark))
    count_levels = (electrons + READ_E * rng.standard_normal(electrons.shape)) / GAIN
    return RawFrame(np.rint(count_levels + black).astype(np.uint16), "RGGB", BLACK["RGGB"], WHITE)


@pytest.mark.parametrize("light_dn", [0.0, 40.0, 4000.0])
def test_the_variance_is_what_frames_scatter_by(light_dn: float) -> None:
    """400 frames, three channels: the scatter's own σ is 2 %, so 20 % too much or little fails."""
    rng = np.random.default_rng(1)
    sums = [
        LinearFrame(photographed(rng, light_dn), DARK_DN, FLAT, NOISE).region_sums(
            (0.1, 0.2, 0.6, 0.5)
        )
        for _ in range(400)
    ]
    means, sigmas = (
        np.array([one.mean_dn for one in sums]),
        np.array([one.sigma_dn for one in sums]),
    )
    assert np.std((means - light_dn) / sigmas) == pytest.approx(1.0, abs=0.08)
    assert np.abs(means.mean(axis=0) - light_dn).max() < 4 * sigmas.mean() / np.sqrt(400)


def test_a_region_with_full_pixels_is_clipped_channel_by_channel() -> None:
    mosaic = np.full((HEIGHT, WIDTH), 2000, np.uint16)
    mosaic[0, 0:8:2] = 15_000  # red ones
    sums = LinearFrame(RawFrame(mosaic, "RGGB", BLACK["RGGB"], WHITE)).region_sums(
        (0.0, 0.0, 1.0, 1.0)
    )
    assert sums.is_clipped.tolist() == [True, False, False]
    assert np.isnan(sums.sigma_dn).all()


def test_strips_are_means_over_bands_of_rows() -> None:
    mosaic = np.repeat(np.arange(HEIGHT, dtype=np.uint16)[:, None], WIDTH, axis=1)
    sums = LinearFrame(RawFrame(mosaic, "L", (0.0,), WHITE)).sums((0, 0, WIDTH, HEIGHT))
    np.testing.assert_allclose(sums.strip_means_dn(4)[:, 0], [5.5, 17.5, 29.5, 41.5])


@settings(max_examples=25, deadline=None)
@given(areas)
def test_light_that_rises_across_the_frame_is_measured_at_the_middle_of_a_channels_pixels(
    area: tuple[int, int, int, int],
) -> None:
    """In an odd number of rows, too, where a colour has more pixels in some columns."""
    x, y, width, height = area
    ramp = 1000 + 100 * np.arange(WIDTH, dtype=np.uint16)
    raw = RawFrame(np.tile(ramp, (HEIGHT, 1)), "RGGB", (1000.0,) * 4, WHITE)
    region = (x / WIDTH, y / HEIGHT, width / WIDTH, height / HEIGHT)
    middles = SensorLayout(WIDTH, HEIGHT, "RGGB").middle_columns(region)
    np.testing.assert_allclose(
        LinearFrame(raw).region_sums(region).mean_dn, 100 * (middles - 0.5), rtol=1e-9
    )


def test_colours_have_their_own_place_in_a_region() -> None:
    layout = SensorLayout(WIDTH, HEIGHT, "RGGB")
    middles = layout.middle_columns((8 / WIDTH, 0.0, 4 / WIDTH, 1.0))
    assert middles.tolist() == [9.5, 10.0, 10.5]


@pytest.mark.parametrize("cfa", [*BLACK])
def test_cells_are_means_of_their_pixels(cfa: str) -> None:
    rng = np.random.default_rng(2)
    mosaic = rng.integers(900, 16_000, (7, 9)).astype(np.uint16)
    raw = RawFrame(mosaic, cfa, BLACK[cfa], WHITE)
    picture, full = cell_means_dn(raw), saturated_cells(raw)
    assert picture.shape == (3, 4, len(raw.channels))
    for row, column in np.ndindex(3, 4):
        sums = LinearFrame(raw).sums((2 * column, 2 * row, 2, 2))
        np.testing.assert_allclose(picture[row, column], sums.mean_dn, rtol=1e-5)
        assert full[row, column] == sums.saturated.any()
