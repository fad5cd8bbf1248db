"""Answers to the page about a material in a scene."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from labrig.design import key_differences, read_wish, solve_in_scene
from labrig.foundation.errors import UsageError
from labrig.material import read_material
from labrig.reproduce import Renderer, load_scene, tristimulus
from labrig.studio.scene_bench import SceneBench
from tests.design.small_scene import corner

#: Where the floor and the wall are seen.
FRONT, ASIDE, BEHIND = [0.5, 0.62], [0.4, 0.7], [0.5, 0.2]
KEYS = [
    {"at": "1 s", "place": "dot 1", "colour": "#30c060", "brightness": 8e-3},
    {"at": "60 s", "place": "dot 1", "colour": "#30c060", "brightness": 1e-3},
]
XYZ_TO_RGB = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return corner(tmp_path_factory.mktemp("studio"))


@pytest.fixture(scope="module")
def bench(scene: Path) -> SceneBench:
    return SceneBench(str(scene), "paint", width_px=12, paths=32)


def asked(bench: SceneBench, **changes: Any) -> dict[str, Any]:
    wish = bench.start() | {"pixels": {"dot 1": FRONT}, "keys": KEYS}
    return {"wish": wish | changes}


def test_before_a_dot_the_brightest_place_is_shown(bench: SceneBench) -> None:
    answer = bench.look({"wish": bench.start()})
    assert [place["name"] for place in answer["places"]] == ["brightest place"]
    assert answer["scene"]["lamps"] == ["sun"]
    assert answer["frames_s"][0] == -300
    card = np.array(answer["places"][0]["card"])
    # A white card at the brightest place is the white, but for what the material's albedo adds.
    assert card[0] @ [0.2126, 0.7152, 0.0722] == pytest.approx(1, rel=0.03)
    assert (card[answer["first"][1] :] == 0).all()


def test_what_is_saved_renders_to_the_keys(bench: SceneBench, scene: Path, tmp_path: Path) -> None:
    content = asked(bench)
    assert max(key["delta_e"] for key in bench.look(content)["keys"]) < 1
    path = tmp_path / "paint.yaml"
    path.write_text(bench.material(content), encoding="utf-8")
    assert read_material(path).scale == "absolute"
    rendered = load_scene(scene, {"paint": str(path)}).resized(paths=64).at_times([1.0, 60.0])
    column, row = (int(12 * part) for part in FRONT)
    wish = bench.start()["scene"]
    wanted = np.pi * np.array([key["wanted"] for key in bench.look(content)["keys"]]) / np.pi
    seen = np.array(
        [
            XYZ_TO_RGB @ tristimulus(frame.radiance, rendered.bands.edges_nm)[row, column]
            for frame in Renderer(rendered, 1).frames()
        ]
    )
    seen /= wish["white_cd_per_m2"]
    assert key_differences(wanted, seen, wanted[:, 1]).max() < 2
    # the command makes the same of the saved keys
    keys = tmp_path / "keys.yaml"
    keys.write_text(bench.constraints(content), encoding="utf-8")
    assert solve_in_scene(read_wish(keys)).delta_e2000.max() < 2


def test_the_picture_shows_what_the_material_does(bench: SceneBench) -> None:
    shown = {}
    for t_s in (-1.0, 1.0, 60.0):
        picture = bench.picture_of_scene(asked(bench) | {"t_s": t_s, "exposure_ev": 6.0})
        assert picture.exposure == 64
        pixels = cv2.imdecode(np.frombuffer(picture.png, np.uint8), cv2.IMREAD_COLOR)
        assert pixels is not None
        assert pixels.shape == (12, 12, 3)
        shown[t_s] = pixels[int(12 * FRONT[1]), int(12 * FRONT[0])].astype(int)
    assert (shown[-1.0] >= 250).all(), "in the light of the sun it is overexposed"
    assert shown[1.0][1] > max(shown[1.0][0], shown[1.0][2]), "it glows green"
    assert shown[60.0][1] < shown[1.0][1]
    follows = bench.picture_of_scene(asked(bench) | {"t_s": 60.0})
    assert follows.exposure > 64


def test_other_light_and_albedo_need_no_new_paths(bench: SceneBench) -> None:
    dimmer = bench.start()["scene"]
    dimmer["programme"] = [{"at_s": -300, "lamps": {"sun": 0.5}}, {"at_s": 0, "lamps": {"sun": 0}}]
    bright = np.array(bench.look(asked(bench))["places"][0]["card"])
    dim = np.array(bench.look(asked(bench, scene=dimmer))["places"][0]["card"])
    np.testing.assert_allclose(dim[0], bright[0] / 2, rtol=1e-4)
    lighter = np.array(bench.look(asked(bench, albedo=0.9))["places"][0]["card"])
    assert (lighter[0] >= bright[0]).all()


def test_a_point_has_the_colour_of_the_material_there(bench: SceneBench) -> None:
    first = bench.look(asked(bench))["keys"][0]
    seen = bench.seen(asked(bench) | {"x": FRONT[0], "y": FRONT[1], "t_s": 1.0})
    np.testing.assert_allclose(seen, first["got"], rtol=1e-3)
    with pytest.raises(UsageError, match=r"'paint'.*'wall'"):
        bench.seen(asked(bench) | {"x": BEHIND[0], "y": BEHIND[1], "t_s": 1.0})
    with pytest.raises(UsageError, match="'wall'"):
        bench.look(asked(bench, pixels={"dot 1": BEHIND}))


def test_in_its_own_light_it_is_not_further_off(bench: SceneBench) -> None:
    again = bench.again(asked(bench))
    judged = bench.look(asked(bench) | {"by_hand": again["parameters"]})
    assert 1 <= len(again["lines"]) <= 3
    assert max(key["delta_e"] for key in judged["keys"]) < 5


def test_a_file_may_leave_the_light_to_the_scene(bench: SceneBench, scene: Path) -> None:
    text = f"scene: {{file: '{scene}', material: paint}}\npixels: {{a: [0.5, 0.62]}}\nkeys: []\n"
    assert bench.open(text)["scene"] == bench.start()["scene"]
    assert bench.look({"wish": bench.open(text)})["places"][0]["name"] == "a"


def test_what_is_meant_has_to_be_said(scene: Path, bench: SceneBench) -> None:
    with pytest.raises(UsageError, match="--material"):
        SceneBench(str(scene))
    with pytest.raises(UsageError, match="did you mean 'paint'"):
        SceneBench(str(scene), "pant")
    with pytest.raises(UsageError, match="on patches"):
        bench.look({"wish": {"light": [{"at": "0 s", "light": "D65"}], "keys": []}})
    other = {"file": "cornell-box", "material": "phosphorescent"}
    with pytest.raises(UsageError, match="labrig design cornell-box"):
        bench.look({"wish": {"scene": other, "keys": []}})
