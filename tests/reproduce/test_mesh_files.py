"""Meshes from files: areas, bounds and volumes are those of the files, or there is one line."""

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.reproduce import Mesh, read_mesh
from tests.reproduce.gltf_files import GltfFile
from tests.reproduce.mesh_truth import Truth, truth

MADE = Path(__file__).parent / "meshes"
#: Area, volume, and bounds along x.
KNOWN = {
    "concave_polygon.obj": (14.0, 3.0, 0.0, 2.0),
    "cube_quant.glb": (6.0, 1.0, 0.0, 1.0),
    "cube_sparse.glb": (14.0, 3.0, 0.0, 1.0),
    "cubes_neg.obj": (12.0, 2.0, 0.0, 4.0),
    "mirrored.glb": (6.0, 1.0, -0.5, 0.5),
    "pair_one_mirrored.glb": (12.0, 2.0, -1.5, 1.5),
}
CUBE = Mesh.box((0.5, 0.5, 0.5), (1, 1, 1))
#: A block of half the size, so that its corners are not those of a unit cube; normals outside.
BLOCK = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=np.float64)
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
#: Outline of a U: no corner sees all others.
U = np.array([[0, 0], [5, 0], [5, 4], [4, 4], [4, 1], [1, 1], [1, 4], [0, 4]], dtype=np.float64)


def assert_same(mesh: Mesh, true: Truth, rel: float = 1e-6) -> None:
    size = float(np.abs([true.low, true.high]).max())
    assert mesh.area_m2 == pytest.approx(true.area, rel=rel)
    assert mesh.volume_m3 == pytest.approx(true.volume, rel=rel, abs=rel * size**3)
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), true.low, atol=rel * size)
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), true.high, atol=rel * size)


def refusal(path: Path) -> str:
    """What is said of a file that is not read: one line that begins with its name."""
    with pytest.raises(UsageError) as raised:
        read_mesh(path)
    assert len(str(raised.value).splitlines()) == 1
    assert str(raised.value).startswith(str(path))
    return str(raised.value).removeprefix(str(path))


@pytest.mark.parametrize("name", KNOWN)
def test_a_mesh_is_what_its_file_says(name: str) -> None:
    mesh = read_mesh(MADE / name)
    area, volume, low, high = KNOWN[name]
    assert mesh.area_m2 == pytest.approx(area, rel=1e-4)
    assert mesh.volume_m3 == pytest.approx(volume, rel=1e-4)
    assert mesh.vertices_m[:, 0].min() == pytest.approx(low)
    assert mesh.vertices_m[:, 0].max() == pytest.approx(high)
    assert mesh.is_closed
    assert_same(mesh, truth(MADE / name))


def rotations() -> st.SearchStrategy[list[float]]:
    part = st.floats(-1, 1)
    whole = st.tuples(part, part, part, part).filter(lambda q: np.linalg.norm(q) > 0.1)
    return whole.map(lambda q: (np.array(q) / np.linalg.norm(q)).tolist())


def nodes() -> st.SearchStrategy[dict[str, Any]]:
    """Places, turns, stretches and mirrorings, as three keys or as a matrix that also shears."""
    place = st.lists(st.floats(-5, 5), min_size=3, max_size=3)
    factor = st.floats(0.2, 3) | st.floats(-3, -0.2)
    keys = st.fixed_dictionaries(
        {}, optional={"translation": place, "rotation": rotations(),
                      "scale": st.lists(factor, min_size=3, max_size=3)},
    )  # fmt: skip
    cells = st.lists(st.floats(-2, 2), min_size=9, max_size=9).map(np.array)
    clear = cells.filter(lambda c: abs(np.cross(c[:3], c[3:6]) @ c[6:]) > 0.05)

    def matrix(linear: FloatArray, at: list[float]) -> dict[str, Any]:
        whole = np.eye(4)
        whole[:3, :3], whole[:3, 3] = linear.reshape(3, 3), at
        return {"matrix": whole.T.ravel().tolist()}

    return keys | st.builds(matrix, clear, place)


@given(st.lists(st.tuples(nodes(), st.integers(0, 8)), min_size=1, max_size=6))
def test_nodes_within_nodes_put_meshes_where_they_say(
    tmp_path_factory: pytest.TempPathFactory, tree: list[tuple[dict[str, Any], int]]
) -> None:
    """One mesh of two primitives is shown by all nodes, each below an earlier one or the scene."""
    file = GltfFile()
    shape = file.mesh(CUBE.vertices_m[:12], CUBE.faces[:6])
    rest = file.mesh(CUBE.vertices_m[12:], CUBE.faces[6:] - 12)
    file.said["meshes"][shape]["primitives"] += file.said["meshes"].pop(rest)["primitives"]
    children: dict[int, list[int]] = {}
    for number, (keys, above) in enumerate(tree):
        file.add("nodes", {**keys, "mesh": shape})
        if above < number:
            children.setdefault(above, []).append(number)
        else:
            file.said["scenes"][0]["nodes"].append(number)
    for number, below in children.items():
        file.said["nodes"][number]["children"] = below
    path = file.write(tmp_path_factory.mktemp("tree") / "tree.glb")
    mesh = read_mesh(path)
    assert len(mesh.faces) == 12 * len(tree)
    assert_same(mesh, truth(path), rel=1e-5)


def strip(file: GltfFile) -> dict[str, Any]:
    places = [[0, 0, 0], [0, 2, 0], [1, 0, 0], [1, 2, 0], [2, 0, 0]]
    return {"attributes": {"POSITION": file.accessor(places, "f4")}, "mode": 5}


def fan(file: GltfFile) -> dict[str, Any]:
    places = [[0, 0, 0], [0, 2, 0], [1, 2, 0], [2, 0, 0]]
    indices = file.accessor([0, 1, 2, 3], "u1")
    positions = file.accessor(places, "f4")
    return {"attributes": {"POSITION": positions}, "indices": indices, "mode": 6}


def listed(file: GltfFile) -> dict[str, Any]:
    places = [[0, 0, 0], [0, 2, 0], [2, 0, 0], [0, 2, 0], [1, 2, 0], [2, 0, 0]]
    return {"attributes": {"POSITION": file.accessor(places, "f4")}}


@pytest.mark.parametrize("form", [strip, fan, listed])
def test_strips_fans_and_lists_without_indices(
    tmp_path: Path, form: Callable[[GltfFile], dict[str, Any]]
) -> None:
    """All of them are one trapezium, seen from below."""
    file = GltfFile()
    lines = {**listed(file), "mode": 1}
    file.show(mesh=file.add("meshes", {"primitives": [form(file), lines]}))
    mesh = read_mesh(file.write(tmp_path / "a.glb"))
    assert mesh.area_m2 == pytest.approx(3)
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, -1.0], (len(mesh.faces), 1)))


@pytest.mark.parametrize(
    ("kind", "normalized", "step"),
    [("u1", True, 1 / 255), ("i1", True, 1 / 127), ("u2", True, 1 / 65535),
     ("i2", True, 1 / 32767), ("u1", False, 1.0), ("i2", False, 1.0)],
)  # fmt: skip
def test_quantised_positions_are_scaled_by_their_node(
    tmp_path: Path, kind: str, normalized: bool, step: float
) -> None:
    largest = np.iinfo(kind).max
    stored = np.round(BLOCK / 3 * largest)
    file = GltfFile()
    positions = file.accessor(stored, kind, normalized=normalized)
    indices = file.accessor(np.array(SIDES)[:, [0, 1, 2, 0, 2, 3]].ravel(), "u1")
    file.said["extensionsRequired"] = file.said["extensionsUsed"] = ["KHR_mesh_quantization"]
    file.show(
        mesh=file.add("meshes", {"primitives": [{"attributes": {"POSITION": positions},
                                                 "indices": indices}]}),
        scale=[3 / step / largest] * 3, translation=[7, 0, 0],
    )  # fmt: skip
    path = file.write(tmp_path / "a.glb")
    mesh = read_mesh(path)
    assert mesh.area_m2 == pytest.approx(22, rel=1 / 64)
    assert mesh.vertices_m.max(axis=0) == pytest.approx([8, 2, 3], rel=1 / 64)
    assert_same(mesh, truth(path))


def test_a_sparse_accessor_without_a_base_is_zero_elsewhere(tmp_path: Path) -> None:
    file = GltfFile()
    indices = file.view(np.array([1, 2], "<u1"))
    values = file.view(np.array([[4, 0, 0], [0, 3, 0]], "<f4"))
    positions = file.add("accessors", {
        "componentType": 5126, "count": 3, "type": "VEC3",
        "sparse": {"count": 2, "indices": {"bufferView": indices, "componentType": 5121},
                   "values": {"bufferView": values}},
    })  # fmt: skip
    file.show(mesh=file.add("meshes", {"primitives": [{"attributes": {"POSITION": positions}}]}))
    path = file.write(tmp_path / "a.glb")
    assert read_mesh(path).area_m2 == pytest.approx(6)
    assert_same(read_mesh(path), truth(path))


@pytest.mark.parametrize("where", ["beside", "within"])
def test_numbers_beside_and_within_the_json(tmp_path: Path, where: str) -> None:
    file = GltfFile()
    file.show(mesh=file.mesh(CUBE.vertices_m, CUBE.faces))
    uri = f"data:application/octet-stream;base64,{base64.b64encode(file.binary).decode()}"
    if where == "beside":
        (tmp_path / "a b.bin").write_bytes(file.binary)
        uri = "a%20b.bin"
    file.said["buffers"] = [{"byteLength": len(file.binary), "uri": uri}]
    assert read_mesh(file.write(tmp_path / "a.gltf")).volume_m3 == pytest.approx(1)
    file.said["buffers"][0]["byteLength"] += 1
    assert f"{len(file.binary)}" in refusal(file.write(tmp_path / "a.gltf"))
    if where == "beside":
        (tmp_path / "a b.bin").unlink()
        assert "a b.bin" in refusal(tmp_path / "a.gltf")


def test_morph_targets_stand_where_their_weights_put_them(tmp_path: Path) -> None:
    file = GltfFile()
    up = np.where(CUBE.vertices_m > 0.5, [0, 0, 1.0], 0)
    shape = file.mesh(CUBE.vertices_m, CUBE.faces, targets=[{"POSITION": file.accessor(up, "f4")}])
    file.said["meshes"][shape]["weights"] = [0.5]
    file.show(mesh=shape)
    file.show(mesh=shape, weights=[3.0], translation=[2, 0, 0])
    pieces = read_mesh(file.write(tmp_path / "a.glb")).pieces()
    assert [piece.volume_m3 for piece in pieces] == pytest.approx([1.5, 4])


def test_texture_coordinates_are_those_of_the_base_colour(tmp_path: Path) -> None:
    """Packed in bytes, in the second set, and laid out by the material's picture."""
    file = GltfFile()
    places = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    material = file.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {
        "index": 0, "texCoord": 1,
        "extensions": {"KHR_texture_transform": {"offset": [0.25, 0], "scale": [0.5, 0.25]}},
    }}})  # fmt: skip
    attributes = {
        "POSITION": file.accessor(places, "f4"),
        "TEXCOORD_0": file.accessor(np.zeros((3, 2)), "f4"),
        "TEXCOORD_1": file.accessor([[0, 0], [255, 0], [0, 255]], "u1", normalized=True),
    }
    primitive = {"attributes": attributes, "material": material}
    file.show(mesh=file.add("meshes", {"primitives": [primitive]}))
    mesh = read_mesh(file.write(tmp_path / "a.glb"))
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv, [[0.25, 1], [0.75, 1], [0.25, 0.75]])


def changed(path: tuple[str | int, ...], value: Any) -> Callable[[GltfFile], None]:
    def change(file: GltfFile) -> None:
        at: Any = file.said
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value

    return change


def all_of(*changes: Callable[[GltfFile], None]) -> Callable[[GltfFile], None]:
    def change(file: GltfFile) -> None:
        for one in changes:
            one(file)

    return change


def animated(**target: Any) -> Callable[[GltfFile], None]:
    return changed(("animations",), [{"channels": [{"sampler": 0, "target": target}]}])


POINTER = {"KHR_animation_pointer": {"pointer": "/nodes/0/rotation"}}
REQUIRED = ("extensionsRequired",)
PRIMITIVE = ("meshes", 0, "primitives", 0)
DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"
REFUSED: dict[str, tuple[Callable[[GltfFile], None], str]] = {
    "draco": (changed(REQUIRED, [DRACO]), DRACO),
    "draco, not required": (
        all_of(changed((*PRIMITIVE, "extensions"), {DRACO: {"bufferView": 0}}),
               changed(("accessors", 0), {"componentType": 5126, "count": 24, "type": "VEC3"})),
        DRACO,
    ),
    "meshopt": (changed(REQUIRED, [MESHOPT]), MESHOPT),
    "meshopt, not required": (
        all_of(changed(("buffers",), [{"byteLength": 700}, {"byteLength": 700}]),
               changed(("bufferViews", 0, "buffer"), 1),
               changed(("bufferViews", 0, "extensions"), {MESHOPT: {"buffer": 0}})),
        MESHOPT,
    ),
    "unknown": (changed(REQUIRED, ["KHR_materials_unlit", "ACME_folded"]), "ACME_folded"),
    "instances": (
        changed(("nodes", 0, "extensions"), {"EXT_mesh_gpu_instancing": {}}),
        "EXT_mesh_gpu_instancing",
    ),
    "skin": (changed(("nodes", 0, "skin"), 0), "skin"),
    "animation": (animated(node=0, path="rotation"), "animated"),
    "pointer": (animated(path="pointer", extensions=POINTER), "animated"),
    "version": (changed(("asset", "version"), "1.0"), "version 2"),
    "limits": (changed(("accessors", 0, "max"), [1, 1, 3]), "up to [1, 1, 3]"),
    "count": (changed(("accessors", 0, "count"), 2400), "28800 bytes"),
    "indices": (
        changed(("accessors", 1), {"bufferView": 1, "componentType": 5123, "count": 35,
                                   "type": "SCALAR"}),
        "35 corners",
    ),
    "vertices": (changed(("accessors", 0), {"bufferView": 0, "componentType": 5126, "count": 20,
                                            "type": "VEC3"}), "0 to 19"),
    "buffer": (changed(("buffers",), [{"byteLength": 1000}]), "1000 bytes"),
    "no mesh": (changed(("nodes", 0, "mesh"), 3), "mesh 3"),
    "two scenes": (all_of(lambda file: file.said.pop("scene"),
                          lambda file: file.said["scenes"].append({"nodes": [0]})), "2"),
    "ring": (changed(("nodes", 0, "children"), [0]), "two"),
    "rotation": (changed(("nodes", 0, "rotation"), [1, 1, 0, 0]), "length 1"),
    "type": (changed(("accessors", 0, "type"), "VEC4"), "VEC3"),
    "lines": (changed((*PRIMITIVE, "mode"), 1), "triangles"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_gltf_that_is_not_read_is_refused_by_name(tmp_path: Path, case: str) -> None:
    change, says = REFUSED[case]
    file = GltfFile()
    file.show(mesh=file.mesh(CUBE.vertices_m, CUBE.faces))
    read_mesh(file.write(tmp_path / "a.glb"))
    change(file)
    assert says in refusal(file.write(tmp_path / "a.glb"))


def test_an_animated_glow_is_no_animated_shape(tmp_path: Path) -> None:
    file = GltfFile()
    pointer = {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    animated(path="pointer", extensions=pointer)(file)
    file.said["extensionsRequired"] = ["KHR_texture_basisu", "KHR_materials_unlit"]
    file.show(mesh=file.mesh(CUBE.vertices_m, CUBE.faces))
    assert read_mesh(file.write(tmp_path / "a.glb")).area_m2 == pytest.approx(6)


def outline(radii: list[float]) -> FloatArray:
    """A polygon around the origin, which most of its corners do not see whole."""
    angle = np.arange(len(radii)) * 2 * np.pi / len(radii)
    return np.stack([radii * np.cos(angle), radii * np.sin(angle)], axis=1)


def prism(around: FloatArray, turn: list[float]) -> tuple[FloatArray, list[list[int]]]:
    """A body whose top and bottom are an outline, turned anyhow."""
    n = len(around)
    flat = np.vstack([np.c_[around, np.zeros(n)], np.c_[around, np.ones(n)]])
    x, y, z, w = turn
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    faces = [list(range(n))[::-1], list(range(n, 2 * n)), *sides]
    return flat @ (np.eye(3) + 2 * (w * cross + cross @ cross)).T, faces


def write_obj(path: Path, places: FloatArray, faces: list[list[int]]) -> Path:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in places]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def write_ply(path: Path, places: FloatArray, faces: list[list[int]], form: str) -> Path:
    head = (f"ply\nformat {form} 1.0\ncomment end_header is below\nelement vertex {len(places)}\n"
            "property float x\nproperty float y\nproperty float z\nproperty float nx\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
            "end_header\n")  # fmt: skip
    if form == "ascii":
        rows = [f"{x:.9g} {y:.9g} {z:.9g} 0" for x, y, z in places]
        rows += [" ".join(map(str, [len(face), *face])) for face in faces]
        path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
        return path
    order = ">" if "big" in form else "<"
    data = b"".join(struct.pack(f"{order}4f", *place, 0) for place in places)
    data += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
    path.write_bytes(head.encode() + data)
    return path


@given(
    st.lists(st.floats(0.2, 2), min_size=5, max_size=14).map(outline) | st.just(U),
    rotations(),
    st.sampled_from(["obj", "ascii", "binary_little_endian", "binary_big_endian"]),
    st.integers(0, 13),
)
def test_faces_with_hollows_are_filled_within_their_outline(
    tmp_path_factory: pytest.TempPathFactory,
    around: FloatArray,
    turn: list[float],
    form: str,
    first: int,
) -> None:
    places, faces = prism(np.roll(around, first, axis=0), turn)
    folder = tmp_path_factory.mktemp("prism")
    if form == "obj":
        path = write_obj(folder / "a.obj", places, faces)
    else:
        path = write_ply(folder / "a.ply", places, faces, form)
    mesh = read_mesh(path)
    assert len(mesh.faces) == sum(len(face) - 2 for face in faces)
    assert mesh.is_closed
    assert_same(mesh, truth(path), rel=1e-5)


def test_corners_on_straight_edges_and_slits_stay(tmp_path: Path) -> None:
    """A U with a corner more on each edge, and a square with a hole that a slit leads to."""
    finer = np.stack([U, (U + np.roll(U, -1, axis=0)) / 2], axis=1).reshape(-1, 2)
    holed = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]
    for outline_m, area in ((finer, 11.0), (np.array(holed, dtype=np.float64), 12.0)):
        face = [list(range(len(outline_m)))]
        path = write_obj(tmp_path / "a.obj", np.c_[outline_m, 0 * outline_m[:, 0]], face)
        mesh = read_mesh(path)
        assert mesh.area_m2 == pytest.approx(area)
        assert (mesh.normals[mesh.areas_m2 > 0] == [0, 0, 1]).all()
        assert len(mesh.faces) == len(outline_m) - 2


def test_faces_that_are_not_flat(tmp_path: Path) -> None:
    """A U whose ends are bent up has its own outline, and looks from above as before."""
    bent = np.c_[U, 0.1 * (U[:, 1] > 2)]
    mesh = read_mesh(write_obj(tmp_path / "a.obj", bent, [list(range(8))]))
    from_above = (mesh.areas_m2 * mesh.normals[:, 2]).sum()
    assert from_above == pytest.approx(11)
    assert 11 < mesh.area_m2 < 11.1
    np.testing.assert_array_equal(mesh.vertices_m, bent)


def test_faces_that_cross_themselves_are_refused(tmp_path: Path) -> None:
    bow = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float64)
    twisted = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, -1, 0], [0, 2, 0]], dtype=np.float64)
    for places in (bow, twisted):
        face = list(range(len(places)))
        path = write_obj(tmp_path / "a.obj", places, [[0, 1, 2], face])
        assert f"line {len(places) + 2}" in refusal(path)
        assert "face 1" in refusal(write_ply(tmp_path / "a.ply", places, [face], "ascii"))


def test_obj_in_all_its_forms(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(
        "\ufeff# made by hand\r\nmtllib none.mtl\r\n"
        "v 0 0 0\r\nv 1 0 0 1.0\r\nv 1 1 0 0.5 0.5 0.5\r\n"
        "vn 0 0 1\r\nvt 0 0\r\nvt 1 0 0\r\nvt 1 1\r\no first thing\r\nusemtl a\r\ns off\r\n"
        "f -3/-3/-1 -2/-2/-1 \\\r\n -1/-1/-1 # a comment\r\nl 1 2\r\n"
        "g second\r\nv 0 1 0\r\nvt 0 1\r\nf 1/1 3/3 -1/-1\r\ng empty\r\n",
        newline="", encoding="utf-8",
    )  # fmt: skip
    mesh = read_mesh(path)
    np.testing.assert_array_equal(
        mesh.vertices_m[mesh.faces],
        [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]],
    )
    np.testing.assert_array_equal(mesh.vertices_m, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv, mesh.vertices_m[:, :2])


@pytest.mark.parametrize(
    ("line", "says"),
    [("f 1 2 4", "4"), ("f 1 2 -4", "line 4"), ("f 1 2 0", "line 4"), ("f 1 2", "line 4"),
     ("f 1 2 x", "line 4"), ("v 1 2", "line 4"), ("v 1,5 2 3", "line 4"), ("v nan 0 0", "line 4"),
     ("f 1/1 2/1 3/1", "texture"), ("surf 0 1 0 1 1 2 3", "surf"), ("ff 1 2 3", "'ff'"),
     ("l 1 2", "triangles"), ("f 1 1 2", "area"), ("f 1 2 3 \\", "\\"),
     (f"f {'1 2 3 ' * 4000}", "at most 10000 corners, got 12000 of line 4")],
)  # fmt: skip
def test_obj_that_is_not_read_is_refused(tmp_path: Path, line: str, says: str) -> None:
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\n")
    assert says in refusal(tmp_path / "a.obj")


def test_ply_of_several_elements_strips_and_corners_with_texture(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    corner = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
    corner += "property double z\nelement material 1\nproperty list int float shades\n"
    data = "end_header\n0 0 0 1 0 0\n1 1 0 0 1 0\n2 0.5 0.5\n"
    path.write_text(
        f"{corner}element tristrips 1\nproperty list int int vertex_indices\n"
        f"{data}8 0 1 3 2 -1 0 1 3\n"
    )
    mesh = read_mesh(path)
    assert mesh.area_m2 == pytest.approx(1.5)
    assert (mesh.normals == [0, 0, 1]).all()
    path.write_text(
        f"{corner}element face 1\nproperty list uchar float texcoord\n"
        f"property list uchar int vertex_index\n{data}8 0 0 1 0 1 1 0 1 4 0 1 2 3\n"
    )
    mesh = read_mesh(path)
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv, mesh.vertices_m[:, :2])


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("n_stated", [5, 7], ids=["fewer", "more"])
@pytest.mark.parametrize("last", [[0, 1, 3], [0, 1, 3, 2]], ids=["mixed", "alike"])
def test_ply_is_held_to_its_counts(
    tmp_path: Path, form: str, n_stated: int, last: list[int]
) -> None:
    path = write_ply(tmp_path / "a.ply", BLOCK, [*SIDES[:5], last], form)
    read_mesh(path)
    sound = path.read_bytes()
    path.write_bytes(sound.replace(b"vertex_indices", b"vertex_index\nproperty list uchar int x"))
    refusal(path)
    path.write_bytes(sound.replace(b"face 6", b"face %d" % n_stated))
    assert "the head states" in refusal(path)


def stl(corners: FloatArray, head: bytes) -> bytes:
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(triangle), 0) for triangle in corners)
    return head.ljust(80, b" ") + struct.pack("<I", len(corners)) + facets


def test_stl_in_both_forms(tmp_path: Path) -> None:
    corners = CUBE.vertices_m[CUBE.faces]
    path = tmp_path / "a.stl"
    path.write_bytes(stl(corners, b"solid but binary"))
    assert_same(read_mesh(path), truth(path))
    path.write_bytes(path.read_bytes()[:-50])
    assert "12 triangles" in refusal(path)
    facets = "".join(
        "  FACET NORMAL 0 0 0\n outer loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle)
        + "endloop\nendfacet\n"
        for triangle in corners
    )
    both = facets.replace("vertex 0.0", "vertex 4.0").replace("vertex 1.0", "vertex 5.0")
    text = f"solid vertex normal facet\n{facets}endsolid vertex\nsolid\n{both}endsolid\n"
    path.write_text(text)
    assert [piece.volume_m3 for piece in read_mesh(path).pieces()] == pytest.approx([1, 1])
    assert_same(read_mesh(path), truth(path))
    path.write_text(text.removesuffix("endsolid\n"))
    assert "endsolid" in refusal(path)
    path.write_text(text.replace("vertex 5.0", "vertx 5.0", 1))
    assert "vertx" in refusal(path)


@pytest.mark.parametrize("ending", ["obj", "ply", "glb", "stl"])
def test_meshes_that_another_program_wrote(tmp_path: Path, ending: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    sphere = Mesh.sphere((1, 2, 3), 0.5, rows=6)
    path = tmp_path / f"a.{ending}"
    trimesh.Trimesh(sphere.vertices_m, sphere.faces, process=False).export(path)
    mesh = read_mesh(path)
    assert len(mesh.faces) == len(sphere.faces)
    assert_same(mesh, Truth.of(list(sphere.vertices_m[sphere.faces])), rel=1e-5)
    assert_same(mesh, truth(path))


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    for name in ("a.obj", "a.ply", "a.glb", "a.gltf", "a.stl"):
        (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
        refusal(tmp_path / name)
        (tmp_path / name).write_text(json.dumps({"asset": {"version": "2.0"}}))
        refusal(tmp_path / name)
    assert ".glb" in refusal(tmp_path / "a.fbx")
    refusal(tmp_path / "none.obj")
