"""Polygons of Wavefront OBJ files."""

from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
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
