"""Reading of a mesh, whatever the format of its file; STL and Wavefront OBJ."""

from codecs import BOM_UTF8
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_MESH_BYTES, read_bytes
from labrig.reproduce.mesh_file.gltf_mesh import gltf_mesh
from labrig.reproduce.mesh_file.ply_mesh import ply_mesh
from labrig.reproduce.mesh_file.polygons import triangles
from labrig.reproduce.transport.mesh import PARTLY_UNWRAPPED, Mesh

#: Statements that change no surface: lines, points, names, normals, materials, smoothing, looks.
WITHOUT_SURFACE = frozenset({
    "vn", "vp", "l", "p", "o", "g", "s", "mg", "usemtl", "mtllib", "usemap", "maplib", "bevel",
    "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj",
})  # fmt: skip


@dataclass
class _Polygons:
    """Corners of polygons one after the other, how many each has, and in which line it stands."""

    vertices: list[int] = field(default_factory=list)
    uvs: list[int] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)


def obj_mesh(content: bytes) -> Mesh:
    """Return the objects and groups of an OBJ file as one mesh.

    Parameters
    ----------
    content
        Content of the file.

    Raises
    ------
    UsageError
        A line is none of the format, a face has vertices that are not there, crosses itself, or
        has texture coordinates at some corners only; or it has curved surfaces.
    """
    vertices: list[list[float]] = []
    uvs: list[list[float]] = []
    polygons = _Polygons()
    for number, keyword, words in _statements(content.removeprefix(BOM_UTF8)):
        if keyword == "v":
            # After the place, a weight or a colour.
            vertices.append(_numbers(words, 3, number)[:3])
        elif keyword == "vt":
            uvs.append([*_numbers(words, 1, number), 0.0][:2])
        elif keyword in ("f", "fo"):
            _add_face(polygons, words, len(vertices), len(uvs), number)
        elif keyword not in WITHOUT_SURFACE:
            raise UsageError(
                f"expected polygons as OBJ has them, got '{keyword[:40]}' in line {number}, which "
                "labrig does not read"
            )
    places, texture = np.array(vertices).reshape(-1, 3), np.array(uvs).reshape(-1, 2)
    return _cut(polygons, places, texture)


def _statements(content: bytes) -> Iterator[tuple[int, str, list[str]]]:
    """Yield the lines that say something: their numbers, first words, and other words."""
    words: list[str] = []
    for number, line in enumerate(content.splitlines(), start=1):
        said = line.decode("utf-8", errors="replace").partition("#")[0].rstrip()
        words += said.removesuffix("\\").split()
        if said.endswith("\\") or not words:
            continue
        yield number, words[0], words[1:]
        words = []
    if words:
        raise UsageError("expected a line after the last one, which ends in '\\', got none")


def _numbers(words: list[str], least: int, number: int) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) < least or not all(map(isfinite, values)):
        raise UsageError(
            f"expected {least} finite numbers or more, got '{' '.join(words)[:40]}' in line "
            f"{number}"
        )
    return values


def _add_face(
    polygons: _Polygons, words: list[str], n_vertices: int, n_uvs: int, number: int
) -> None:
    for word in words:
        vertex, _, rest = word.partition("/")
        polygons.vertices.append(_index(vertex, n_vertices, number))
        uv = rest.partition("/")[0]
        polygons.uvs.append(_index(uv, n_uvs, number) if uv else -1)
    polygons.lengths.append(len(words))
    polygons.lines.append(number)


def _index(word: str, n_before: int, number: int) -> int:
    """Return a number counted from 0; negative ones count back from what stands before."""
    try:
        index = int(word)
    except ValueError:
        index = 0
    if index == 0 or index < -n_before:
        raise UsageError(
            f"expected the number of a vertex, got '{word[:40]}' in line {number}, before which "
            f"there are {n_before}"
        )
    return index - 1 if index > 0 else n_before + index


def _cut(polygons: _Polygons, places: FloatArray, texture: FloatArray) -> Mesh:
    """Return the triangles of the polygons, with a vertex for each pair of place and texture."""
    vertices = np.array(polygons.vertices, dtype=np.int64)
    uvs = np.array(polygons.uvs, dtype=np.int64)
    if vertices.max(initial=-1) >= len(places):
        raise UsageError(
            f"expected vertices 1 to {len(places)}, got {vertices.max() + 1} in a face"
        )
    if uvs.max(initial=-1) >= len(texture):
        raise UsageError(
            f"expected texture coordinates 1 to {len(texture)}, got {uvs.max() + 1} in a face"
        )
    has_uv = uvs >= 0
    if has_uv.any() and not has_uv.all():
        raise UsageError(PARTLY_UNWRAPPED)
    faces = triangles(
        places[vertices],
        np.array(polygons.lengths, dtype=np.int64),
        lambda face: f"line {polygons.lines[face]}",
    )
    pairs, corner = np.unique(np.stack([vertices, uvs], axis=1), axis=0, return_inverse=True)
    uv = texture[pairs[:, 1]] if has_uv.any() else None
    return Mesh(places[pairs[:, 0]], corner.reshape(-1)[faces].astype(np.int32), uv)


HEAD_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_mesh(content: bytes) -> Mesh:
    """Return the solids of an STL file as one mesh.

    Normals are left out: the order of the corners says where the front is.

    Parameters
    ----------
    content
        Content of the file.

    Raises
    ------
    UsageError
        The file is not as long as its count of triangles says, or a line of its text is no STL.
    """
    # Binary files may begin with `solid`, too: their length tells them.
    stated = int.from_bytes(content[80:HEAD_BYTES], "little")
    if len(content) >= HEAD_BYTES and len(content) == HEAD_BYTES + stated * FACET.itemsize:
        corners = np.frombuffer(content, FACET, offset=HEAD_BYTES)["corners"]
        faces = np.arange(3 * stated, dtype=np.int32).reshape(-1, 3)
        return Mesh(corners.reshape(-1, 3).astype(np.float64), faces)
    if not content[:HEAD_BYTES].lstrip().lower().startswith(b"solid") or b"\0" in content:
        raise UsageError(
            f"expected a binary STL of {HEAD_BYTES} + {FACET.itemsize} bytes for each of the "
            f"{stated} triangles that it states, or one in text that begins with 'solid', got "
            f"{len(content)} bytes"
        )
    return _of_text(content)


def _of_text(content: bytes) -> Mesh:
    places: list[list[float]] = []
    lengths: list[int] = []
    # What has been opened and not yet been ended.
    open_parts: list[str] = []
    for number, line in enumerate(content.splitlines(), start=1):
        words = line.decode("utf-8", errors="replace").split()
        if not words:
            continue
        word = words[0].lower()
        inside = open_parts[-1] if open_parts else ""
        if word == "vertex" and inside == "loop":
            places.append(_place(words[1:], number))
            lengths[-1] += 1
        elif (inside, word) in BEGIN:
            open_parts.append(BEGIN[inside, word])
            if word == "outer":
                lengths.append(0)
        elif word == f"end{inside}" and inside:
            open_parts.pop()
        else:
            said = " ".join(words)[:40]
            raise UsageError(f"expected STL, got '{said}' in line {number}")
    if open_parts:
        raise UsageError(f"expected 'end{open_parts[-1]}' at the end, got a file that was cut off")
    corners = np.array(places, dtype=np.float64).reshape(-1, 3)
    return Mesh(corners, triangles(corners, np.array(lengths, dtype=np.int64)).astype(np.int32))


#: What begins with a word within something else.
BEGIN = {("", "solid"): "solid", ("solid", "facet"): "facet", ("facet", "outer"): "loop"}


def _place(words: list[str], number: int) -> list[float]:
    try:
        x, y, z = (float(word) for word in words)
    except ValueError:
        raise UsageError(
            f"expected three numbers after 'vertex', got '{' '.join(words)[:40]}' in line {number}"
        ) from None
    return [x, y, z]


#: Readers of the content of a file in a folder, by the ending of its name.
READERS: dict[str, Callable[[bytes, Path], Mesh]] = {
    ".obj": lambda content, _: obj_mesh(content),
    ".ply": lambda content, _: ply_mesh(content),
    ".glb": gltf_mesh,
    ".gltf": gltf_mesh,
    ".stl": lambda content, _: stl_mesh(content),
}


def read_mesh(path: Path) -> Mesh:
    r"""Read a mesh from a file.

    The front of a triangle is where its corners run counter-clockwise, also in parts of glTF that
    are mirrored. Vertices stand in the order of the file, without those that no triangle has; one
    with several texture coordinates stands several times. Lines, points, normals and materials are
    left out.

    Parameters
    ----------
    path
        OBJ, PLY, glTF or STL file.

    Returns
    -------
    Mesh
        Triangles of all objects, groups, solids or nodes, in the file's own unit, with texture
        coordinates where it has some.

    Raises
    ------
    UsageError
        There is no such file, its format is another, it is damaged or says something that labrig
        does not read, its numbers are not those that it states, it has no surface, or texture
        coordinates on a part of it only.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reproduce import read_mesh
    >>> _ = Path("triangle.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    >>> read_mesh(Path("triangle.obj")).area_m2
    0.5
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise UsageError(f"{path}: expected a mesh as {', '.join(READERS)}, got '{path.suffix}'")
    if not path.is_file():
        raise UsageError(f"{path}: expected a file with a mesh, got no such file")
    content = read_bytes(path, MAX_MESH_BYTES)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            mesh = reader(content, path.parent).without_loose_vertices()
            area = mesh.area_m2
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    if not len(mesh.faces):
        raise UsageError(f"{path}: expected a mesh of triangles, got none")
    if not 0 < area < np.inf or not np.isfinite(mesh.vertices_m).all():
        raise UsageError(f"{path}: expected finite triangles with an area, got others")
    return mesh
