"""A reader of glTF files that shares no code with labrig."""

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.reproduce import ExportedMesh, Glow

TIMES_S = np.array([0.0, 0.5, 2.0, 7.0])

CORNERS = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.5]])

FACES = np.array([[0, 1, 2], [0, 2, 3]])

GREY = np.array([0.5, 0.4, 0.3])

COMPONENTS = {5126: "<f4", 5125: "<u4"}

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


class Read:
    """A binary glTF file as the specification takes it apart."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        self.json: dict[str, Any] = json.loads(content[20 : 20 + size])
        size_of_binary, kind = struct.unpack_from("<I4s", content, 20 + size)
        assert kind == b"BIN\0"
        assert size_of_binary % 4 == 0
        assert 28 + size + size_of_binary == length
        self.binary = content[28 + size :]
        assert 0 <= size_of_binary - self.json["buffers"][0]["byteLength"] <= 3

    def view(self, number: int) -> bytes:
        view = self.json["bufferViews"][number]
        assert view["byteOffset"] % 4 == 0
        return self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]

    def accessor(self, number: int) -> NDArray[Any]:
        accessor = self.json["accessors"][number]
        values = np.frombuffer(
            self.view(accessor["bufferView"]), COMPONENTS[accessor["componentType"]]
        ).reshape(accessor["count"], WIDTHS[accessor["type"]])
        if "min" in accessor:
            np.testing.assert_array_equal(values.min(axis=0), np.float32(accessor["min"]))
            np.testing.assert_array_equal(values.max(axis=0), np.float32(accessor["max"]))
        return values

    def primitive(self, mesh: int) -> dict[str, Any]:
        (primitive,) = self.json["meshes"][mesh]["primitives"]
        return dict(primitive)

    def material(self, mesh: int) -> dict[str, Any]:
        return dict(self.json["materials"][self.primitive(mesh)["material"]])

    def emission(self, mesh: int) -> FloatArray:
        """Emission at the frames of a mesh, its animated factor times its strength."""
        pointer = f"/materials/{self.primitive(mesh)['material']}/emissiveFactor"
        (animation,) = self.json["animations"]
        (channel,) = [
            one
            for one in animation["channels"]
            if one["target"]["extensions"]["KHR_animation_pointer"]["pointer"] == pointer
        ]
        assert channel["target"]["path"] == "pointer"
        assert "node" not in channel["target"]
        sampler = animation["samplers"][channel["sampler"]]
        times = self.accessor(sampler["input"])
        assert "min" in self.json["accessors"][sampler["input"]]
        np.testing.assert_allclose(times[:, 0], TIMES_S)
        factor = self.accessor(sampler["output"])
        assert factor.min() >= 0
        assert factor.max() <= 1
        return np.asarray(factor.astype(float) * self.strength(mesh))

    def strength(self, mesh: int) -> float:
        extension = self.material(mesh)["extensions"]["KHR_materials_emissive_strength"]
        return float(extension["emissiveStrength"])

    def texture(self, mesh: int) -> FloatArray:
        """The emissive texture of a mesh in linear sRGB, top row first."""
        texture = self.json["textures"][self.material(mesh)["emissiveTexture"]["index"]]
        image = self.json["images"][texture["source"]]
        assert image["mimeType"] == "image/png"
        bgr = cv2.imdecode(np.frombuffer(self.view(image["bufferView"]), np.uint8), 1)
        assert bgr is not None
        coded = bgr[..., ::-1] / 255
        return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def mesh(glow: Glow | None = None, uv: FloatArray | None = None) -> ExportedMesh:
    return ExportedMesh("sheet ö", CORNERS, FACES, GREY, uv, glow)
