"""A material designed in a scene by a file: rounds of rendering, and what the command writes."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.design import (
    SceneDesign,
    WishFile,
    key_differences,
    read_wish,
    solve_in_scene,
    to_wish,
)
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import read_model, write_yaml, yaml_text
from labrig.material import read_material, write_material
from labrig.reproduce import Renderer, load_scene
from tests.conftest import Ended
from tests.design.small_scene import corner

Labrig = Callable[..., Ended]
#: A glow beside which the light of the lamp is weak: its reflection off the wall counts.
KEYS = [
    {"at": "-1 s", "place": "left", "colour": [0.3, 0.4, 0.35]},
    {"at": "2 s", "place": "left", "colour": [0.01, 0.08, 0.03]},
    {"at": "60 s", "place": "right", "colour": [0.003, 0.024, 0.009]},
    {"at": "200 s", "place": "left", "colour": [0.00016, 0.0013, 0.0005]},
]
SCENE = {"file": "corner.yaml", "material": "paint", "white_cd_per_m2": 400.0}
PIXELS = {"left": [0.4, 0.6], "right": [0.6, 0.6]}


def written(folder: Path, **content: Any) -> Path:
    corner(folder)
    path = folder / "wish.yaml"
    whole = {"scene": SCENE, "pixels": PIXELS, "keys": KEYS} | content
    path.write_text(yaml_text(whole), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> SceneDesign:
    return solve_in_scene(read_wish(written(tmp_path_factory.mktemp("wish"))))


def test_rounds_come_nearer(found: SceneDesign) -> None:
    largest = [float(each.max()) for each in found.rounds]
    assert largest[0] > 1.5 * largest[found.best]
    assert largest[found.best] == pytest.approx(found.delta_e2000.max())
    assert largest[found.best] < 0.5


def test_its_material_is_rendered_to_the_keys(found: SceneDesign, tmp_path: Path) -> None:
    """By the renderer alone, and its pixels: they lie within the noise of the light on a place."""
    write_material(tmp_path / "made.yaml", found.material)
    scene = load_scene(corner(tmp_path), {"paint": str(tmp_path / "made.yaml")})
    times = [-1.0, 2.0, 60.0, 200.0]
    frames = list(Renderer(scene.at_times(times), 1).frames())
    seen = []
    for frame, key in zip(frames, KEYS, strict=True):
        column, row = (int(12 * part) for part in PIXELS[str(key["place"])])
        seen.append(found.spectra.rgb(frame.radiance)[row, column])
    wanted = np.array([key["colour"] for key in KEYS])
    assert key_differences(wanted, np.array(seen), wanted[:, 1]).max() < 2
    pictures = found.pictures(times)
    assert pictures.shape == (4, 12, 12, 3)
    np.testing.assert_allclose(pictures[2], found.spectra.rgb(frames[2].radiance), rtol=1e-3)


def test_a_written_wish_is_read_as_the_same(tmp_path: Path) -> None:
    programme = [{"at_s": -20.0, "lamps": {"sun": 1.0}}, {"at_s": 0.0, "lamps": {"sun": 0.0}}]
    path = written(tmp_path, scene=SCENE | {"programme": programme})
    file = read_model(path, WishFile)
    write_yaml(tmp_path / "again.yaml", file)
    assert read_model(tmp_path / "again.yaml", WishFile) == file
    assert to_wish(file, "again", tmp_path).programme.begin_s.tolist() == [-20.0, 0.0]


@pytest.mark.drawn
def test_the_command_writes_what_it_found(labrig: Labrig, tmp_path: Path) -> None:
    path, out, picture = written(tmp_path), tmp_path / "made.yaml", tmp_path / "made.png"
    ended = labrig("design", "--constraints", path, "--out", out, "--picture", picture)
    assert ended.code == 0, ended.err
    assert "rendered, round 1: ΔE2000" in ended.out
    assert re.search("−1 s +left", ended.out)
    assert read_material(out).scale == "absolute"
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"pixels": {"left": [0.5, 0.1], "right": [0.6, 0.6]}}, "back of 'wall' is seen"),
        ({"pixels": {"left": [0.5, 1.1], "right": [0.6, 0.6]}}, "pixels.left"),
        ({"scene": SCENE | {"material": "paimt"}}, "did you mean 'paint'"),
        ({"scene": SCENE | {"programme": [{"at_s": 0, "lamps": {"son": 1}}]}}, "'son'"),
        ({"scene": SCENE | {"programme": []}}, "programme"),
        ({"pixels": {"left": [0.4, 0.6]}}, "'right'"),
        ({"albedo": [0.1, 0.2]}, "3 bands"),
    ],
)
def test_improper_wishes_are_refused_in_one_line(
    labrig: Labrig, tmp_path: Path, content: dict[str, Any], said: str
) -> None:
    ended = labrig("design", "--constraints", written(tmp_path, **content))
    assert ended.code == 2, ended.out
    assert len(ended.err.splitlines()) == 1
    assert said in ended.err


def test_a_wish_without_a_scene_is_none_of_one(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="scene"):
        solve_in_scene(replace(read_wish(written(tmp_path)), scene=None))
