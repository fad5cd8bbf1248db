"""A simulated bench without labrig's simulator: frames written here, from a known decay."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from labrig.foundation.errors import DataError, FrameError
from labrig.optics import CameraModel, Flat
from labrig.reduce import SeriesFrame, reduce_patches, reduce_series
from labrig.reduce.series import TWO_DEGREES
from labrig.results import Series

WriteDng = Callable[..., bytes]
Take = Callable[..., SeriesFrame]
Floats = npt.NDArray[np.float64]

HEIGHT, WIDTH = 96, 128
PAINT, CARD, WALL = (16, 16, 48, 64), (80, 16, 32, 64), (2, 2, 12, 90)
PATCHES = {"paint": PAINT, "card": CARD}
#: DN and DN/s in the dark; read noise in DN; light of the paint (R, G, B) and its decay.
DARK_DN, DARK_PER_S, READ_DN = 3.0, 4.0, 5.0
LIGHT_PER_S, RATE_PER_S = (300.0, 900.0, 150.0), 0.05
HOT = (slice(20, 66, 10), slice(20, 60, 10))


def _light(t_s: float) -> Floats:
    """Glow in DN/s: the paint decays, the card is a third as bright, the wall is dark."""
    glow = np.zeros((HEIGHT, WIDTH))
    for (x, y, w, h), fraction in ((PAINT, 1.0), (CARD, 1 / 3)):
        glow[y : y + h, x : x + w] = fraction * np.exp(-RATE_PER_S * t_s)
    red, green, blue = LIGHT_PER_S
    return np.asarray(glow * np.tile([[red, green], [green, blue]], (HEIGHT // 2, WIDTH // 2)))


@pytest.fixture
def take(tmp_path: Path, write_dng: WriteDng) -> Take:
    rng = np.random.default_rng(7)
    taken = 0

    def shot(
        t_s: float,
        exposure_s: float,
        lit: bool = True,
        iso: int = 100,
        dark_per_s: float = DARK_PER_S,
    ) -> SeriesFrame:
        nonlocal taken
        taken += 1
        signal = (_light(t_s) * lit + dark_per_s) * exposure_s
        mosaic = 1000 + DARK_DN + rng.poisson(signal) + rng.normal(0, READ_DN, signal.shape)
        mosaic[HOT] += 2000 * exposure_s
        path = tmp_path / f"{taken:06d}.dng"
        path.write_bytes(write_dng(np.clip(np.rint(mosaic), 0, 15000), iso=iso))
        return SeriesFrame(path, t_s, exposure_s, unit="decay")

    return shot


def _pulls(series: Series, fraction: float) -> Floats:
    truth = fraction * np.exp(-RATE_PER_S * series.t_s)[:, np.newaxis] * np.array(LIGHT_PER_S)
    drift = TWO_DEGREES * DARK_PER_S  # allowed for, but this sensor keeps its temperature
    of_dark = np.sqrt(np.maximum(np.nan_to_num(series.dark_sigma) ** 2 - drift**2, 0))
    return np.asarray((series.values - truth) / np.hypot(series.sigma, of_dark))


def test_a_decay_is_recovered_with_darks_of_two_exposures(take: Take) -> None:
    frames = [take(t_s, exposure_s) for t_s in (1, 10, 40, 80) for exposure_s in (1.0, 4.0)]
    darks = [take(0, exposure_s, lit=False) for exposure_s in (1.0, 1.0, 4.0, 4.0)]
    found = reduce_patches(frames, PATCHES, darks)
    for name, fraction in (("paint", 1.0), ("card", 1 / 3)):
        series = found[name]
        assert (series.region, series.channels) == (name, ("R", "G", "B"))
        assert series.t_s.tolist() == [frame.t_s for frame in frames]
        assert series.frame == tuple(frame.path.name for frame in frames)
        assert series.iso.tolist() == [100] * 8
        assert set(series.flag) == {""}
        assert np.abs(_pulls(series, fraction)).max() < 4
        assert 0.6 < _pulls(series, fraction).std() < 1.4
        assert (series.dark_sigma > TWO_DEGREES * DARK_PER_S * 0.9).all()
        assert (series.dark_sigma < 1.3).all()


@pytest.mark.parametrize("warmer_c", [1.0, 2.0])
def test_a_sensor_that_has_warmed_up_since_is_allowed_for(take: Take, warmer_c: float) -> None:
    warm_per_s = DARK_PER_S * 2 ** (warmer_c / 6)
    frames = [take(200, 4.0, dark_per_s=warm_per_s) for _ in range(4)]
    darks = [take(0, exposure_s, lit=False) for exposure_s in (1.0, 1.0, 4.0, 4.0)]
    series = reduce_series(frames, PAINT, darks, name="paint")
    error = series.values.mean(axis=0) - np.exp(-RATE_PER_S * 200) * np.array(LIGHT_PER_S)
    assert (error > 2 * series.sigma.mean(axis=0) / 2).all(), "the warmth is seen"
    assert (np.abs(error) < 2 * series.dark_sigma).all()


def test_a_background_region_takes_the_place_of_darks(take: Take) -> None:
    frames = [take(t_s, 2.0) for t_s in (1, 10, 40)]
    darks = [take(0, 1.0, lit=False)]  # of another exposure: not needed for the level
    plain = reduce_series(frames, (16, 66, 48, 14), name="paint")
    series = reduce_series(frames, (16, 66, 48, 14), darks, background=WALL, name="paint")
    assert np.abs(_pulls(series, 1.0)).max() < 4
    assert series.dark_sigma.tolist() == [0, 0, 0]
    assert (series.sigma > plain.sigma).all()


def test_without_darks_the_dark_level_stays_in_and_is_unknown(take: Take) -> None:
    series = reduce_series([take(1000, 2.0)], (16, 66, 48, 10))
    assert series.values[0] == pytest.approx(DARK_PER_S + DARK_DN / 2, abs=4 * series.sigma.max())
    assert np.isnan(series.dark_sigma).all()


def test_clipped_frames_are_flagged_and_stay(take: Take) -> None:
    bright = replace(take(0, 20.0), flag="late")
    series = reduce_series([bright, take(40, 1.0)], PAINT)
    assert series.flag == ("late+clipped", "")
    assert series.usable.tolist() == [False, True]


def test_hot_pixels_alone_do_not_make_a_frame_clipped(take: Take) -> None:
    """20 of 3072 pixels are saturated, all of them hot in the darks."""
    frames = [take(60, 10.0)]
    assert reduce_series(frames, PAINT).flag == ("clipped",)
    darks = [take(0, 10.0, lit=False) for _ in range(2)]
    assert reduce_series(frames, PAINT, darks).flag == ("",)


def test_times_and_settings_of_the_run_go_before_the_files(take: Take) -> None:
    frame = replace(take(1, 1.0), iso=200.0, f_number=5.6)
    series = reduce_series([frame], PAINT)
    assert (series.iso[0], series.f_number[0]) == (200, 5.6)


def test_what_does_not_fit_together_is_refused(
    take: Take, tmp_path: Path, write_dng: WriteDng
) -> None:
    frame = take(1, 1.0)
    with pytest.raises(DataError, match="one ISO in unit 'decay'"):
        reduce_series([frame, take(2, 1.0, iso=400)], PAINT)
    with pytest.raises(DataError, match="dark frames at ISO 100"):
        reduce_series([frame], PAINT, [take(0, 1.0, lit=False, iso=400)])
    with pytest.raises(DataError, match=r"expected dark frames of 1 s"):
        reduce_series([frame], PAINT, [take(0, 4.0, lit=False)])
    smaller = tmp_path / "smaller.dng"
    smaller.write_bytes(write_dng(np.full((HEIGHT // 2, WIDTH), 1003), iso=100))
    with pytest.raises(DataError, match="of the same sensor"):
        reduce_series([frame], (0.1, 0.1, 0.5, 0.5), [replace(take(0, 1.0), path=smaller)])
    with pytest.raises(DataError, match="above 0 s"):
        reduce_series([replace(frame, exposure_s=0.0)], PAINT)
    with pytest.raises(DataError, match="got 0 and 1"):
        reduce_series([], PAINT)
    broken = tmp_path / "broken.dng"
    broken.write_bytes(frame.path.read_bytes()[:900])
    with pytest.raises(FrameError, match=r"broken\.dng"):
        reduce_series([replace(frame, path=broken)], PAINT)


def test_what_a_lens_darkens_keeps_its_relative_sigma(take: Take) -> None:
    """A corner that gets half of the light is made as bright as the middle, σ and all."""
    frames = [take(t_s, 2.0) for t_s in (1, 10, 40)]
    darks = [take(0, 2.0, lit=False) for _ in range(2)]
    flat = Flat(f_number=None, falloff=((-0.5, 0.0, 0.0),) * 3)
    camera = CameraModel(iso=100, f_number=None, channels=("R", "G", "B"), flats=(flat,))
    plain = reduce_series(frames, PAINT, darks, name="paint")
    corrected = reduce_patches(frames, {"paint": PAINT}, darks, camera=camera)["paint"]
    gain = corrected.values / plain.values
    assert (gain > 1.05).all()
    np.testing.assert_allclose(corrected.sigma / plain.sigma, gain)
    np.testing.assert_allclose(corrected.dark_sigma / plain.dark_sigma, gain[0])
