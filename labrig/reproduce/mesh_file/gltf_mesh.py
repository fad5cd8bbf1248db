"""Triangles of glTF 2.0 files where their nodes put them."""

import json
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import validate
from labrig.reproduce.mesh_file.gltf_document import (
    GltfDocument,
    GltfMesh,
    GltfNeeds,
    GltfNumbers,
    Node,
    Primitive,
    TextureInfo,
    part_of,
)
from labrig.reproduce.mesh_file.polygons import strip_triangles
from labrig.reproduce.transport.mesh import Mesh

IntArray = NDArray[np.int64]

_MAGIC, _VERSION = b"glTF", 2
_HEAD, _CHUNK_HEAD = 12, 8
TRIANGLES, STRIP, FAN = 4, 5, 6
#: Extensions that are read, and those of materials, pictures and lamps, which change no shape.
KNOWN = frozenset({
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp",
    "EXT_texture_avif", "MSFT_texture_dds", "KHR_lights_punctual", "EXT_lights_image_based",
    "EXT_lights_ies", "KHR_xmp_json_ld", "KHR_animation_pointer",
})  # fmt: skip
OF_MATERIALS = "KHR_materials_"
#: Extensions that change what a node shows, whether a reader has to know them or not.
OF_NODES = ("EXT_mesh_gpu_instancing", "KHR_node_visibility")
MOVING = "expected a shape at rest, got {}; bake it into its vertices at one moment"
#: Vertices and corners of triangles in all places of a scene; a gigabyte of memory holds as many.
MAX_CORNERS = 20_000_000


def gltf_mesh(content: bytes, folder: Path) -> Mesh:
    """Return the meshes of all nodes of a glTF file's scene, in the scene's coordinates.

    Mirrored ones are turned over, so that their front is where their twin's is.

    Parameters
    ----------
    content
        Content of the file, in JSON or binary.
    folder
        Folder to which the names of its buffers are relative.

    Returns
    -------
    Mesh
        Triangles of all nodes, with the texture coordinates of their base colours, whose v counts
        from below as everywhere in labrig.

    Raises
    ------
    UsageError
        The file is damaged or of another version, needs an extension that labrig does not know,
        or has a skin or an animation of its shapes.
    """
    text, binary = _chunks(content)
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        said = None
    if not isinstance(said, dict):
        raise UsageError("expected glTF, got neither JSON nor its binary form")
    needs = validate(said, GltfNeeds, "glTF")
    if needs.asset.version.partition(".")[0] != str(_VERSION):
        raise UsageError(f"expected glTF of version 2, got {needs.asset.version[:20]}")
    for name in needs.extensions_required:
        if name not in KNOWN and not name.startswith(OF_MATERIALS):
            raise UsageError(
                f"it needs the extension {name[:60]}, which labrig does not read; save it without"
            )
    document = validate(said, GltfDocument, "glTF")
    numbers = GltfNumbers(document, binary, folder)
    parts = [
        (primitive, shape, node, to_scene)
        for node, to_scene in _shown(document)
        for shape in [part_of(document.meshes, node.mesh or 0, "mesh")]
        for primitive in shape.primitives
        if primitive.mode >= TRIANGLES
    ]
    _hold_to_budget([primitive for primitive, *_ in parts], document)
    return Mesh.joined([
        _placed(_mesh(primitive, shape, node, document, numbers), to_scene)
        for primitive, shape, node, to_scene in parts
    ])  # fmt: skip


def _hold_to_budget(primitives: Sequence[Primitive], document: GltfDocument) -> None:
    """Refuse meshes that stand in so many places that the memory would not hold them."""
    counts = [
        part_of(document.accessors, number, "accessor").count
        for primitive in primitives
        for number in (primitive.attributes.get("POSITION"), primitive.indices)
        if number is not None
    ]
    if sum(counts) > MAX_CORNERS:
        raise UsageError(
            f"expected at most {MAX_CORNERS} vertices and corners in all places of its meshes, "
            f"got {sum(counts)}"
        )


def _chunks(content: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary part of a file."""
    if not content.startswith(_MAGIC):
        return content, None
    if len(content) < _HEAD + _CHUNK_HEAD:
        raise UsageError(f"expected binary glTF, got {len(content)} bytes")
    version, length = struct.unpack_from("<II", content, len(_MAGIC))
    if version != _VERSION:
        raise UsageError(f"expected glTF of version 2, got {version}")
    if length > len(content):
        raise UsageError(f"expected {length} bytes, as its head states, got {len(content)}")
    found: dict[bytes, bytes] = {}
    at = _HEAD
    while at + _CHUNK_HEAD <= length:
        size, kind = struct.unpack_from("<I4s", content, at)
        at += _CHUNK_HEAD
        if at + size > length:
            raise UsageError(f"expected a part of {size} bytes, got {length - at}")
        found.setdefault(kind, content[at : at + size])
        at += size
    if b"JSON" not in found:
        raise UsageError("expected binary glTF with a part of JSON, got none")
    return found[b"JSON"], found.get(b"BIN\0")


def _shown(document: GltfDocument) -> Iterator[tuple[Node, FloatArray]]:
    """Yield the nodes of the scene that have meshes, with the matrices to its coordinates."""
    moved = _moved_nodes(document)
    waiting = [(number, np.eye(4), False) for number in reversed(_roots(document))]
    seen: set[int] = set()
    while waiting:
        number, above, is_moved = waiting.pop()
        node = part_of(document.nodes, number, "node")
        name = f"node {number} {node.name[:40]!r}"
        if number in seen:
            raise UsageError(f"{name}: expected a node at one place of the tree, got two")
        seen.add(number)
        for extension in OF_NODES:
            if extension in node.extensions:
                raise UsageError(
                    f"{name}: it has the extension {extension}, which labrig does not read; save "
                    "it without"
                )
        to_scene, is_moved = above @ node.to_above(), is_moved or number in moved
        if node.mesh is not None:
            if node.skin is not None:
                raise UsageError(f"{name}: {MOVING.format('a skin over bones')}")
            if is_moved:
                raise UsageError(f"{name}: {MOVING.format('an animated one')}")
            yield node, to_scene
        waiting += [(child, to_scene, is_moved) for child in reversed(node.children)]


def _roots(document: GltfDocument) -> list[int]:
    """Return the nodes at the top of the scene that the file shows."""
    if document.scene is None and len(document.scenes) > 1:
        raise UsageError(
            f"expected one scene, or which is shown, got {len(document.scenes)}; save the one "
            "that is wanted"
        )
    if document.scenes:
        return list(part_of(document.scenes, document.scene or 0, "scene").nodes)
    below = {child for node in document.nodes for child in node.children}
    return [number for number in range(len(document.nodes)) if number not in below]


def _moved_nodes(document: GltfDocument) -> set[int]:
    """Return the nodes that an animation moves."""
    moved: set[int] = set()
    for animation in document.animations:
        for channel in animation.channels:
            if channel.target.node is not None:
                moved.add(channel.target.node)
            pointed: Any = channel.target.extensions.get("KHR_animation_pointer")
            words = str(pointed.get("pointer") if isinstance(pointed, dict) else "").split("/")
            if len(words) > 2 and words[2].isdecimal():
                if words[1] == "nodes":
                    moved.add(int(words[2]))
                elif words[1] == "meshes":
                    moved.update(number for number, node in enumerate(document.nodes)
                                 if node.mesh == int(words[2]))  # fmt: skip
    return moved


def _mesh(
    primitive: Primitive, shape: GltfMesh, node: Node, document: GltfDocument, numbers: GltfNumbers
) -> Mesh:
    """Return the triangles of a primitive in its node's coordinates."""
    if "POSITION" not in primitive.attributes:
        raise UsageError("expected positions of the vertices of each primitive, got none")
    number = primitive.attributes["POSITION"]
    try:
        places = numbers.values(number, "VEC3")
        corners = (
            np.arange(len(places))
            if primitive.indices is None
            else numbers.integers(primitive.indices)
        )
    except UsageError as error:
        packed = ", ".join(primitive.extensions)[:60]
        raise UsageError(f"{error} (the mesh uses {packed})" if packed else str(error)) from None
    if corners.max() >= len(places):
        raise UsageError(
            f"expected triangles of the vertices 0 to {len(places) - 1}, got {corners.max()}"
        )
    places = places + _moved_by_targets(primitive, shape, node, numbers, len(places))
    uv = _texture_coordinates(primitive, document, numbers, len(places))
    faces = corners[_triangles(primitive.mode, len(corners))]
    return Mesh(places, faces.astype(np.int32), uv).without_loose_vertices()


def _texture_coordinates(
    primitive: Primitive, document: GltfDocument, numbers: GltfNumbers, n_vertices: int
) -> FloatArray | None:
    """Return the texture coordinates by which the material's base colour lies on it (n, 2)."""
    picture = TextureInfo()
    if primitive.material is not None:
        material = part_of(document.materials, primitive.material, "material")
        picture = material.pbr_metallic_roughness.base_color_texture
    transform = picture.extensions.transform
    own = picture.tex_coord if transform.tex_coord is None else transform.tex_coord
    number = primitive.attributes.get(f"TEXCOORD_{own}")
    if number is None:
        return None
    if transform.rotation:
        raise UsageError(
            "expected texture coordinates as they are used, got ones that KHR_texture_transform "
            "turns; bake them"
        )
    uv = numbers.values(number, "VEC2") * transform.scale + transform.offset
    if len(uv) != n_vertices:
        raise UsageError(f"expected {n_vertices} texture coordinates, got {len(uv)}")
    # Those of glTF count from the upper left corner.
    return np.asarray(uv * [1, -1] + [0, 1])


def _triangles(mode: int, n_corners: int) -> IntArray:
    """Return which corners each triangle has, shape (m, 3)."""
    if n_corners < 3 or (mode == TRIANGLES and n_corners % 3):
        raise UsageError(f"expected three corners for each triangle, got {n_corners} corners")
    if mode == TRIANGLES:
        return np.arange(n_corners).reshape(-1, 3)
    if mode == STRIP:
        return strip_triangles(n_corners)
    first = np.arange(1, n_corners - 1)
    return np.stack([first, first + 1, np.zeros_like(first)], axis=1)


def _moved_by_targets(
    primitive: Primitive, shape: GltfMesh, node: Node, numbers: GltfNumbers, n_vertices: int
) -> FloatArray:
    """Return how far the weights of its targets move the vertices, shape (n, 3)."""
    weights = node.weights if node.weights is not None else shape.weights
    moved = np.zeros((n_vertices, 3))
    if weights is None:
        return moved
    if len(weights) != len(primitive.targets):
        raise UsageError(
            f"expected a weight for each of {len(primitive.targets)} targets, got {len(weights)}"
        )
    for weight, target in zip(weights, primitive.targets, strict=True):
        if weight and "POSITION" in target:
            offsets = numbers.values(target["POSITION"], "VEC3")
            if len(offsets) != n_vertices:
                raise UsageError(
                    f"expected a target of {n_vertices} vertices, got one of {len(offsets)}"
                )
            moved += weight * offsets
    return moved


def _placed(mesh: Mesh, to_scene: FloatArray) -> Mesh:
    """Return a mesh in other coordinates, with its front where it was."""
    places = mesh.vertices_m @ to_scene[:3, :3].T + to_scene[:3, 3]
    placed = Mesh(places, mesh.faces, mesh.uv)
    x, y, z = to_scene[:3, :3].T
    is_mirrored = np.cross(x, y) @ z < 0
    return placed.turned_over() if is_mirrored else placed
