"""Facts of a bench's optics: geometry, lens and polarisers, and what contradicts them."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.acquire import Optics, read_rig_file
from labrig.bench_optics import camera_curves, led_sources, require_optics, with_shipped_camera
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]


@pytest.fixture
def rig(make_rig: Callable[..., Path]) -> Callable[..., Path]:
    """The shipped bench with LEDs, whose optics are changed as told."""

    def write(**optics: Any) -> Path:
        path = make_rig(base="sim-fluorescent")
        content = read_quickly(path.read_text())
        del content["optics"]["lens"], content["optics"]["geometry"]
        content["optics"] |= optics
        path.write_text(write_quickly(content))
        return path

    return write


def write_curve(path: Path, points: dict[float, float]) -> str:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("wavelength_nm", "value"), *points.items()])
    return str(path)


def test_lens_and_polariser_are_in_the_cameras_curves(
    rig: Callable[..., Path], tmp_path: Path
) -> None:
    lens = write_curve(tmp_path / "lens.csv", {380: 0.0, 420: 0.0, 460: 0.9, 700: 0.9})
    film = write_curve(tmp_path / "film.csv", {380: 0.1, 700: 0.4})
    bare = camera_curves(read_rig_file(rig()))
    seen = camera_curves(read_rig_file(rig(lens=lens, polarisers="crossed", polariser=film)))
    nm = np.array([440.0, 540.0, 600.0])
    of_lens = np.interp(nm, [380, 420, 460, 700], [0, 0, 0.9, 0.9])
    passed = of_lens * np.interp(nm, [380, 700], [0.1, 0.4])
    ratio = seen.at(nm) / bare.at(nm) / passed[:, np.newaxis]
    assert ratio == pytest.approx(np.full((3, 3), ratio[0, 0]))
    assert not seen.at([400.0]).any()
    assert seen.sensitivity.max() == 1.0


def test_leds_of_the_rig_file_shine_through_the_polariser(
    rig: Callable[..., Path], tmp_path: Path
) -> None:
    film = write_curve(tmp_path / "film.csv", {380: 0.0, 410: 0.4, 700: 0.4})
    bare = led_sources(read_rig_file(rig()), "rig.yaml")["405 nm"].light
    polarised = led_sources(read_rig_file(rig(polarisers="crossed", polariser=film)), "rig.yaml")[
        "405 nm"
    ].light
    passed = np.interp(bare.wavelength_nm, [380, 410, 700], [0, 0.4, 0.4])
    assert polarised.value == pytest.approx(bare.value * passed)


@pytest.mark.parametrize(
    ("optics", "text", "may_see_gloss"),
    [
        ({}, "", False),
        ({"geometry": "45/0"}, "45°/0°", False),
        ({"geometry": "10/0"}, "10°/0°", True),
        ({"geometry": "45/45"}, "45°/45°", True),
        ({"geometry": "10/0", "polarisers": "crossed"}, "10°/0°, crossed polarisers", False),
        ({"polarisers": "crossed"}, "crossed polarisers", False),
    ],
)
def test_geometry_tells_whether_gloss_is_seen(
    optics: dict[str, Any], text: str, may_see_gloss: bool
) -> None:
    told = Optics.model_validate(optics)
    assert (told.geometry_text, told.may_see_gloss) == (text, may_see_gloss)


@pytest.mark.parametrize(
    ("optics", "told"),
    [
        ({"geometry": "45"}, "geometry"),
        ({"geometry": "45/90"}, "up to 85 degrees"),
        ({"polarisers": "parallel"}, "polarisers"),
        ({"polariser": "film.csv"}, "polarisers: crossed"),
        ({"lens": "no_lens"}, "no_lens"),
        ({"lens": "LENS"}, "from 400 nm to 700 nm"),
        ({"lens": "BLACK"}, "sees nothing"),
    ],
)
def test_what_contradicts_is_refused_in_one_line(
    labrig: Labrig, rig: Callable[..., Path], tmp_path: Path, optics: dict[str, Any], told: str
) -> None:
    files = {"LENS": {500.0: 0.9, 600.0: 0.9}, "BLACK": {380.0: 0.0, 720.0: 0.0}}
    optics = {
        key: write_curve(tmp_path / "lens.csv", files[value]) if value in files else value
        for key, value in optics.items()
    }
    ended = labrig("plan", "led_fluorescence", "--rig", rig(**optics))
    assert ended.code == 2
    assert told in ended.err
    assert len(ended.err.strip().splitlines()) == 1


def test_a_sphere_is_lit_from_where_the_rig_says(
    labrig: Labrig, rig: Callable[..., Path], tmp_path: Path
) -> None:
    protocol = tmp_path / "sphere.yaml"
    protocol.write_text(write_quickly({
        "protocol": "angular_fluorescence", "sample": {"name": "felt"}, "shape": "sphere",
        "light": {"angle": 30},
    }))  # fmt: skip
    ended = labrig("plan", protocol, "--rig", rig(geometry="45/0"))
    assert ended.code == 2
    assert "expected 45 degrees" in ended.err
    assert labrig("plan", protocol, "--rig", rig(geometry="30/0")).code == 0


def test_the_shipped_bench_tells_its_lens_and_geometry() -> None:
    from labrig.foundation import resources

    shipped = read_rig_file(resources.find("config", "rig", "sim-fluorescent"))
    require_optics(shipped)
    assert shipped.optics.geometry_text == "45°/0°"
    assert camera_curves(shipped).at([385.0]).max() < 1e-3


@pytest.mark.parametrize(
    ("named", "identity", "curves"),
    [
        (None, "Canon EOS 600D, serial 1, firmware 1.0.2", "canon_eos_600d"),
        ("canon_eos_5d", "Canon EOS 600D, serial 1, firmware 1.0.2", "canon_eos_5d"),
        (None, "Canon EOS 60D, serial 1, firmware 1.0.2", None),
        (None, "NIKON D5100, serial 1", None),  # whose channels have no common scale
        (None, "", None),
    ],
)
def test_a_camera_without_curves_in_the_rig_file_has_the_shipped_ones(
    rig: Callable[..., Path], named: str | None, identity: str, curves: str | None
) -> None:
    assert with_shipped_camera(read_rig_file(rig(camera=named)), identity).optics.camera == curves
