"""Scenes whose glow decays in a browser: glTF 2.0 with animated emission.

Khronos's specification of glTF 2.0 and its extensions KHR_materials_emissive_strength and
KHR_animation_pointer.
"""

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.output_file import write_durably
from labrig.optics import srgb_bytes
from labrig.reproduce.export.scene_export import (
    ExportedMesh,
    Glow,
    frame_count,
)
from labrig.reproduce.transport.tracing import Pinhole

STRENGTH, POINTER = "KHR_materials_emissive_strength", "KHR_animation_pointer"
#: Name of what viewers do not know: what a fluorescent surface does to light.
EXTRA = "reradiationPreview"
#: Numbers of the specification: types of components and targets of buffer views.
_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_LINEAR_MIPMAP, _LINEAR, _CLAMP = 9987, 9729, 33071
_MAGIC, _VERSION = b"glTF", 2
#: glTF's y is upwards: turn by −90° about x where z was, as quaternion.
_Z_UP = [-float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]


def write_gltf(
    path: Path,
    meshes: Sequence[ExportedMesh],
    times_s: ArrayLike,
    exposure: float = 1.0,
    camera: Pinhole | None = None,
    up: Literal["y", "z"] = "y",
) -> None:
    """Write meshes whose emission changes over time as binary glTF, a preview for browsers.

    A material has one emissive texture, whose colour factor is animated and interpolated linearly
    between the frames. Texels that decay at rates of their own are not expressible: they are given
    one course in each channel by `Glow.of_textures`, and what is lost is told in the file. So are
    spectra, re-radiation and light from one surface onto another: viewers show a base colour and a
    glow. What a fluorescent surface does to light stands in `extras` of its material, a matrix of
    linear sRGB with its ΔE2000, for renderers that can use one.

    Parameters
    ----------
    path
        Path of the file, which ends in `.glb`.
    meshes
        At least one mesh; all glows have one number of frames.
    times_s
        Rising times of the frames in seconds ≥ 0, at which the animation shows them; times of hours
        may be given shortened.
    exposure
        Factor of all emissions; a viewer shows 1 as white.
    camera
        Camera of the scene; None leaves it to the viewer.
    up
        Axis of the meshes that is upwards.

    Raises
    ------
    UsageError
        The name, the numbers of frames or the times do not fit, or the exposure is not above 0.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import ExportedMesh, Glow, write_gltf
    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> times_s = np.linspace(0, 10, 21)
    >>> decay = Glow(np.outer(np.exp(-times_s / 3), [0.1, 1.0, 0.4]))
    >>> sheet = ExportedMesh("sheet", corners, np.array([[0, 1, 2]]), np.full(3, 0.5), glow=decay)
    >>> write_gltf(Path("sheet.glb"), [sheet], times_s)
    >>> Path("sheet.glb").read_bytes()[:4]
    b'glTF'
    """
    if path.suffix.lower() != ".glb":
        raise UsageError(f"{path}: expected a file name that ends in .glb")
    if not 0 < exposure < np.inf:
        raise UsageError(f"expected an exposure above 0 and finite, got {exposure:g}")
    times = np.asarray(times_s, dtype=np.float64)
    frames = frame_count(list(meshes))
    is_any_glow = any(mesh.glow is not None for mesh in meshes)
    if times.ndim != 1 or (is_any_glow and len(times) != frames):
        raise UsageError(f"expected {frames} times, one of each frame, got {times.size}")
    # Times are 32-bit numbers in the file.
    if not (np.diff(times.astype(np.float32)) > 0).all() or not (times >= 0).all():
        raise UsageError("expected rising times ≥ 0 s, got others")
    document = _Document()
    for mesh in meshes:
        document.add_mesh(mesh, exposure)
    if is_any_glow and frames > 1:
        document.add_animation(times, [mesh.glow for mesh in meshes])
    content = document.binary(camera, up)
    write_durably(path, content)


class _Document:
    """The parts of a glTF file as they are added."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._parts: dict[str, list[dict[str, Any]]] = {
            name: [] for name in ("nodes", "meshes", "materials", "textures", "images")
        }
        self._animation: dict[str, Any] | None = None

    def add_mesh(self, mesh: ExportedMesh, exposure: float) -> None:
        attributes = {"POSITION": self._accessor(mesh.vertices_m, "VEC3", _VERTICES, limits=True)}
        if mesh.uv is not None:
            # glTF counts from the upper left corner.
            from_above = np.stack([mesh.uv[:, 0], 1.0 - mesh.uv[:, 1]], axis=1)
            attributes["TEXCOORD_0"] = self._accessor(from_above, "VEC2", _VERTICES)
        indices = self._accessor(mesh.faces.ravel(), "SCALAR", _INDICES, kind="<u4")
        material = self._add("materials", self._material(mesh, exposure))
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        number = self._add("meshes", {"name": mesh.name, "primitives": [primitive]})
        self._add("nodes", {"name": mesh.name, "mesh": number})

    def add_animation(self, times_s: FloatArray, glows: list[Glow | None]) -> None:
        """Animate the emissive factor of each material that glows."""
        channels, samplers = [], []
        times = self._accessor(times_s, "SCALAR", limits=True)
        for material, glow in enumerate(glows):
            # All dark, the strength is 0, and there is nothing to animate.
            if glow is None or glow.colour.max() == 0:
                continue
            output = self._accessor(glow.colour / glow.colour.max(), "VEC3")
            samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})
            pointer = {"pointer": f"/materials/{material}/emissiveFactor"}
            target = {"path": "pointer", "extensions": {POINTER: pointer}}
            channels.append({"sampler": len(samplers) - 1, "target": target})
        if channels:
            self._animation = {"name": "glow", "channels": channels, "samplers": samplers}

    def binary(self, camera: Pinhole | None, up: str) -> bytes:
        """Return the file: a head, the description as JSON, and the numbers."""
        nodes = self._parts["nodes"]
        root: dict[str, Any] = {"name": "scene", "children": list(range(len(nodes)))}
        if camera is not None:
            root["children"].append(self._add("nodes", _camera_node(camera)))
        if up == "z":
            root["rotation"] = _Z_UP
        scene = self._add("nodes", root)
        used = [STRENGTH] if any("extensions" in one for one in self._parts["materials"]) else []
        used += [POINTER] if self._animation else []
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "labrig"},
            "scene": 0,
            "scenes": [{"nodes": [scene]}],
            **{name: parts for name, parts in self._parts.items() if parts},
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._buffer)}],
        }
        if used:
            document["extensionsUsed"] = used
        if self._parts["textures"]:
            document["samplers"] = [
                {
                    "magFilter": _LINEAR,
                    "minFilter": _LINEAR_MIPMAP,
                    "wrapS": _CLAMP,
                    "wrapT": _CLAMP,
                }
            ]
        if camera is not None:
            document["cameras"] = [_camera(camera)]
        if self._animation:
            document["animations"] = [self._animation]
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
        chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", bytes(self._buffer), b"\0")
        return _MAGIC + struct.pack("<II", _VERSION, 12 + len(chunks)) + chunks

    def _material(self, mesh: ExportedMesh, exposure: float) -> dict[str, Any]:
        material: dict[str, Any] = {
            "name": mesh.name,
            "doubleSided": True,
            "pbrMetallicRoughness": {
                "baseColorFactor": [*mesh.base_colour.tolist(), 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }
        if mesh.preview is not None:
            material["extras"] = {EXTRA: mesh.preview.to_dict()}
        if mesh.glow is None:
            return material
        largest = float(mesh.glow.colour.max())
        scale = 1.0 if mesh.glow.texture is None else float(mesh.glow.texture.max())
        first = mesh.glow.colour[0] / largest if largest > 0 else np.zeros(3)
        material["emissiveFactor"] = first.tolist()
        material["extensions"] = {STRENGTH: {"emissiveStrength": exposure * largest * scale}}
        if mesh.glow.texture is not None:
            relative = mesh.glow.texture / (scale or 1.0)
            material["emissiveTexture"] = {"index": self._texture(relative)}
            material.setdefault("extras", {})["lostByOneCourseRms"] = mesh.glow.lost
        return material

    def _texture(self, linear: FloatArray) -> int:
        # slow to load
        import cv2

        good, png = cv2.imencode(".png", srgb_bytes(linear)[..., ::-1])
        if not good:
            raise RuntimeError("OpenCV could not encode a PNG")
        image = {"bufferView": self._view(png.tobytes()), "mimeType": "image/png"}
        return self._add("textures", {"source": self._add("images", image), "sampler": 0})

    def _add(self, name: str, part: dict[str, Any]) -> int:
        self._parts[name].append(part)
        return len(self._parts[name]) - 1

    def _view(self, content: bytes, target: int | None = None) -> int:
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": len(self._buffer),
            "byteLength": len(content),
        }
        if target is not None:
            view["target"] = target
        self._buffer += _padded(content, b"\0")
        self._views.append(view)
        return len(self._views) - 1

    def _accessor(
        self,
        values: NDArray[Any],
        shape: str,
        target: int | None = None,
        kind: str = "<f4",
        limits: bool = False,
    ) -> int:
        rows = np.ascontiguousarray(values, dtype=kind)
        accessor: dict[str, Any] = {
            "bufferView": self._view(rows.tobytes(), target),
            "componentType": _FLOAT if kind == "<f4" else _UNSIGNED,
            "count": len(rows),
            "type": shape,
        }
        if limits:
            columns = rows.reshape(len(rows), -1)
            accessor["min"] = columns.min(axis=0).tolist()
            accessor["max"] = columns.max(axis=0).tolist()
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _camera(camera: Pinhole) -> dict[str, Any]:
    distance_m = float(np.linalg.norm(np.subtract(camera.look_at_m, camera.position_m)))
    perspective = {
        "yfov": float(np.deg2rad(camera.vertical_fov_deg)),
        "aspectRatio": camera.width_px / camera.height_px,
        "znear": distance_m / 1000,
    }
    return {"type": "perspective", "perspective": perspective}


def _camera_node(camera: Pinhole) -> dict[str, Any]:
    """Return the node of a camera, which looks along its own −z."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera.axes.T
    matrix[:3, 3] = camera.position_m
    return {"name": "camera", "camera": 0, "matrix": matrix.T.ravel().tolist()}


def _chunk(kind: bytes, content: bytes, filler: bytes) -> bytes:
    padded = _padded(content, filler)
    return struct.pack("<I", len(padded)) + kind + padded


def _padded(content: bytes, filler: bytes) -> bytes:
    return content + filler * (-len(content) % 4)
