"""`labrig render`."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.reproduce import RenderFolder, exported_meshes, load_scene, read_spectral_exr
from tests.conftest import Ended

SMALL = ("--size", "12x9", "--paths", "4")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_pictures_of_all_times_with_what_was_assumed(labrig: Callable[..., Ended]) -> None:
    ended = labrig("render", "cornell-box", *SMALL, "--times", "-1,0,5", "--material",
                   "phosphorescent=pink-paint")  # fmt: skip
    assert ended.code == 0, ended.err
    folder = ended.run_folder
    assert {"000.png", "001.png", "002.png"} <= {path.name for path in folder.iterdir()}
    content = json.loads((folder / "render.json").read_text(encoding="utf-8"))
    assert any("pink-paint" in note for note in content["notes"])
    dark = read_spectral_exr(folder / "001.exr").radiance
    later = read_spectral_exr(folder / "002.exr").radiance
    # One exponential of 0.027 per second, which the glow itself slows by a part in a thousand.
    lit = dark > 0
    assert lit.any()
    np.testing.assert_allclose(later[lit] / dark[lit], np.exp(-0.027 * 5), rtol=3e-3)


def test_a_rendering_that_was_killed_goes_on_to_the_same_pictures(
    labrig: Callable[..., Ended],
) -> None:
    assert labrig("render", "cornell-box", *SMALL, "--out", "whole").code == 0
    scene = load_scene("cornell-box").resized(12, 9, 4)
    part = RenderFolder.open(Path("part"), scene).rendered(scene)
    next(part)
    next(part)
    part.close()  # type: ignore[attr-defined]
    # The last frame of a killed one may be half written.
    (Path("part") / ".002.exr.draft").write_bytes(b"half")
    ended = labrig("render", "cornell-box", *SMALL, "--out", "part")
    assert ended.code == 0, ended.err
    for number in range(3):
        whole, resumed = (
            read_spectral_exr(Path(name) / f"{number:03d}.exr").radiance
            for name in ("whole", "part")
        )
        np.testing.assert_array_equal(whole, resumed)


def test_other_settings_do_not_mix_with_what_is_there(labrig: Callable[..., Ended]) -> None:
    assert labrig("render", "cornell-box", *SMALL, "--times", "0").code == 0
    ended = labrig("render", "cornell-box", *SMALL, "--times", "1")
    assert ended.code == 2
    assert "--out" in ended.err
    Path("mine").mkdir()
    (Path("mine") / "thesis.txt").write_text("words")
    assert labrig("render", "cornell-box", *SMALL, "--out", "mine").code == 2
    assert (Path("mine") / "thesis.txt").read_text() == "words"
    shutil.rmtree("mine")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["cornel-box"], "cornell-box"),
        (["cornell-box", "--material", "phosphorescent"], "NAME=FILE"),
        (["cornell-box", "--material", "wall=blue-paint"], "phosphorescent"),
        (["cornell-box", "--size", "0x4"], "640x480"),
        (["cornell-box", "--times", "1,0"], "rise"),
        (["cornell-box", "--times", "soon"], "0,1,80"),
        (["cornell-box", "--times", "-900"], "programme"),
        (["cornell-box", *SMALL, "--exposure", "bright"], "common"),
    ],
)
def test_what_cannot_be_rendered_is_one_line(
    labrig: Callable[..., Ended], arguments: list[str], says: str
) -> None:
    ended = labrig("render", *arguments)
    assert ended.code == 2
    assert says in ended.err.splitlines()[-1]
    assert "Traceback" not in ended.err


def test_other_programs_take_the_scene(labrig: Callable[..., Ended]) -> None:
    ended = labrig("render", "cornell-box", *SMALL, "--gltf", "box.glb", "--mitsuba", "for-mitsuba")
    assert ended.code == 0, ended.err
    assert Path("box.glb").read_bytes()[:4] == b"glTF"
    text = (Path("for-mitsuba") / "scene.xml").read_text(encoding="utf-8")
    # The wall of orange textile is the only surface that re-radiates.
    comments = re.findall(r"<!-- (.*?): preview of re-radiation", text)
    beside = (Path("for-mitsuba") / "reradiation_previews.json").read_text(encoding="utf-8")
    assert comments == list(json.loads(beside)) == ["right"]
    assert "ΔE2000" in ended.err
    scene = load_scene("cornell-box").resized(12, 9, 4)
    meshes = exported_meshes(scene, RenderFolder.open(ended.run_folder, scene))
    wall, lamp = (next(each for each in meshes if each.name == name) for name in ("left", "lamp"))
    assert wall.glow is not None
    assert lamp.glow is not None
    # The lamp goes off, and the glow of one exponential keeps its texture.
    np.testing.assert_allclose(lamp.glow.colour[:, 1] > 0, [True, False, False])
    ratio = wall.glow.colour[2, 2] / wall.glow.colour[1, 2]
    # Its own light, back from the walls, charges it a little again.
    assert ratio == pytest.approx(np.exp(-0.032 * 59.9), rel=0.04)
    assert wall.glow.lost < 0.02
