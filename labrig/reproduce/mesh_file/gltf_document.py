"""A glTF 2.0 file's meshes, where they stand, and the numbers of its accessors.

Khronos's specification of glTF 2.0; keys that say nothing of shapes are left out.
"""

import base64
import binascii
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.alias_generators import to_camel

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_MESH_BYTES, read_bytes
from labrig.foundation.models import Finite

Index = Annotated[int, Field(ge=0)]


class GltfPart(BaseModel):
    """A part of the file, whose keys are written in camel case."""

    model_config = ConfigDict(frozen=True, alias_generator=to_camel)


class Extended(GltfPart):
    """A part with extensions that matter."""

    extensions: dict[str, Any] = {}


class Asset(GltfPart):
    """Version of the format."""

    version: str


class Buffer(GltfPart):
    """Bytes in a file, in the JSON, or in the binary part."""

    byte_length: Annotated[int, Field(ge=1)]
    uri: str | None = None


class BufferView(Extended):
    """A part of a buffer, with the distance of its rows if they do not follow at once."""

    buffer: Index
    byte_offset: Index = 0
    byte_length: Annotated[int, Field(ge=1)]
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class SparseIndices(GltfPart):
    """Numbers of the rows that are replaced."""

    buffer_view: Index
    byte_offset: Index = 0
    component_type: Literal[5121, 5123, 5125]


class SparseValues(GltfPart):
    """Numbers that replace those of an accessor."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(GltfPart):
    """Rows of an accessor that are replaced."""

    count: Annotated[int, Field(ge=1)]
    indices: SparseIndices
    values: SparseValues


class Accessor(GltfPart):
    """Numbers in a buffer view, with their least and largest."""

    buffer_view: Index | None = None
    byte_offset: Index = 0
    component_type: int
    normalized: bool = False
    count: Annotated[int, Field(ge=1)]
    type: str
    min: tuple[float, ...] | None = None
    max: tuple[float, ...] | None = None
    sparse: Sparse | None = None


class TextureTransform(GltfPart):
    """Place of a picture on texture coordinates, by KHR_texture_transform."""

    offset: tuple[Finite, Finite] = (0.0, 0.0)
    rotation: Finite = 0.0
    scale: tuple[Finite, Finite] = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureExtensions(GltfPart):
    """Extensions of a picture on a surface."""

    transform: TextureTransform = Field(TextureTransform(), alias="KHR_texture_transform")


class TextureInfo(GltfPart):
    """A picture on a surface, and the texture coordinates by which it lies there."""

    tex_coord: Index = 0
    extensions: TextureExtensions = TextureExtensions()


class Pbr(GltfPart):
    """Colour of a material."""

    base_color_texture: TextureInfo = TextureInfo()


class Material(GltfPart):
    """A material."""

    pbr_metallic_roughness: Pbr = Pbr()


class Primitive(Extended):
    """Triangles, lines or points, by the numbers of their accessors."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    targets: tuple[dict[str, Index], ...] = ()


class GltfMesh(GltfPart):
    """Primitives, and how far each of their targets is gone to."""

    primitives: Annotated[tuple[Primitive, ...], Field(min_length=1)]
    weights: tuple[Finite, ...] | None = None


class Node(Extended):
    """A place in the scene, relative to the node above it."""

    name: str = ""
    mesh: Index | None = None
    skin: Index | None = None
    children: tuple[Index, ...] = ()
    weights: tuple[Finite, ...] | None = None
    matrix: Annotated[tuple[Finite, ...], Field(min_length=16, max_length=16)] | None = None
    translation: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    rotation: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[Finite, Finite, Finite] = (1.0, 1.0, 1.0)

    @model_validator(mode="after")
    def _is_placed_in_one_way(self) -> Self:
        given = self.model_fields_set & {"translation", "rotation", "scale"}
        if self.matrix is not None and given:
            raise ValueError(f"expected either 'matrix' or '{min(given)}', got both")
        if self.matrix is not None and self.matrix[3::4] != (0.0, 0.0, 0.0, 1.0):
            raise ValueError("expected a 'matrix' that moves, turns and scales, got another")
        length = float(np.linalg.norm(self.rotation))
        if abs(length - 1) > NOT_UNIT:
            raise ValueError(f"expected a 'rotation' of length 1, got {length:g}")
        return self

    def to_above(self) -> FloatArray:
        """Return the matrix from the node's own coordinates to those of the node above (4, 4)."""
        if self.matrix is not None:
            return np.array(self.matrix).reshape(4, 4).T
        x, y, z, w = np.array(self.rotation) / np.linalg.norm(self.rotation)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turned = np.eye(3) + 2 * (w * cross + cross @ cross)
        matrix = np.eye(4)
        matrix[:3, :3] = turned * np.array(self.scale)
        matrix[:3, 3] = self.translation
        return matrix


#: Departure from a unit quaternion that is more than rounding.
NOT_UNIT = 0.01


class GltfScene(GltfPart):
    """Nodes that are shown."""

    nodes: tuple[Index, ...] = ()


class AnimationTarget(Extended):
    """Part of a node that an animation moves."""

    node: Index | None = None
    path: str


class AnimationChannel(GltfPart):
    """A course of what is moved."""

    target: AnimationTarget


class Animation(GltfPart):
    """Courses over time."""

    channels: tuple[AnimationChannel, ...] = ()


class GltfDocument(GltfPart):
    """All of the JSON."""

    asset: Asset
    extensions_required: tuple[str, ...] = ()
    scene: Index | None = None
    scenes: tuple[GltfScene, ...] = ()
    nodes: tuple[Node, ...] = ()
    meshes: tuple[GltfMesh, ...] = ()
    materials: tuple[Material, ...] = ()
    accessors: tuple[Accessor, ...] = ()
    buffer_views: tuple[BufferView, ...] = ()
    buffers: tuple[Buffer, ...] = ()
    animations: tuple[Animation, ...] = ()


class GltfNeeds(GltfPart):
    """Head of a document, which a reader has to know before it reads the rest."""

    asset: Asset
    extensions_required: tuple[str, ...] = ()


T = TypeVar("T")

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
#: Rows without data of their own, which a damaged file states for nothing.
MAX_ZEROS = 10**7
#: Longest name of a file.
MAX_LETTERS = 1000
#: Part of the largest number by which others may differ from the least and largest stated: files
#: have these with few digits.
STATED_DIGITS = 1e-4


class GltfNumbers:
    """Accessors of a file, each read once.

    Parameters
    ----------
    document
        What the JSON says.
    binary
        Binary part of the file; None if it has none.
    folder
        Folder to which the names of its files are relative.
    """

    def __init__(self, document: GltfDocument, binary: bytes | None, folder: Path) -> None:
        self._document = document
        self._binary = binary
        self._folder = folder
        self._buffer = cache(self._read_buffer)
        self._stored = cache(self._read_stored)

    def values(self, number: int, kind: str) -> FloatArray:
        """Return the rows of an accessor, of normalised integers as what they stand for.

        Parameters
        ----------
        number
            Number of the accessor.
        kind
            Type that it has to be of, such as `VEC3`.

        Raises
        ------
        UsageError
            There is no such accessor, or its data are not there or not as it states.
        """
        accessor = part_of(self._document.accessors, number, "accessor")
        stored = self._stored(number, kind)
        if not accessor.normalized or stored.dtype.kind == "f":
            return stored.astype(np.float64)
        return np.maximum(stored / np.iinfo(stored.dtype).max, -1.0)

    def integers(self, number: int) -> NDArray[np.int64]:
        """Return the numbers of an accessor of vertices' numbers, shape (n,).

        Raises
        ------
        UsageError
            As by `values`, or they are no whole numbers.
        """
        stored = self._stored(number, "SCALAR")
        if stored.dtype.kind != "u":
            raise UsageError(f"accessor {number}: expected whole numbers ≥ 0 as indices")
        return stored[:, 0].astype(np.int64)

    def _read_stored(self, number: int, kind: str) -> NDArray[Any]:
        """Return the numbers of an accessor as the file has them, and hold them to its limits."""
        accessor = part_of(self._document.accessors, number, "accessor")
        if accessor.type != kind or accessor.component_type not in COMPONENTS:
            raise UsageError(
                f"accessor {number}: expected {kind} of a known component type, got "
                f"{accessor.type[:20]} of {accessor.component_type}"
            )
        component, width = COMPONENTS[accessor.component_type], WIDTHS[kind]
        if accessor.buffer_view is not None:
            shape = (accessor.count, width)
            stored = self._rows(accessor.buffer_view, accessor.byte_offset, component, shape)
        elif accessor.sparse is None:
            raise UsageError(f"accessor {number}: expected a buffer view, got none")
        elif accessor.count > MAX_ZEROS:
            raise UsageError(f"accessor {number}: expected fewer rows, got {accessor.count}")
        else:
            stored = np.zeros((accessor.count, width), component)
        if accessor.sparse is not None:
            stored = stored.copy()
            sparse = accessor.sparse
            indices, values = sparse.indices, sparse.values
            of_index = COMPONENTS[indices.component_type]
            rows = self._rows(
                indices.buffer_view, indices.byte_offset, of_index, (sparse.count, 1)
            )[:, 0]
            if (np.diff(rows.astype(np.int64)) <= 0).any() or rows[-1] >= accessor.count:
                raise UsageError(
                    f"accessor {number}: expected sparse indices that rise, below {accessor.count}"
                )
            stored[rows] = self._rows(
                values.buffer_view, values.byte_offset, component, (sparse.count, width)
            )
        _hold_to_limits(accessor, number, stored)
        return stored

    def _rows(
        self, view_number: int, offset: int, component: str, shape: tuple[int, int]
    ) -> NDArray[Any]:
        """Return numbers in a buffer view, shape (count, width)."""
        view = part_of(self._document.buffer_views, view_number, "bufferView")
        buffer = self._buffer(view.buffer, ", ".join(view.extensions)[:60])
        if view.byte_offset + view.byte_length > len(buffer):
            raise UsageError(
                f"bufferView {view_number}: expected {view.byte_length} bytes from "
                f"{view.byte_offset} on, got a buffer of {len(buffer)}"
            )
        item = np.dtype(component).itemsize
        stride = view.byte_stride or item * shape[1]
        needed = offset + stride * (shape[0] - 1) + item * shape[1]
        if needed > view.byte_length:
            raise UsageError(
                f"bufferView {view_number}: expected {needed} bytes for the {shape[0]} rows in "
                f"it, got {view.byte_length}"
            )
        return np.ndarray(
            shape, component, buffer, view.byte_offset + offset, strides=(stride, item)
        )

    def _read_buffer(self, number: int, extensions: str) -> bytes:
        """Return the bytes of a buffer; a view's extensions may say why there are none."""
        buffer = part_of(self._document.buffers, number, "buffer")
        uri = buffer.uri
        if uri is None and number == 0 and self._binary is not None:
            content = self._binary
        elif uri is None:
            why = f", for its data are packed by {extensions}" if extensions else ""
            raise UsageError(f"buffer {number}: expected data, got none{why}")
        elif uri.startswith("data:"):
            content = _decoded(uri, number)
        elif "://" in uri:
            raise UsageError(f"buffer {number}: expected a file beside it, got '{uri[:60]}'")
        else:
            name = unquote(uri)
            path = self._folder / name
            if len(name) > MAX_LETTERS or "\0" in name or not path.is_file():
                raise UsageError(f"buffer {number}: expected a file {name[:60]!r}, got none")
            content = read_bytes(path, MAX_MESH_BYTES)
        if len(content) < buffer.byte_length:
            raise UsageError(
                f"buffer {number}: expected {buffer.byte_length} bytes, got {len(content)}"
            )
        return content[: buffer.byte_length]


def part_of(parts: Sequence[T], number: int, name: str) -> T:
    """Return a part of a file by its number.

    Raises
    ------
    UsageError
        There is none of this number.
    """
    if number >= len(parts):
        raise UsageError(f"expected a {name} {number}, got {len(parts)} of them")
    return parts[number]


def _hold_to_limits(accessor: Accessor, number: int, stored: NDArray[Any]) -> None:
    """Refuse numbers that do not reach from the least to the largest that the file states.

    Some files state those of normalised integers by what they stand for.
    """
    reached = np.stack([stored.min(axis=0), stored.max(axis=0)]).astype(np.float64)
    for column, stated in enumerate((accessor.min, accessor.max)):
        if stated is None:
            continue
        if len(stated) != stored.shape[1]:
            raise UsageError(f"accessor {number}: expected {stored.shape[1]} limits, got others")
        scales = [1.0]
        if accessor.normalized and stored.dtype.kind != "f":
            scales.append(1 / np.iinfo(stored.dtype).max)
        near = STATED_DIGITS * np.abs(reached).max()
        if not any(
            (np.abs(reached[column] * scale - stated) <= near * scale).all() for scale in scales
        ):
            raise UsageError(
                f"accessor {number}: expected numbers {('from', 'up to')[column]} "
                f"{_listed(stated)}, as it states, got {_listed(reached[column])}; the file is "
                "damaged, or packed in a way that labrig does not know"
            )


def _listed(numbers: Sequence[float] | FloatArray) -> str:
    return f"[{', '.join(f'{number:g}' for number in numbers)}]"


def _decoded(uri: str, number: int) -> bytes:
    """Return the bytes that a `data:` address holds."""
    head, _, data = uri.partition(",")
    if not head.endswith(";base64"):
        return unquote_to_bytes(data)
    try:
        return base64.b64decode(unquote(data), validate=True)
    except (binascii.Error, ValueError):
        raise UsageError(f"buffer {number}: expected data in Base64, got others") from None
