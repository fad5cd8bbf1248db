"""Pictures in three channels: those of all bands, by the coloured materials that paths pass."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.design import spectral_bands
from labrig.reproduce import Renderer, load_scene

#: Grey, phosphorescent and fluorescent walls; a chart of 24 colours beside a sphere.
SCENES = ("cornell-box", "chart-and-sphere")


@pytest.mark.parametrize("name", SCENES)
def test_three_channels_are_those_of_the_bands(name: str) -> None:
    scene = load_scene(name).resized(width_px=16, height_px=12, paths=8)
    renderer = Renderer(scene, 1)
    rng = np.random.default_rng(5)
    n_places = len(scene.geometry(0.0).material_of_place)
    glow = rng.random((n_places, len(scene.bands))).astype(np.float32)
    to_rgb = spectral_bands(scene.bands.edges_nm).to_rgb
    for levels in (np.zeros(len(scene.file.lamps)), rng.random(len(scene.file.lamps))):
        expected = renderer.picture(glow, levels) @ to_rgb.T
        found = renderer.colours(glow, levels, to_rgb)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * expected.max())


def test_another_albedo_needs_no_new_paths() -> None:
    scene = load_scene("cornell-box").resized(width_px=12, height_px=12, paths=4)
    first = Renderer(scene, 1)
    to_rgb = spectral_bands(scene.bands.edges_nm).to_rgb
    dark = np.zeros((len(scene.geometry(0.0).material_of_place), len(scene.bands)), np.float32)
    before = first.colours(dark, [1.0], to_rgb)
    number = list(scene.file.materials).index("phosphorescent")
    darker = scene.materials[number].matrix * np.linspace(0.1, 0.9, 24, dtype=np.float32)
    changed = scene.with_material(
        "phosphorescent", replace(scene.materials[number], matrix=np.diag(np.diagonal(darker)))
    )
    second = Renderer(changed, 1, traced=first)
    after = second.colours(dark, [1.0], to_rgb)
    assert after.sum() < 0.95 * before.sum()
    np.testing.assert_allclose(after, second.picture(dark, [1.0]) @ to_rgb.T, rtol=1e-4, atol=1e-2)


def test_too_many_sequences_are_folded_band_by_band(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene("cornell-box").resized(width_px=8, height_px=8, paths=4)
    to_rgb = spectral_bands(scene.bands.edges_nm).to_rgb
    dark = np.zeros((len(scene.geometry(0.0).material_of_place), len(scene.bands)), np.float32)
    few = Renderer(scene, 1).colours(dark, [1.0], to_rgb)
    monkeypatch.setattr("labrig.reproduce.transport.folding.MAX_SEQUENCES", 3)
    np.testing.assert_allclose(Renderer(scene, 1).colours(dark, [1.0], to_rgb), few, rtol=1e-4)
