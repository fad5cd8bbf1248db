"""Meshes of files in a scene: which side is their front, how they are lit, and their exports."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.reproduce import (
    Mesh,
    Renderer,
    RenderFolder,
    Scene,
    SceneFile,
    build_scene,
    exported_meshes,
    read_mesh,
    write_gltf,
    write_mitsuba_scene,
)
from tests.reproduce.gltf_files import GltfFile
from tests.reproduce.mesh_truth import truth

PAIR = Path(__file__).parent / "meshes" / "pair_one_mirrored.glb"


def scene(folder: Path, file: Path, objects: dict[str, Any] | None = None, **keys: Any) -> Scene:
    """A grey object below a sky of one luminance."""
    return build_scene(
        SceneFile.model_validate({
            "name": "pair", "kind": "scene", "bands": {"count": 2},
            "materials": {"grey": {"albedo": 0.5}},
            "lamps": {"sky": {"kind": "sky", "luminance_cd_per_m2": 100}},
            "objects": {"thing": {"material": "grey", "mesh": {"file": str(file), **keys},
                                  **(objects or {})}},
            "camera": {"position_m": [0, 0.8, 6], "look_at_m": [0, 0, 0], "up": [0, 1, 0],
                       "vertical_fov_deg": 20, "width_px": 32, "height_px": 16},
            "programme": [{"at_s": 0, "lamps": {"sky": 1}}], "frames_s": [0],
            "paths": {"per_pixel": 256, "per_place": 16},
        }),
        folder,
    )  # fmt: skip


def write_obj(path: Path, *bodies: Mesh) -> Path:
    whole = Mesh.joined(bodies)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in whole.vertices_m]
    path.write_text(
        "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in whole.faces + 1]), encoding="utf-8"
    )
    return path


def box(x: float, size: float) -> Mesh:
    made = Mesh.box((x, 0, 0), (size, size, size))
    return Mesh(made.vertices_m, made.faces)


def test_mirrored_twins_are_lit_alike(tmp_path: Path) -> None:
    twins = scene(tmp_path, PAIR)
    (frame,) = Renderer(twins).frames()
    # Behind the cubes there is the sky itself.
    light = np.asarray(frame.radiance[..., 0])
    light = np.where(light < light.max() / 1.5, light, 0.0)
    left, right = light[:, :16].sum(), light[:, 16:].sum()
    assert left > 0
    assert right == pytest.approx(left, rel=0.01)
    assert light[:, ::-1][light > 0] == pytest.approx(light[light > 0], rel=0.25)


def test_mirrored_twins_are_exported_alike(tmp_path: Path) -> None:
    twins = scene(tmp_path, PAIR).resized(width_px=4, height_px=4, paths=1)
    folder = RenderFolder.open(tmp_path / "rendered", twins)
    assert len(list(folder.rendered(twins))) == 1
    meshes = exported_meshes(twins, folder)
    write_gltf(tmp_path / "pair.glb", meshes, [0.0], up="z")
    write_mitsuba_scene(tmp_path / "mitsuba", meshes, twins.camera)
    for path in (tmp_path / "pair.glb", tmp_path / "mitsuba" / "mesh_00.ply"):
        assert truth(path).volume == pytest.approx(2)
        both = read_mesh(path)
        assert [piece.volume_m3 for piece in both.pieces()] == pytest.approx([1, 1])
        assert sorted(piece.vertices_m[:, 0].mean() for piece in both.pieces()) == [-1, 1]


def test_one_mirrored_mesh_is_taken_as_it_is_meant(tmp_path: Path) -> None:
    file = PAIR.with_name("mirrored.glb")
    for objects in ({}, {"two_sided": True}):
        (surface,) = scene(tmp_path, file, objects).surfaces(0.0)
        assert surface.mesh.volume_m3 == pytest.approx(1)
    (surface,) = scene(tmp_path, file, inward=True).surfaces(0.0)
    assert surface.mesh.volume_m3 == pytest.approx(-1)


def test_a_mirrored_lamp_shines_from_its_front(tmp_path: Path) -> None:
    """A cube of 1 cd/m² is seen with that from without."""
    content = scene(tmp_path, PAIR).file.model_dump(exclude_unset=True)
    content["lamps"] = {"cube": {"kind": "area", "luminance_cd_per_m2": 1}}
    content["objects"] = {"thing": {"lamp": "cube", "mesh": {"file": str(PAIR)}}}
    content["programme"] = [{"at_s": 0, "lamps": {"cube": 1}}]
    (frame,) = Renderer(build_scene(SceneFile.model_validate(content), tmp_path)).frames()
    light = np.asarray(frame.radiance[..., 0])
    assert light[:, 16:].sum() > 0
    assert light[:, 16:].sum() == pytest.approx(light[:, :16].sum(), rel=0.01)


def test_halves_that_are_mirrored_make_one_body(tmp_path: Path) -> None:
    """Half of a box, open at the plane of its mirror image."""
    half = Mesh.box((0.5, 0, 0), (1, 1, 1))
    outer = half.faces[~(half.vertices_m[half.faces][..., 0] == 0).all(axis=1)]
    file = GltfFile()
    shape = file.mesh(half.vertices_m, outer)
    file.show(mesh=shape)
    file.show(mesh=shape, scale=[-1, 1, 1])
    (surface,) = scene(tmp_path, file.write(tmp_path / "a.glb")).surfaces(0.0)
    assert surface.mesh.is_closed
    assert surface.mesh.volume_m3 == pytest.approx(2)


@pytest.mark.parametrize(
    ("bodies", "inward", "is_right"),
    [
        ([box(0, 1)], False, True),
        ([box(0, 1).turned_over()], False, False),
        # A smaller one that is inverted does not show in the whole volume.
        ([box(0, 2), box(3, 1)], False, True),
        ([box(0, 2), box(3, 1).turned_over()], False, False),
        # A hollow in a body, a body in the hollow, and one that reaches into another.
        ([box(0, 3), box(0, 2).turned_over()], False, True),
        ([box(0, 3), box(0, 2).turned_over(), box(0, 1)], False, True),
        ([box(0, 3), box(0, 2).turned_over(), box(0, 1).turned_over()], False, False),
        ([box(0, 2), box(1.2, 1)], False, True),
        # Side by side, one that stands before another, and ones that reach into each other.
        ([box(0, 1), box(1, 1)], False, True),
        ([box(1, 1), box(0, 1).turned_over()], False, False),
        ([box(0, 2), box(1.5, 1).turned_over()], False, False),
        ([box(0, 2), box(1, 2)], False, True),
        # Rooms, drawn from without or from within, and what stands in them.
        ([box(0, 3)], True, True),
        ([box(0, 3).turned_over()], True, True),
        ([box(0, 3).turned_over(), box(0, 1)], True, True),
        ([box(0, 3).turned_over(), box(0, 1).turned_over()], True, False),
    ],
)
def test_each_body_has_its_front_where_it_is_seen(
    tmp_path: Path, bodies: list[Mesh], inward: bool, is_right: bool
) -> None:
    file = write_obj(tmp_path / "a.obj", *bodies)
    if is_right:
        (surface,) = scene(tmp_path, file, inward=inward).surfaces(0.0)
        assert (surface.mesh.volume_m3 < 0) == inward
        return
    with pytest.raises(UsageError, match=r"^thing: [^\n]*front[^\n]*a\.obj[^\n]*$"):
        scene(tmp_path, file, inward=inward)
    (surface,) = scene(tmp_path, file, {"two_sided": True}).surfaces(0.0)
    assert len(surface.mesh.faces) == 12 * len(bodies)
