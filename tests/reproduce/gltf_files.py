"""Small glTF files for tests, written in every way that the format allows."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


class GltfFile:
    """A file as its parts are added; `said` may be changed before it is written."""

    def __init__(self) -> None:
        self.binary = b""
        self.said: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
            "meshes": [], "accessors": [], "bufferViews": [],
        }  # fmt: skip

    def add(self, name: str, part: dict[str, Any]) -> int:
        self.said.setdefault(name, []).append(part)
        return len(self.said[name]) - 1

    def view(self, values: NDArray[Any], **keys: Any) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        at = len(self.binary)
        self.binary += values.tobytes()
        return self.add("bufferViews", {"buffer": 0, "byteOffset": at,
                                        "byteLength": values.nbytes, **keys})  # fmt: skip

    def accessor(self, values: ArrayLike, kind: str, **keys: Any) -> int:
        """Numbers of a kind such as `f4`, with their limits; rows of VEC3 at steps of four."""
        table = np.asarray(values, dtype=f"<{kind}")
        table = table.reshape(len(table), -1)
        width = table.shape[1]
        stored, step = table, {}
        if width == 3 and table.dtype.itemsize < 4:
            stored = np.hstack([table, np.zeros((len(table), 1), table.dtype)])
            step = {"byteStride": stored.strides[0]}
        return self.add("accessors", {
            "bufferView": self.view(stored, **step), "componentType": COMPONENTS[kind],
            "count": len(table), "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[width],
            "min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist(), **keys,
        })  # fmt: skip

    def mesh(self, vertices: ArrayLike, faces: ArrayLike, **keys: Any) -> int:
        primitive = {"attributes": {"POSITION": self.accessor(vertices, "f4")},
                     "indices": self.accessor(np.ravel(faces), "u2"), **keys}  # fmt: skip
        return self.add("meshes", {"primitives": [primitive]})

    def show(self, **node: Any) -> int:
        number = self.add("nodes", node)
        self.said["scenes"][0]["nodes"].append(number)
        return number

    def write(self, path: Path) -> Path:
        said = {"buffers": [{"byteLength": len(self.binary)}], **self.said}
        if path.suffix == ".gltf":
            path.write_text(json.dumps(said), encoding="utf-8")
            return path
        text = json.dumps(said).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        path.write_bytes(
            struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
            + struct.pack("<I4s", len(text), b"JSON") + text
            + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        )  # fmt: skip
        return path
