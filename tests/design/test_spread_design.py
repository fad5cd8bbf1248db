"""Dots of a scene with a material each, spread over the surface they lie on."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from labrig.design import (
    RGB_TO_Y,
    SpreadDesign,
    key_differences,
    read_wish,
    solve_spread,
)
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import yaml_text
from labrig.reproduce import Renderer, load_scene, read_scene
from tests.conftest import Ended
from tests.design.small_scene import corner
from tests.design.spread_keys import GLOWS, OBJECTS, PIXELS, TIMES_S, keys

Labrig = Callable[..., Ended]


def written(folder: Path, objects: dict[str, Any] = OBJECTS, **changed: Any) -> Path:
    corner(folder, objects=objects)
    spread = changed.pop("spread", {})
    scene = {"file": "corner.yaml", "material": "paint", "white_cd_per_m2": 400.0}
    whole = {"scene": scene | {"spread": spread}, "albedo": 0.5, "pixels": PIXELS, "keys": keys()}
    path = folder / "wish.yaml"
    path.write_text(yaml_text(whole | changed), encoding="utf-8")
    return path


def solved(folder: Path, **changed: Any) -> SpreadDesign:
    return solve_spread(read_wish(written(folder, **changed)), folder)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> SpreadDesign:
    return solved(tmp_path_factory.mktemp("spread"))


def test_every_dot_has_the_glow_it_is_wished(found: SpreadDesign) -> None:
    assert found.base.delta_e2000.min() > 5
    assert found.delta_e2000.max() < 0.5
    assert found.rendered_delta_e2000.max() < 0.5
    for place, (_, rate) in enumerate(GLOWS.values()):
        row, column = found.texel_of(place)
        assert found.texture.k_r_per_s is not None
        assert found.texture.k_r_per_s[row, column, 0] == pytest.approx(rate, rel=0.03)
        assert found.shares[row, column, place] == pytest.approx(1, abs=1e-3)


def test_between_two_dots_a_rate_is_between_theirs(found: SpreadDesign) -> None:
    assert found.texture.k_r_per_s is not None
    row, left = found.texel_of(0)
    _, right = found.texel_of(1)
    rates = found.texture.k_r_per_s[row, left : right + 1, 0]
    assert (np.diff(rates) < 1e-6).all()
    middle = rates[len(rates) // 2]
    assert 0.012 < middle < 0.027


def test_what_no_key_determines_is_the_same_everywhere(found: SpreadDesign) -> None:
    """After one constant light only the product of k_e and Λ is known."""
    k_e = [design.k_e_per_s for design in found.of_places]
    np.testing.assert_allclose(k_e[0], k_e[1], rtol=0.05)
    np.testing.assert_allclose(k_e[0], found.base.k_e_per_s, rtol=0.05)


def test_no_texel_emits_more_than_it_absorbs(found: SpreadDesign) -> None:
    texture = found.texture
    assert texture.k_e_per_s is not None
    assert texture.reradiation is not None
    assert found.material.albedo is not None
    energy = np.pi * texture.reradiation.astype(float) @ np.diff(found.spectra.edges_nm)
    ratio = np.einsum("rcs,rcsb->rcb", energy, texture.k_e_per_s)
    ratio /= 1 - np.array(found.material.albedo.value)
    assert ratio.max() < 1.001


def test_the_written_scene_is_rendered_to_the_same_picture(
    labrig: Labrig, tmp_path: Path, found: SpreadDesign
) -> None:
    path = written(tmp_path)
    ended = labrig("design", "--constraints", path, "--out", tmp_path / "made.yaml")
    assert ended.code == 0, ended.err
    assert "paint: {file: made.yaml, texture: made-texture.npz}" in ended.out
    file, _ = read_scene(tmp_path / "corner.yaml")
    content = file.model_dump(mode="json", exclude_unset=True)
    content["materials"]["paint"] = {"file": "made.yaml", "texture": "made-texture.npz"}
    content["frames_s"] = TIMES_S
    (tmp_path / "spread.yaml").write_text(yaml_text(content), encoding="utf-8")
    frames = list(Renderer(load_scene(tmp_path / "spread.yaml"), 1).frames())
    rendered = found.spectra.rgb(np.array([frame.radiance for frame in frames], dtype=float))
    np.testing.assert_allclose(found.pictures(TIMES_S), rendered, rtol=2e-3, atol=1e-8)
    # The stored light knows no charging by the glow itself.
    for t_s, frame in zip(TIMES_S, rendered, strict=True):
        np.testing.assert_allclose(found.picture(t_s), frame, rtol=0.02, atol=1e-6)
    for name, (x, y) in PIXELS.items():
        seen = rendered[:, int(12 * y), int(12 * x)]
        wanted = np.array([key["colour"] for key in keys() if key["place"] == name])
        # A pixel shows several texels.
        assert key_differences(wanted, seen, wanted[:, 1]).max() < 6


def test_a_picture_of_the_surface_bounds_what_is_alike(tmp_path: Path) -> None:
    """A dot in the dark half reaches all of that, and nothing of the bright one."""
    halves = np.zeros((16, 16, 3), np.uint8)
    halves[:, 8:] = 255
    cv2.imwrite(str(tmp_path / "halves.png"), halves)
    one = solved(
        tmp_path, spread={"appearance_file": "halves.png", "position": 60}, keys=keys()[:3]
    )
    assert one.shares[:, :8, 0].min() > 0.9
    assert one.shares[:, 8:, 0].max() < 0.1


def test_a_stroke_gives_texels_to_its_dot(tmp_path: Path) -> None:
    narrow = {"position": 1.0, "brush": 1.0}
    plain = solved(tmp_path, spread=narrow)
    # A stroke at the right of the left dot's surroundings, near to the right dot.
    painted = solved(tmp_path, spread=narrow | {"strokes": {"left": [[0.5, 0.75, 0.06]]}})
    place = painted.light.texels.texels_of(
        painted.light.places[[painted.light.place_at(0.5, 0.75)]]
    )
    row, column = int(place[0][0]), int(place[1][0])
    assert painted.shares[row, column, 0] > plain.shares[row, column, 0] + 0.3
    assert painted.delta_e2000.max() < 1


def test_an_own_albedo_is_brighter_but_of_the_same_colour(tmp_path: Path) -> None:
    lit = [
        {"at": "-1 s", "place": "left", "colour": [0.6, 0.6, 0.6]},
        {"at": "-1 s", "place": "right", "colour": [0.3, 0.3, 0.3]},
    ]
    own = solved(tmp_path, albedo="free", keys=keys() + lit)
    factor = own.texture.albedo_factor
    assert factor is not None
    left, right = factor[own.texel_of(0)], factor[own.texel_of(1)]
    assert left / right == pytest.approx(2, rel=0.15)
    assert own.rendered_rgb is not None
    luminance = np.pi * own.rendered_rgb[-2:] @ RGB_TO_Y
    np.testing.assert_allclose(luminance, [0.6, 0.3], rtol=0.03)
    assert own.rendered_delta_e2000[:-2].max() < 0.5


def test_why_keys_are_missed_is_said(tmp_path: Path, found: SpreadDesign) -> None:
    assert found.notes == ()
    (shared,) = solved(tmp_path, pixels={"left": [0.5, 0.6], "right": [0.505, 0.6]}).notes
    assert "left and right lie in one texel" in shared
    late = [{"at": f"{t} s", "place": "left", "colour": [0.3, 0.4, 0.3]} for t in (1, 50)]
    (short,) = solved(tmp_path, keys=late).notes
    assert "left: keys are missed where nearly all light" in short


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"objects": OBJECTS | {"back": OBJECTS["back"] | {"material": "paint"}}}, "one object"),
        (
            {"objects": OBJECTS | {"floor": OBJECTS["floor"] | {"samples": "vertices"}}},
            r"samples: \[columns, rows\]",
        ),
        ({"order": 2}, "order: 1"),
        ({"spread": {"strokes": {"lefd": [[0.5, 0.5, 0.1]]}}}, "did you mean 'left'"),
        ({"spread": {"position": 0}}, "position"),
        ({"spread": {"appearance_file": "none.png"}}, "none.png"),
        ({"keys": []}, "at least one key"),
    ],
    ids=["two objects", "vertices", "order", "stroke", "reach", "picture", "no key"],
)
def test_what_cannot_be_spread_is_one_line(
    tmp_path: Path, changed: dict[str, Any], why: str
) -> None:
    with pytest.raises(UsageError, match=why) as caught:
        solved(tmp_path, **changed)
    assert "\n" not in str(caught.value)
