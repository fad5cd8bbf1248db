"""What the JSON of a glTF 2.0 file says of meshes, and where they stand.

Khronos's specification of glTF 2.0; keys that say nothing of shapes are left out.
"""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.alias_generators import to_camel

from labrig.foundation.arrays import FloatArray
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
