"""Cameras that subtract black and cut off at 0 what noise has below it: means against the truth."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.analyse import fit_series
from labrig.foundation.errors import FrameError
from labrig.material import read_material
from labrig.record import read_run
from labrig.reduce import (
    LinearFrame,
    RawFrame,
    SeriesFrame,
    find_cut_off,
    hot_pixels,
    measure,
    reduce_series,
)
from tests.conftest import Ended
from tests.warned import codes

READ_DN, GAIN_DN = 5.0, 1.0
REGION = (0.2, 0.25, 0.5, 0.5)


def photograph(
    light_dn: float | np.ndarray, seed: int, read_dn: float = READ_DN, black_dn: float = 0.0,
    step: float = 1.0, lowest_dn: float = 0.0,
) -> RawFrame:  # fmt: skip
    """A frame of a camera whose numbers end at `lowest_dn`, with `black_dn` in them."""
    rng = np.random.default_rng(seed)
    light = np.broadcast_to(light_dn, (192, 288))
    level = GAIN_DN * rng.poisson(light / GAIN_DN) + rng.normal(black_dn, read_dn, light.shape)
    mosaic = step * np.maximum(np.rint(level / step), lowest_dn / step)
    return RawFrame(mosaic.astype(np.uint16), "RGGB", (black_dn,) * 4, 15_000.0)


@pytest.mark.parametrize("light_dn", [0.0, 1.0, 3.0, 7.0, 20.0, 300.0])
@pytest.mark.parametrize(
    "camera",
    [
        {},
        {"read_dn": 1.2},
        {"black_dn": 4.0},
        {"black_dn": 64.0, "lowest_dn": 64.0},
        {"read_dn": 60.0, "step": 16},
    ],
    ids=["subtracts", "fine", "low black", "cut off at black", "coarse steps"],
)
def test_means_are_right(light_dn: float, camera: dict[str, float]) -> None:
    stats = measure(photograph(light_dn, 3, **camera), REGION).channels
    for channel in stats.values():
        assert abs(channel.mean - light_dn) < 4 * channel.sigma
        assert channel.sigma < 0.05 * camera.get("read_dn", READ_DN) + 0.01 * light_dn


def test_sigma_means_what_it_says() -> None:
    """Roughly, by few frames; with many: tests/acceptance/black_cut_off.py."""
    pulls = [
        (channel.mean - 2.0) / channel.sigma
        for seed in range(12)
        for channel in measure(photograph(2.0, seed), REGION).channels.values()
    ]
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.35)


def test_light_and_dark_in_one_region() -> None:
    """The mean of pixels far apart is right, too, though no single level explains them."""
    light = np.zeros((192, 288))
    light[:, 144:] = 12.0
    frame = photograph(light, 5)
    picture = LinearFrame(frame).value_dn()
    assert picture.mean() == pytest.approx(6.0, abs=0.1)
    assert frame.mosaic.mean() > 6.8


def test_edges_are_not_noise() -> None:
    """The noise is that of the even third, though dark lines cross the rest everywhere."""
    light = np.where(np.arange(288) % 16 < 2, 0.0, 60.0) * np.ones((192, 1))
    light[:64] = 2.0
    cut_off = photograph(light, 5).cut_off
    assert cut_off is not None
    assert cut_off.read_dn == pytest.approx(READ_DN, rel=0.1)


def test_hot_pixels_are_not_noise() -> None:
    darks = [photograph(0.0, seed) for seed in (1, 2, 3)]
    for dark in darks:
        dark.mosaic[50, 60] = 900
    assert np.argwhere(hot_pixels(darks)).tolist() == [[50, 60]]


@pytest.mark.parametrize(
    "mosaic",
    [
        np.zeros((192, 288)),
        np.full((192, 288), 2048),
        np.where(np.arange(288) < 144, 0, 500) * np.ones((192, 1)),
        np.rint(np.linspace(0, 3000, 288)) * np.ones((192, 1)),
        np.rint(np.random.default_rng(1).normal(2048, 6, (192, 288))),
        np.rint(np.random.default_rng(1).normal(2048.45, 0.3, (192, 288))),
        np.where(np.random.default_rng(1).random((192, 288)) < 0.001, 0, 2048),
    ],
    ids=["black", "grey", "half black", "ramp", "Canon", "quiet", "dead pixels"],
)
def test_no_other_frame_is_taken_for_cut_off(mosaic: np.ndarray) -> None:
    numbers = mosaic.astype(np.uint16)
    assert find_cut_off([numbers[i::2, j::2] for i in (0, 1) for j in (0, 1)]) is None


def test_a_level_that_cannot_be_told_is_refused() -> None:
    light = np.zeros((192, 288))
    light[60:, :] = 20.0
    mosaic = photograph(light, 1, black_dn=20.0).mosaic
    shifted = np.maximum(mosaic.astype(np.int32) - 33, 0).astype(np.uint16)
    with pytest.raises(FrameError, match="cut off"):
        measure(RawFrame(shifted, "RGGB", (0.0,) * 4, 15_000.0), (0.0, 0.0, 1.0, 0.25))


def test_a_decay_of_such_a_camera(
    labrig: Callable[..., Ended], make_rig: Callable[..., Path], make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:  # fmt: skip
    sensor = {"width": 96, "height": 64, "subtracts_black": True}
    sample = [{"material": "blue-paint", "region": [0.1, 0.1, 0.8, 0.8], "brightness": 0.02}]
    rig = make_rig(sensor=sensor, sample=sample)
    ended = labrig(
        "run", make_protocol(**{"for": "100 s"}), "--rig", rig, "--runs", tmp_path, "--no-process"
    )
    run = read_run(ended.run_folder)
    start = run.frames("decay")[0].start_time
    darks = [SeriesFrame(dark.path, 0.0, dark.exposure_s) for dark in run.frames("dark")]
    told = labrig("frame", darks[0].path)
    assert "cuts off noise below it" in told.out
    frames = [
        SeriesFrame(one.path, one.start_time - start, one.exposure_s) for one in run.frames("decay")
    ]
    fit = fit_series(reduce_series(frames, (0.2, 0.2, 0.6, 0.6), darks))
    (true,) = read_material("blue-paint").states
    assert len(fit.states) == 1
    assert "black-cut-off" in codes(fit.warnings)
    assert fit.states[0].k_r_per_s_sigma < 0.03 * true.k_r_per_s
    assert abs(fit.states[0].k_r_per_s - true.k_r_per_s) < 3 * fit.states[0].k_r_per_s_sigma
