"""The light of a frame that a lens scatters over it, where bright samples lie in its middle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.optics import CameraModel, Flat, Glare, rho_squared
from labrig.reduce import SeriesFrame, reduce_patches
from labrig.reduce.glare import subtract_glare
from labrig.sim.dng import Shot, encode_dng
from tests.report.made import decay_series

WIDTH, HEIGHT, BLACK_DN, GLARE = 192, 128, 1024, 0.05
DIM_DN, BRIGHT_DN = 200.0, 8000.0


def test_the_vignetting_of_the_frame_is_divided_out_where_its_light_is(tmp_path: Path) -> None:
    """By the mean vignetting of the frame the dim patch would come out 1.5 % too dim."""
    flat = Flat(f_number=4.0, falloff=((-0.3,),) * 3)
    camera = CameraModel(
        iso=400,
        f_number=4.0,
        channels=("R", "G", "B"),
        flats=(flat,),
        glare=Glare(fraction=GLARE, sigma=0.001),
    )
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    is_bright = (abs((x + 0.5) / WIDTH - 0.5) < 0.125) & (abs((y + 0.5) / HEIGHT - 0.5) < 0.125)
    light = np.where(is_bright, BRIGHT_DN, DIM_DN)
    veiled = (1 - GLARE) * light + GLARE * light.mean()
    seen = veiled * flat.at(rho_squared(x, y, WIDTH, HEIGHT))[..., 1]
    noise = np.random.default_rng(1).normal(size=seen.shape)
    path = tmp_path / "frame.dng"
    shot = Shot(0.0, 1.0, 400, 4.0, None)
    path.write_bytes(encode_dng((BLACK_DN + seen + noise + 0.5).astype(np.uint16), shot))
    frames = [SeriesFrame(path, 1.0, 1.0, 400, 4.0)]
    dim = reduce_patches(frames, {"dim": (0.05, 0.4, 0.2, 0.2)}, camera=camera)["dim"]
    assert dim.values[0] == pytest.approx(DIM_DN, rel=0.004)


def test_what_a_lens_does_not_scatter_keeps_its_relative_sigma() -> None:
    """A lens shows (1 − g) x + g m of light x in a frame of mean m."""
    true = decay_series()
    frame = replace(true, values=0.2 * true.values)
    shown = replace(
        true,
        values=(1 - GLARE) * true.values + GLARE * frame.values,
        sigma=(1 - GLARE) * true.sigma,
    )
    found = subtract_glare(shown, frame, Glare(fraction=GLARE, sigma=0.001))
    np.testing.assert_allclose(found.values, true.values)
    np.testing.assert_allclose(found.sigma, true.sigma)
    # An error of the glare acts as one of the dark level, where frames weigh most.
    weighted = np.average(frame.values, axis=0, weights=1 / true.sigma**2)
    np.testing.assert_allclose(found.dark_sigma, 0.001 * weighted / (1 - GLARE))
