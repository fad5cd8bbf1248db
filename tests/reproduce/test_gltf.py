"""glTF files, read as the specification of glTF 2.0 says they are to be read."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import DiskError, UsageError
from labrig.reproduce import ExportedMesh, Glow, Pinhole, write_gltf
from tests.reproduce.gltf_reader import CORNERS, FACES, GREY, TIMES_S, Read, mesh

UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
DECAY = np.outer(np.exp(-TIMES_S / 2), [0.5, 4.0, 2.0])


def test_a_mesh_is_read_as_it_was(tmp_path: Path) -> None:
    write_gltf(tmp_path / "a.glb", [mesh(uv=UV)], [0.0])
    read = Read(tmp_path / "a.glb")
    primitive = read.primitive(0)
    np.testing.assert_array_equal(read.accessor(primitive["attributes"]["POSITION"]), CORNERS)
    indices = read.accessor(primitive["indices"])
    np.testing.assert_array_equal(indices.reshape(-1, 3), FACES)
    places = read.accessor(primitive["attributes"]["TEXCOORD_0"])
    np.testing.assert_array_equal(places, np.stack([UV[:, 0], 1 - UV[:, 1]], axis=1))
    surface = read.material(0)["pbrMetallicRoughness"]
    assert surface["baseColorFactor"] == [*GREY, 1.0]
    assert surface["metallicFactor"] == 0
    assert read.json["asset"]["version"] == "2.0"
    assert "extensionsUsed" not in read.json
    assert "animations" not in read.json
    root = read.json["nodes"][read.json["scenes"][read.json["scene"]]["nodes"][0]]
    assert [read.json["nodes"][child]["mesh"] for child in root["children"]] == [0]


def test_a_glow_is_animated_with_its_radiance(tmp_path: Path) -> None:
    meshes = [mesh(), mesh(Glow(DECAY)), mesh(Glow(0.01 * DECAY[:, ::-1]))]
    write_gltf(tmp_path / "a.glb", meshes, TIMES_S, exposure=0.25)
    read = Read(tmp_path / "a.glb")
    assert set(read.json["extensionsUsed"]) == {
        "KHR_materials_emissive_strength",
        "KHR_animation_pointer",
    }
    np.testing.assert_allclose(read.emission(1), 0.25 * DECAY, rtol=1e-6)
    np.testing.assert_allclose(read.emission(2), 0.0025 * DECAY[:, ::-1], rtol=1e-6)
    # Before the animation runs, the first frame is shown.
    first = np.array(read.material(1)["emissiveFactor"]) * read.strength(1)
    np.testing.assert_allclose(first, 0.25 * DECAY[0])
    assert "emissiveFactor" not in read.material(0)


def test_a_texture_times_its_course_is_the_glow(tmp_path: Path) -> None:
    pattern = np.random.default_rng(1).uniform(0.0, 3.0, (6, 9, 3))
    whole = DECAY[:, np.newaxis, np.newaxis] * pattern
    glow = Glow.of_textures(whole)
    assert glow.lost < 1e-7
    write_gltf(tmp_path / "a.glb", [mesh(glow, UV)], TIMES_S)
    read = Read(tmp_path / "a.glb")
    shown = read.emission(0)[:, np.newaxis, np.newaxis] * read.texture(0)
    # A byte of sRGB is at most 0.9 % of the full scale of its channel.
    full = whole.max(axis=(0, 1, 2)) / whole.max()
    np.testing.assert_allclose(
        shown / whole.max(), whole / whole.max(), atol=float(full.max()) / 200
    )


def test_several_rates_have_one_course_and_the_loss_is_told(tmp_path: Path) -> None:
    fast, slow = np.exp(-TIMES_S / 0.5), np.exp(-TIMES_S / 10)
    whole = np.zeros((4, 1, 2, 3))
    whole[:, 0, 0], whole[:, 0, 1] = fast[:, None], slow[:, None]
    glow = Glow.of_textures(whole)
    assert glow.texture is not None
    product = glow.colour[:, None, None] * glow.texture
    # The best of rank one by another way.
    table = whole[..., 0].reshape(4, 2)
    u, s, v = np.linalg.svd(table)
    np.testing.assert_allclose(product[..., 0].reshape(4, 2), s[0] * np.outer(u[:, 0], v[0]))
    assert glow.lost == pytest.approx(np.sqrt((s[1:] ** 2).sum() / (s**2).sum()))
    assert glow.lost > 0.1
    write_gltf(tmp_path / "a.glb", [mesh(glow, UV)], TIMES_S)
    extras = Read(tmp_path / "a.glb").material(0)["extras"]
    assert extras["lostByOneCourseRms"] == pytest.approx(glow.lost)


@given(st.integers(1, 6), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_one_course_is_never_worse_than_the_mean_picture(frames: int, size: int, seed: int) -> None:
    whole = np.random.default_rng(seed).uniform(0, 1, (frames, size, size, 3)) ** 3
    glow = Glow.of_textures(whole)
    assert glow.texture is not None
    error = whole - glow.colour[:, None, None] * glow.texture
    assert np.sqrt((error**2).sum() / (whole**2).sum()) == pytest.approx(glow.lost, abs=1e-9)
    of_mean = whole - whole.mean(axis=0)
    assert (error**2).sum() <= (of_mean**2).sum() + 1e-12


def test_darkness_is_no_glow(tmp_path: Path) -> None:
    dark = Glow.of_textures(np.zeros((4, 2, 2, 3)))
    write_gltf(tmp_path / "a.glb", [mesh(dark, UV)], TIMES_S)
    read = Read(tmp_path / "a.glb")
    assert read.strength(0) == 0
    assert "animations" not in read.json


def test_a_camera_sees_its_target_in_the_middle(tmp_path: Path) -> None:
    camera = Pinhole((1.0, 2.0, 3.0), (0.0, 0.5, -1.0), (0.0, 0.0, 1.0), 35.0, 640, 480)
    write_gltf(tmp_path / "a.glb", [mesh()], [0.0], camera=camera, up="z")
    read = Read(tmp_path / "a.glb")
    (node,) = [one for one in read.json["nodes"] if "camera" in one]
    to_world = np.array(node["matrix"]).reshape(4, 4).T
    assert np.linalg.det(to_world[:3, :3]) == pytest.approx(1.0)
    target = np.linalg.inv(to_world) @ [0.0, 0.5, -1.0, 1.0]
    np.testing.assert_allclose(target[:2], 0.0, atol=1e-12)
    assert target[2] < 0
    above = np.linalg.inv(to_world) @ [0.0, 0.5, -0.9, 1.0]
    assert above[1] > 0
    perspective = read.json["cameras"][0]["perspective"]
    assert perspective["yfov"] == pytest.approx(np.deg2rad(35))
    assert perspective["aspectRatio"] == pytest.approx(4 / 3)
    x, y, z, w = read.json["nodes"][read.json["scenes"][0]["nodes"][0]]["rotation"]
    # (0, 0, 1) turned by the quaternion is (0, 1, 0).
    turned = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(turned, [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    "times_s", [[0.0, 1.0, 2.0], [0.0, 1.0, 1.0, 2.0], [-1.0, 0.0, 1.0, 2.0], [0.0, 1, 2, np.nan]]
)
def test_times_that_do_not_fit_are_refused(tmp_path: Path, times_s: list[float]) -> None:
    with pytest.raises(UsageError, match=r"^expected [^\n]*times[^\n]*$"):
        write_gltf(tmp_path / "a.glb", [mesh(Glow(DECAY))], times_s)


def test_meshes_that_are_none_are_refused(tmp_path: Path) -> None:
    textured = Glow(DECAY, np.ones((2, 2, 3)))
    for wrong in (
        lambda: ExportedMesh("a", CORNERS[:, :2], FACES, GREY),
        lambda: ExportedMesh("a", CORNERS, FACES + 2, GREY),
        lambda: ExportedMesh("a", CORNERS * np.nan, FACES, GREY),
        lambda: ExportedMesh("a", CORNERS, FACES, GREY * 4),
        lambda: ExportedMesh("a", CORNERS, FACES, GREY, UV[:2]),
        lambda: mesh(textured),
        lambda: Glow(-DECAY),
        lambda: Glow(DECAY[0]),
        lambda: Glow.of_textures(np.ones((2, 2, 3))),
        lambda: Pinhole((0, 0, 0), (0, 0, 1), (0, 0, 2), 40, 10, 10),
        lambda: Pinhole((0, 0, 0), (0, 0, 1), (0, 1, 0), 180, 10, 10),
        lambda: write_gltf(tmp_path / "a.glb", [], [0.0]),
        lambda: write_gltf(tmp_path / "a.gltf", [mesh()], [0.0]),
        lambda: write_gltf(tmp_path / "a.glb", [mesh()], [0.0], exposure=0.0),
        lambda: write_gltf(tmp_path / "a.glb", [mesh(Glow(DECAY)), mesh(Glow(DECAY[:2]))], TIMES_S),
    ):
        with pytest.raises(UsageError, match=r"^[^\n]+$"):
            wrong()
    with pytest.raises(DiskError):
        write_gltf(tmp_path / "none/a.glb", [mesh()], [0.0])
