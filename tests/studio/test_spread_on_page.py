"""Dots of a scene with a material each, as the page asks for them."""

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from labrig.design import read_wish, solve_spread
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml
from labrig.studio.scene_bench import SceneBench
from tests.design.small_scene import corner
from tests.design.spread_keys import OBJECTS, PIXELS, keys


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> SceneBench:
    return SceneBench(str(corner(tmp_path_factory.mktemp("scene"), objects=OBJECTS)), "paint")


def asked(bench: SceneBench, spread: dict[str, Any] | None, **changes: Any) -> dict[str, Any]:
    first = bench.start()
    scene = first["scene"] | ({} if spread is None else {"spread": spread})
    return {"wish": first | {"scene": scene, "pixels": PIXELS, "keys": keys()} | changes}


def test_every_dot_has_its_own_material(bench: SceneBench) -> None:
    one, own = bench.look(asked(bench, None)), bench.look(asked(bench, {}))
    assert max(key["delta_e"] for key in one["keys"]) > 10
    assert max(key["delta_e"] for key in own["keys"]) < 0.5
    rates = [place["material"]["parameters"]["k_r_per_s"][0] for place in own["places"]]
    assert rates == pytest.approx([0.03, 0.01], rel=0.03)
    frames = np.array(own["frames_s"])
    for key in own["keys"]:
        after = int(np.argmin(abs(frames - key["at_s"])))
        shown = own["places"][key["place"]]["rgb"][after]
        np.testing.assert_allclose(shown, key["got"], rtol=0.3)


def test_a_file_of_the_page_is_solved_to_the_same(bench: SceneBench, tmp_path: Path) -> None:
    content = asked(bench, {"strokes": {"left": [[0.45, 0.8, 0.05]]}, "position": 5})
    (tmp_path / "wish.yaml").write_text(bench.constraints(content), encoding="utf-8")
    found = solve_spread(read_wish(tmp_path / "wish.yaml"))
    with np.load(io.BytesIO(bench.texture(content))) as kept:
        assert kept["k_r_per_s"].shape == (16, 16, 1)
        assert found.texture.k_r_per_s is not None
        # Rendering it counts the glow in, which is faint beside the lamp.
        np.testing.assert_allclose(kept["k_r_per_s"], found.texture.k_r_per_s, rtol=0.02)
    assert len(parse_yaml(bench.material(content), "material")["states"]) == 1


def test_the_picture_shows_both(bench: SceneBench) -> None:
    content = asked(bench, {})
    png = bench.picture_of_scene(content | {"t_s": 1.0}).png
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    height, width = picture.shape[:2]
    left, right = (picture[int(y * height), int(x * width)] for x, y in PIXELS.values())
    assert left[1] > 1.2 * left[0]
    assert right[0] > 1.2 * right[1]
    seen = bench.seen(content | {"x": 0.3, "y": 0.6, "t_s": 1.0})
    np.testing.assert_allclose(seen, keys()[0]["colour"], rtol=0.05)


def test_rendering_it_tells_the_differences(bench: SceneBench) -> None:
    again = bench.again(asked(bench, {}))
    assert again["parameters"] is None
    # The glow charges, too, which the light of the lamps leaves out.
    told = float(again["lines"][0].split("ΔE2000 ")[1].split()[0])
    assert 0.5 < told < 8


def test_one_material_has_no_texture(bench: SceneBench) -> None:
    with pytest.raises(UsageError, match="one material for all"):
        bench.texture(asked(bench, None))
