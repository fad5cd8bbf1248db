"""Polygons of PLY files, in text or binary of either byte order."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.reproduce.mesh_file.polygons import strip_triangles, triangles
from labrig.reproduce.transport.mesh import PARTLY_UNWRAPPED, Mesh

IntArray = NDArray[np.int64]

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
#: Forms of the data, with the byte order of their numbers; text is turned into numbers first.
FORMS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")
UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
#: Texture coordinates of the corners of each face, one pair after the other.
UVS_OF_FACE = "texcoord"
END_OF_STRIP = -1


@dataclass
class _Element:
    """Element as the head describes it: its name, how many there are, and their properties."""

    name: str
    count: int
    #: Types of the property, or of the length of its list and of the values in it.
    properties: dict[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Column:
    """Values of a property: those of all elements, one after the other, and how many each has."""

    values: FloatArray
    lengths: IntArray


def ply_mesh(content: bytes) -> Mesh:
    """Return the mesh of a PLY file.

    Parameters
    ----------
    content
        Content of the file.

    Raises
    ------
    UsageError
        Its head is none of PLY, its data are not as long as that says, or a face has vertices that
        are not there, or crosses itself.
    """
    form, elements, start = _head(content)
    data = content[start:]
    if form == "ascii":
        data = _as_binary(data, elements)
    columns = _columns(data, elements, FORMS[form])
    vertex = columns.get("vertex", {})
    if any(axis not in vertex or (vertex[axis].lengths != 1).any() for axis in "xyz"):
        raise UsageError("expected vertices with x, y and z, got none")
    places = np.stack([vertex[axis].values for axis in "xyz"], axis=1)
    of_vertices = _uvs_of_vertices(vertex)
    parts = []
    faces = columns.get("face", {})
    if (listed := _indices(faces)) is not None:
        corners = _vertices(listed.values, len(places))
        cut = triangles(places[corners], listed.lengths)
        if (of_corners := _uvs_of_corners(faces, listed.lengths)) is None:
            parts.append(Mesh(places, corners[cut].astype(np.int32), of_vertices))
        else:
            parts.append(Mesh(places[corners], cut.astype(np.int32), of_corners))
    if (listed := _indices(columns.get("tristrips", {}))) is not None:
        parts.append(Mesh(places, _of_strips(listed, len(places)), of_vertices))
    return Mesh.joined(parts)


def _head(content: bytes) -> tuple[str, list[_Element], int]:
    """Return the form of the data, what there is, and where the data begin."""
    end = re.search(rb"^end_header[ \t]*\r?\n", content, re.MULTILINE)
    if not content.startswith(b"ply") or end is None:
        raise UsageError("expected a head of PLY from 'ply' to 'end_header', got another file")
    form, elements = "", list[_Element]()
    for line in content[: end.start()].splitlines()[1:]:
        match line.decode("utf-8", errors="replace").split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, "1.0"] if name in FORMS and not form:
                form = name
            case ["element", name, count] if re.fullmatch("[0-9]{1,12}", count) and name not in [
                each.name for each in elements
            ]:
                elements.append(_Element(name, int(count)))
            case ["property", *types, name] if (
                elements
                and name not in elements[-1].properties
                and set(types) - {"list"} <= set(TYPES)
                and len(types) == (3 if types[:1] == ["list"] else 1)
            ):
                elements[-1].properties[name] = tuple(TYPES[each] for each in types[-2:]
                                                      if each != "list")  # fmt: skip
            case words:
                said = " ".join(words)[:60]
                raise UsageError(f"expected a head of PLY, got '{said}' in it")
    if not form:
        raise UsageError(f"expected a 'format' of {', '.join(FORMS)} in the head, got none")
    return form, elements, end.end()


def _as_binary(text: bytes, elements: list[_Element]) -> bytes:
    """Return the numbers of a text as binary ones, of which all properties are then."""
    try:
        numbers = np.array(text.split(), dtype=np.float64)
    except ValueError:
        raise UsageError("expected numbers after the head, got others") from None
    for element in elements:
        for name, types in element.properties.items():
            element.properties[name] = ("f8",) * len(types)
    return numbers.astype("<f8").tobytes()


def _columns(data: bytes, elements: list[_Element], order: str) -> dict[str, dict[str, _Column]]:
    """Return the properties of the elements by their names."""
    found, at = {}, 0
    for element in elements:
        columns, at = _read(data, at, element, order)
        found[element.name] = columns
    if data[at:].strip(b" \r\n"):
        raise UsageError(
            f"expected the data to end after the {sum(each.count for each in elements)} elements "
            f"that the head states, got {len(data) - at} more bytes"
        )
    return found


def _read(data: bytes, at: int, element: _Element, order: str) -> tuple[dict[str, _Column], int]:
    """Return the properties of one element, and where the next one begins."""
    if not element.properties or not element.count:
        return {name: _Column(np.empty(0), np.empty(0, np.int64))
                for name in element.properties}, at  # fmt: skip
    left = np.frombuffer(data, np.uint8)[at:]
    # Most files have lists of one length, which are read at once.
    lengths = _lengths_of_first(left, element, order)
    kind = _kind(element, lengths, order)
    rows = np.empty(0, kind)
    if element.count * kind.itemsize <= len(left):
        rows = np.frombuffer(data, kind, element.count, at)
    if len(rows) == element.count and all(
        (rows[f"{name} length"] == n).all() for name, n in lengths.items()
    ):
        columns = {
            name: _Column(rows[name].astype(np.float64).ravel(),
                          np.full(element.count, lengths.get(name, 1)))
            for name in element.properties
        }  # fmt: skip
        return columns, at + element.count * kind.itemsize
    return _read_one_by_one(data, at, element, order)


def _lengths_of_first(left: NDArray[np.uint8], element: _Element, order: str) -> dict[str, int]:
    """Return the lengths of the lists of the first of some elements."""
    lengths: dict[str, int] = {}
    for name, types in element.properties.items():
        if len(types) == 2:
            before = _kind(element, lengths, order, until=name).itemsize
            size = np.dtype(types[0]).itemsize
            count = left[before : before + size].tobytes()
            is_there = len(count) == size
            stated = _length(np.frombuffer(count, order + types[0])[0]) if is_there else 0
            # One that does not fit into the file is refused when its turn comes.
            lengths[name] = stated if stated <= len(left) else 0
    return lengths


def _kind(
    element: _Element, lengths: Mapping[str, int], order: str, until: str = ""
) -> np.dtype[np.void]:
    """Return the type of elements whose lists have given lengths, up to one of the properties."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for name, types in element.properties.items():
        if name == until:
            break
        if len(types) == 1:
            fields.append((name, order + types[0]))
        else:
            fields += [(f"{name} length", order + types[0]),
                       (name, order + types[1], (lengths[name],))]  # fmt: skip
    return np.dtype(fields)


def _read_one_by_one(
    data: bytes, at: int, element: _Element, order: str
) -> tuple[dict[str, _Column], int]:
    values: dict[str, list[FloatArray]] = {name: [] for name in element.properties}
    lengths: dict[str, list[int]] = {name: [] for name in element.properties}
    kinds = {name: [np.dtype(order + each) for each in types]
             for name, types in element.properties.items()}  # fmt: skip
    try:
        for _ in range(element.count):
            for name, (*of_length, kind) in kinds.items():
                n = 1
                for of_count in of_length:
                    n = _length(np.frombuffer(data, of_count, 1, at)[0])
                    at += of_count.itemsize
                values[name].append(np.frombuffer(data, kind, n, at) if n else np.empty(0))
                at += n * kind.itemsize
                lengths[name].append(n)
    except ValueError:
        raise UsageError(
            f"expected {element.count} elements '{element.name[:40]}', as the head states, got a "
            "file that ends before them"
        ) from None
    columns = {
        name: _Column(np.concatenate([np.empty(0), *values[name]]).astype(np.float64),
                      np.array(lengths[name], dtype=np.int64))
        for name in values
    }  # fmt: skip
    return columns, at


def _length(value: float) -> int:
    if not (value >= 0 and value % 1 == 0):
        raise UsageError(f"expected lists with lengths of whole numbers, got {value}")
    return int(value)


def _indices(properties: Mapping[str, _Column]) -> _Column | None:
    return next((properties[name] for name in INDICES if name in properties), None)


def _vertices(values: FloatArray, n_vertices: int) -> IntArray:
    if not ((values >= 0) & (values < n_vertices) & (values % 1 == 0)).all():
        raise UsageError(
            f"expected faces of the vertices 0 to {n_vertices - 1}, got {values.min():g} to "
            f"{values.max():g}"
        )
    return values.astype(np.int64)


def _uvs_of_vertices(vertex: Mapping[str, _Column]) -> FloatArray | None:
    for u, v in UVS:
        if u in vertex and v in vertex and (vertex[u].lengths == vertex[v].lengths).all():
            return np.stack([vertex[u].values, vertex[v].values], axis=1)
    return None


def _uvs_of_corners(faces: Mapping[str, _Column], lengths: IntArray) -> FloatArray | None:
    """Return the texture coordinates of the corners of faces that have their own (corners, 2)."""
    own = faces.get(UVS_OF_FACE)
    if own is None or not len(own.values):
        return None
    if (own.lengths != 2 * lengths).any():
        raise UsageError(PARTLY_UNWRAPPED)
    return own.values.reshape(-1, 2)


def _of_strips(listed: _Column, n_vertices: int) -> NDArray[np.int32]:
    """Return the triangles of strips, which -1 ends within a list."""
    faces = [np.empty((0, 3), np.int64)]
    for own in np.split(listed.values, np.cumsum(listed.lengths)[:-1]):
        for part in np.split(own, np.flatnonzero(own == END_OF_STRIP)):
            strip = part[part != END_OF_STRIP]
            if len(strip):
                corners = _vertices(strip, n_vertices)
                faces.append(corners[strip_triangles(len(corners))])
    return np.concatenate(faces).astype(np.int32)
