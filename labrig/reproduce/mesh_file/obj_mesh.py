"""Polygons of Wavefront OBJ files."""

from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from labrig.errors import UsageError
from labrig.reproduce.mesh_file.polygons import triangles
from labrig.reproduce.transport.mesh import Mesh

FloatArray = NDArray[np.float64]

#: Statements that change no surface: lines, points, normals, materials, smoothing, looks.
WITHOUT_SURFACE = frozenset({
    "vn", "vp", "l", "p", "s", "mg", "usemtl", "mtllib", "usemap", "maplib", "bevel", "c_interp",
    "d_interp", "lod", "shadow_obj", "trace_obj",
})  # fmt: skip


@dataclass
class _Group:
    """Polygons of an object or group: their corners one after the other, and how many each has."""

    vertices: list[int] = field(default_factory=list)
    uvs: list[int] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)


def obj_parts(content: bytes) -> list[Mesh]:
    """Return the objects and groups of an OBJ file.

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
    groups = [_Group()]
    for number, keyword, words in _statements(content.removeprefix(BOM_UTF8)):
        if keyword == "v":
            # After the place, a weight or a colour.
            vertices.append(_numbers(words, 3, number)[:3])
        elif keyword == "vt":
            uvs.append([*_numbers(words, 1, number), 0.0][:2])
        elif keyword in ("f", "fo"):
            _add_face(groups[-1], words, len(vertices), len(uvs), number)
        elif keyword in ("o", "g"):
            groups.append(_Group())
        elif keyword not in WITHOUT_SURFACE:
            raise UsageError(
                f"expected polygons as OBJ has them, got '{keyword[:40]}' in line {number}, which "
                "labrig does not read"
            )
    places, texture = np.array(vertices).reshape(-1, 3), np.array(uvs).reshape(-1, 2)
    return [_part(group, places, texture) for group in groups if group.lengths]


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


def _add_face(group: _Group, words: list[str], n_vertices: int, n_uvs: int, number: int) -> None:
    for word in words:
        vertex, _, rest = word.partition("/")
        group.vertices.append(_index(vertex, n_vertices, number))
        uv = rest.partition("/")[0]
        group.uvs.append(_index(uv, n_uvs, number) if uv else -1)
    group.lengths.append(len(words))
    if len(words) < 3:
        raise UsageError(
            f"expected faces of three corners or more, got {len(words)} in line {number}"
        )


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


def _part(group: _Group, places: FloatArray, texture: FloatArray) -> Mesh:
    vertices, uvs = np.array(group.vertices), np.array(group.uvs)
    if vertices.max() >= len(places):
        raise UsageError(
            f"expected vertices 1 to {len(places)}, got {vertices.max() + 1} in a face"
        )
    if uvs.max() >= len(texture):
        raise UsageError(
            f"expected texture coordinates 1 to {len(texture)}, got {uvs.max() + 1} in a face"
        )
    if uvs.min() < 0 <= uvs.max():
        raise UsageError(
            "expected texture coordinates on all faces or on none, got them on some; unwrap all "
            "of the mesh"
        )
    faces = triangles(places[vertices], np.array(group.lengths))
    pairs, corner = np.unique(np.stack([vertices, uvs], axis=1), axis=0, return_inverse=True)
    uv = texture[pairs[:, 1]] if uvs.min() >= 0 else None
    return Mesh(places[pairs[:, 0]], corner.reshape(-1)[faces].astype(np.int32), uv)
