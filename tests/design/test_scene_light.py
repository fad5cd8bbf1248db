"""A material designed in a scene: the light on it, and its picture."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.design import (
    Design,
    Keys,
    SceneLight,
    SceneSpectra,
    key_differences,
    solve,
    spectral_bands,
    three_bands,
    to_material,
    written_differences,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import read_material, write_material
from labrig.optics import read_light
from labrig.reproduce import (
    ProgrammeEntry,
    Renderer,
    build_scene,
    load_scene,
    read_scene,
    tristimulus,
)
from tests.design.small_scene import FLOOR, LUX, corner

#: Where the floor and the wall are seen.
FRONT, BEHIND = (0.5, 0.62), (0.5, 0.2)
TIMES_S = [-1.0, 1.0, 20.0, 90.0]
#: A green that fades, below 1, 1, 1 of a white card: it reflects a part of the light before.
WISHES = [[0.25, 0.35, 0.3], [2e-3, 1e-2, 3e-3], [1.2e-3, 6e-3, 1.8e-3], [2e-4, 1e-3, 3e-4]]


@pytest.fixture(scope="module")
def light(tmp_path_factory: pytest.TempPathFactory) -> SceneLight:
    return SceneLight.of(corner(tmp_path_factory.mktemp("scene")), "paint", threads=1)


@pytest.fixture(scope="module")
def spectra(light: SceneLight) -> SceneSpectra:
    return light.spectra([light.place_at(*FRONT)])


@pytest.fixture(scope="module")
def design(spectra: SceneSpectra) -> Design:
    keys = Keys.checked(0, TIMES_S, np.array(WISHES) / np.pi)
    return solve(spectra.programme, keys, three_bands())


def rendered(path: Path, design: Design, spectra: SceneSpectra) -> FloatArray:
    """Linear sRGB of the written material by the renderer (keys, height, width, 3)."""
    written = path.parent / "made.yaml"
    write_material(written, to_material(design, "made", spectra))
    scene = load_scene(path, {"paint": str(written)}).at_times(design.keys.time_s.tolist())
    frames = np.array([frame.radiance for frame in Renderer(scene, 1).frames()])
    return spectra.rgb(frames.astype(np.float64))


def test_an_open_place_has_the_light_of_the_lamp(tmp_path: Path) -> None:
    alone = {"floor": {"material": "paint", "rectangle": FLOOR, "samples": [4, 4]}}
    path = corner(tmp_path, objects=alone)
    light = SceneLight.of(path, "paint", width_px=12, threads=1)
    lux = LUX / np.sqrt(2)
    assert light.white_cd_per_m2 == pytest.approx(lux / np.pi, rel=2e-3)
    place = light.place_at(*FRONT)
    # D65 of a tenth of the white that is asked for, in bands of 20 nm.
    dim = SceneLight.of(path, "paint", white_cd_per_m2=10 * lux / np.pi, threads=1)
    programme = dim.programme([place])
    np.testing.assert_allclose(programme.irradiance[0], [[0.1] * 3, [0.0] * 3], rtol=0.03)
    assert programme.begin_s.tolist() == [-300, 0]


def test_the_wall_sends_light_back_and_another_albedo_none_anew(
    tmp_path: Path, light: SceneLight
) -> None:
    place = [light.place_at(0.3, 0.5)]
    bright = light.with_albedo(0.9)
    assert (
        bright.programme(place).irradiance[0, 0] > light.programme(place).irradiance[0, 0]
    ).all()
    traced = SceneLight.of(corner(tmp_path), "paint", albedo=0.9, threads=1,
                           white_cd_per_m2=light.white_cd_per_m2)  # fmt: skip
    np.testing.assert_allclose(
        bright.programme(place).irradiance, traced.programme(place).irradiance, rtol=1e-6
    )


def test_another_programme(light: SceneLight) -> None:
    place = [light.place_at(*FRONT)]
    parts = [ProgrammeEntry(at_s=5, lamps={"sun": 0.5}), ProgrammeEntry(at_s=9, lamps={"sun": 0})]
    changed = light.with_programme(parts).programme(place)
    assert changed.begin_s.tolist() == [5, 9]
    whole = light.programme(place).irradiance[0, 0]
    np.testing.assert_allclose(changed.irradiance[0], [0.5 * whole, 0 * whole], rtol=1e-6)


def test_the_picture_is_that_of_the_renderer(
    tmp_path: Path, light: SceneLight, design: Design, spectra: SceneSpectra
) -> None:
    kept = light.with_albedo(design.albedo)
    frames = rendered(corner(tmp_path), design, spectra)
    for t_s, frame in zip(TIMES_S, frames, strict=True):
        # Its own glow excites it, too: as little as it is beside the lamp.
        for each in (design, read_material(tmp_path / "made.yaml")):
            np.testing.assert_allclose(kept.picture(each, t_s), frame, rtol=0.01, atol=1e-6)


def test_the_written_material_meets_the_keys_in_the_scene(
    tmp_path: Path, light: SceneLight, design: Design, spectra: SceneSpectra
) -> None:
    kept = light.with_albedo(design.albedo)
    again = kept.spectra([light.place_at(*FRONT)])
    found = solve(again.programme, design.keys, three_bands())
    column, row = (int(12 * part) for part in FRONT)
    seen = rendered(corner(tmp_path), found, again)[:, row, column]
    wanted = np.array(WISHES)
    differences = key_differences(wanted, seen, wanted[:, 1])
    assert differences.max() < 1
    material = read_material(tmp_path / "made.yaml")
    np.testing.assert_allclose(written_differences(found, material, again), differences, atol=1)


def test_ultraviolet_light_needs_bands(tmp_path: Path) -> None:
    path = corner(tmp_path, lamps={"sun": {
        "kind": "distant", "spectrum": "365nm", "irradiance_w_per_m2": 5, "towards": [0, -1, 1]
    }})  # fmt: skip
    with pytest.raises(UsageError, match="bands_nm"):
        SceneLight.of(path, "paint", threads=1)
    bands = spectral_bands(np.arange(300.0, 781.0, 40.0))
    with pytest.raises(UsageError, match="white_cd_per_m2"):
        SceneLight.of(path, "paint", bands=bands, threads=1)
    light = SceneLight.of(path, "paint", bands=bands, white_cd_per_m2=2.0, albedo=0.4, threads=1)
    spectra = light.spectra([light.place_at(*FRONT)])
    keys = Keys.checked(0, [1.0, 20.0, 90.0], np.array(WISHES)[1:] / np.pi)
    found = solve(spectra.programme, keys, bands, albedo=0.4)
    column, row = (int(12 * part) for part in FRONT)
    seen = rendered(path, found, spectra)[:, row, column]
    wanted = np.array(WISHES)[1:]
    assert key_differences(wanted, seen, wanted[:, 1]).max() < 2


def test_colours_are_those_of_the_renderers_display(spectra: SceneSpectra) -> None:
    edges = spectra.edges_nm
    radiance = np.array([read_light("A").in_bands(edges), read_light("D65").in_bands(edges)])
    luminance = tristimulus(radiance, edges)[:, 1]
    rgb = spectra.rgb(radiance)
    np.testing.assert_allclose(
        rgb @ [0.2126, 0.7152, 0.0722], luminance / spectra.white_cd_per_m2, rtol=1e-3
    )


@pytest.mark.parametrize(
    ("point", "seen"),
    [(BEHIND, "back of 'wall'"), ((0.02, 0.02), "nothing"), ((1.5, 0.5), "0 to 1")],
)
def test_a_point_beside_the_material_is_named(
    light: SceneLight, point: tuple[float, float], seen: str
) -> None:
    with pytest.raises(UsageError, match=seen):
        light.place_at(*point)


UNSEEN = {"position_m": [0.5, -1.2, 1.2], "look_at_m": [0.5, -3, 1.2]}
MOVED = {"wall": {"material": "wall", "rectangle": {**FLOOR, "parts": 8},
                  "wave": {"amplitude_m": 0.1, "period_s": 1}},
         "floor": {"material": "paint", "rectangle": FLOOR}}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "name", "why"),
    [
        ({}, "pain", "did you mean 'paint'"),
        ({"camera": UNSEEN}, "paint", "nowhere in the picture"),
        ({"objects": MOVED, "step_s": 1.0}, "paint", "nothing moves"),
        ({"materials": {"paint": {"albedo": 0.4, "levels": 0.5}, "wall": {"albedo": 0.6}}},
         "paint", "begin empty"),
        ({"programme": [{"at_s": -300, "lamps": {"sun": 0}}]}, "paint", "a lamp that shines"),
    ],
)  # fmt: skip
def test_what_cannot_be_designed_is_said(
    tmp_path: Path, changed: dict[str, Any], name: str, why: str
) -> None:
    with pytest.raises(UsageError, match=why):
        SceneLight.of(corner(tmp_path, **changed), name, threads=1)


def test_bands_are_whole_bands_of_the_scene(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="got 410"):
        SceneLight.of(corner(tmp_path), "paint", bands=spectral_bands([400.0, 410.0]), threads=1)


def test_two_renderers_share_their_paths(tmp_path: Path) -> None:
    file, folder = read_scene(corner(tmp_path))
    scene = build_scene(file, folder)
    first = Renderer(scene, 1)
    first.frame(-1.0)
    assert Renderer(scene, 1).memory_bytes == 0
    assert Renderer(scene, 1, traced=first).memory_bytes == first.memory_bytes > 0
    with pytest.raises(UsageError, match="states"):
        scene.with_material("paint", SceneLight.of(corner(tmp_path), "paint").scene.materials[0])
