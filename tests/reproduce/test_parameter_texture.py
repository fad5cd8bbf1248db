"""Parameters of a phosphor that differ from place to place."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.design import propagate
from labrig.foundation.errors import UsageError
from labrig.material import read_material, write_material
from labrig.reproduce import (
    ParameterTexture,
    Renderer,
    read_parameter_texture,
    write_parameter_texture,
)
from tests.reproduce.small_scenes import LUX, kappa_of, scene

PAINT = {"file": "blue-paint", "assume_albedo": 0.6, "assume_scale": 0.5}
LEFT = {"corner_m": [0, 0, 0], "edge_u_m": [0.5, 0, 0], "edge_v_m": [0, 1, 0]}
RIGHT = {"corner_m": [0.5, 0, 0], "edge_u_m": [0.5, 0, 0], "edge_v_m": [0, 1, 0]}
WHOLE = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]}


def halves(left: Any, right: Any, rows: int = 2, columns: int = 8) -> np.ndarray[Any, Any]:
    """An array of texels, the left half with one value and the right with another."""
    whole = np.empty((rows, columns, *np.shape(left)))
    whole[:, : columns // 2], whole[:, columns // 2 :] = left, right
    return whole


def test_a_texture_of_two_halves_is_like_two_materials(tmp_path: Path) -> None:
    """The second half is slower, less excited, of another colour and darker."""
    blue = read_material("blue-paint").states[0]
    assert blue.k_e_per_s is not None
    assert blue.reradiation is not None
    k_e, emitted = np.array(blue.k_e_per_s), np.array(blue.reradiation)
    other = blue.model_copy(
        update={
            "k_r_per_s": 0.01,
            "k_e_per_s": tuple(0.5 * k_e),
            "reradiation": tuple(0.3 * emitted[::-1]),
        }
    )
    texture = ParameterTexture.checked(
        halves([blue.k_r_per_s], [0.01]),
        halves([k_e], [0.5 * k_e]),
        halves([emitted], [0.3 * emitted[::-1]]),
        halves(1.0, 0.5),
    )
    write_parameter_texture(tmp_path / "paint.npz", texture)
    write_material(
        tmp_path / "other.yaml",
        read_material("blue-paint").model_copy(update={"states": (other,), "spectrum": None}),
    )
    write_material(
        tmp_path / "blue.yaml", read_material("blue-paint").model_copy(update={"spectrum": None})
    )
    entry = {**PAINT, "file": str(tmp_path / "blue.yaml")}
    one = scene(
        tmp_path,
        materials={"paint": {**entry, "texture": "paint.npz"}},
        objects={"square": {"material": "paint", "rectangle": WHOLE, "samples": [8, 4]}},
        paths={"per_pixel": 1, "per_place": 16},
    )
    two = scene(
        tmp_path,
        materials={
            "paint": entry,
            "other": {**entry, "file": str(tmp_path / "other.yaml"), "assume_albedo": 0.3},
        },
        objects={
            "left": {"material": "paint", "rectangle": LEFT, "samples": [4, 4]},
            "right": {"material": "other", "rectangle": RIGHT, "samples": [4, 4]},
        },
        paths={"per_pixel": 1, "per_place": 16},
    )
    for ours, theirs in zip(Renderer(one).frames(), Renderer(two).frames(), strict=True):
        # The columns in the middle of each half: texels go over into each other between them.
        columns = ours.radiance[:, [0, 3]], theirs.radiance[:, [0, 3]]
        np.testing.assert_allclose(*columns, rtol=2e-4, atol=1e-6 * theirs.radiance.max())
        assert ours.radiance[:, 0].sum() > 1.3 * ours.radiance[:, 3].sum() > 0


@pytest.mark.parametrize("samples", [[16, 16], "vertices"])
def test_an_edit_that_was_spread_over_a_texture_is_rendered(tmp_path: Path, samples: Any) -> None:
    """The design tool's texture: log rates and Λ of two paints, one of which is edited."""
    material = read_material("blue-paint")
    state = material.states[0]
    assert state.reradiation is not None
    bands = len(state.reradiation)
    colours = halves([0.0], [1.0], 32, 32)
    values = np.tile(np.log([state.k_r_per_s, *np.maximum(state.reradiation, 1e-9)]), (32, 32, 1))
    weights = np.zeros((32, 32))
    weights[8, 8] = 1.0
    edited = propagate(values, colours, values + np.log([0.25, *[2.0] * bands]), weights)
    texture = ParameterTexture.checked(
        np.exp(edited[..., :1]), reradiation=np.exp(edited[..., np.newaxis, 1:])
    )
    write_parameter_texture(tmp_path / "paint.npz", texture)
    assert texture.k_r_per_s is not None
    rates = texture.k_r_per_s[:, :, 0]
    assert rates[:, :12].mean() < 0.3 * state.k_r_per_s
    built = scene(
        tmp_path,
        materials={"paint": {**PAINT, "texture": "paint.npz"}},
        objects={"square": {"material": "paint", "rectangle": {**WHOLE, "parts": 16},
                            "samples": samples}},
        paths={"per_pixel": 1, "per_place": 4},
    )  # fmt: skip
    renderer = Renderer(built)
    renderer.frame(60.0)
    levels = renderer.levels["paint"][0].reshape(-1, 17 if samples == "vertices" else 16)
    kappa = float(kappa_of(material, LUX)[0])
    for column, k_r in ((2, float(rates[16, 4])), (13, state.k_r_per_s)):
        charged = kappa / (kappa + k_r) * -np.expm1(-(kappa + k_r) * 300)
        expected = charged * np.exp(-k_r * 60)
        np.testing.assert_allclose(levels[:, column], expected, rtol=0.03)


def test_a_texture_stands_as_a_picture_does() -> None:
    """Its upper left is where u is 0 and v is 1."""
    texture = ParameterTexture.checked(albedo_factor=[[1.0, 2.0], [3.0, 4.0]])
    uv = np.array([[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [0.7, 0.2]])
    factor = texture.texels("albedo_factor")
    assert factor is not None
    assert factor[texture.texel_at(uv)].tolist() == [1.0, 2.0, 3.0, 4.0]


def test_a_darker_texture_returns_less_light(tmp_path: Path) -> None:
    """Light that comes back twice in a room is less by the square of the factor."""
    room = {"centre_m": [0.5, 0.5, 0.5], "size_m": [2, 2, 8], "inward": True}
    seen = []
    for factor in (1.0, 0.5):
        texture = ParameterTexture.checked(albedo_factor=np.full((1, 1), factor))
        write_parameter_texture(tmp_path / f"{factor}.npz", texture)
        built = scene(
            tmp_path,
            materials={"paint": {**PAINT, "texture": f"{factor}.npz", "levels": 1.0}},
            lamps={},
            objects={"room": {"material": "paint", "box": room, "samples": [3, 2]}},
            programme=[{"at_s": 0, "lamps": {}}],
            frames_s=[0],
            paths={"per_pixel": 4, "per_place": 1, "vertices": 12, "survival": 0.0},
        )
        seen.append(next(Renderer(built).frames()).radiance.sum())
    bounces = [sum((0.6 * factor) ** n for n in range(12)) for factor in (1.0, 0.5)]
    assert seen[0] / seen[1] == pytest.approx(bounces[0] / bounces[1], rel=1e-4)


@pytest.mark.parametrize(
    ("arrays", "entry", "thing", "says"),
    [
        ({"k_r_per_s": np.ones((2, 2, 3))}, {}, {}, "k_r_per_s"),
        ({"reradiation": np.ones((2, 2, 1, 3))}, {}, {}, "reradiation"),
        ({"k_r_per_s": np.ones((2, 2))}, {}, {}, "states"),
        ({"k_r_per_s": -np.ones((2, 2, 1))}, {}, {}, "≥ 0"),
        ({"k_r_per_s": np.full((2, 2, 1), np.nan)}, {}, {}, "finite"),
        ({"k_r_per_s": np.ones((2, 2, 1)), "albedo_factor": np.ones((3, 2))}, {}, {}, "rows"),
        ({"albedo_factor": np.full((2, 2), 2.0)}, {}, {}, "below 1"),
        ({"rate": np.ones((2, 2))}, {}, {}, "'rate'"),
        ({}, {}, {}, "one of them"),
        ({"albedo_factor": np.array(["x"], dtype=object)}, {}, {}, "npz"),
        ({"albedo_factor": np.ones((2, 2))}, {"file": "yellow-textile"}, {}, "phosphor"),
        (
            {"albedo_factor": np.ones((2, 2))},
            {},
            {"mesh": {"file": "a.obj"}, "rectangle": None, "samples": "vertices"},
            "texture coordinates",
        ),
        ({"reradiation": np.full((2, 2, 1, 8), 1e4)}, {}, {}, "less light than it takes"),
        ({"k_r_per_s": np.ones((2, 2, 1))}, {"file": "order.yaml"}, {}, "material_map"),
    ],
)
def test_a_texture_that_does_not_fit_is_one_line(
    tmp_path: Path,
    arrays: dict[str, Any],
    entry: dict[str, Any],
    thing: dict[str, Any],
    says: str,
) -> None:
    np.savez(tmp_path / "paint.npz", **arrays)
    blue = read_material("blue-paint")
    ordered = blue.states[0].model_copy(update={"kinetic_order": 2.0})
    write_material(tmp_path / "order.yaml", blue.model_copy(update={"states": (ordered,)}))
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    )
    square = {"material": "paint", "rectangle": WHOLE, "samples": [4, 4], **thing}
    with pytest.raises(UsageError, match=says) as raised:
        Renderer(
            scene(
                tmp_path,
                materials={"paint": {**PAINT, "texture": "paint.npz", **entry}},
                objects={"square": square},
            )
        )
    assert "\n" not in str(raised.value)


def test_a_texture_is_read_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    texture = ParameterTexture.checked(rng.random((3, 5, 2)), albedo_factor=rng.random((3, 5)))
    write_parameter_texture(tmp_path / "paint.npz", texture)
    again = read_parameter_texture(tmp_path / "paint.npz")
    np.testing.assert_array_equal(again.k_r_per_s, texture.k_r_per_s)
    np.testing.assert_array_equal(again.albedo_factor, texture.albedo_factor)
    assert again.k_e_per_s is None
    assert [path.name for path in tmp_path.iterdir()] == ["paint.npz"]
