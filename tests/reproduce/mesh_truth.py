"""Area, bounds and volume of what is in mesh files, computed apart from labrig's readers.

Areas and volumes of polygons come from sums around them: nothing is divided into triangles.
"""

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray


@dataclass(frozen=True)
class Truth:
    """What a mesh is, whatever its triangles are."""

    area: float
    low: FloatArray
    high: FloatArray
    #: Enclosed volume, if it is closed.
    volume: float

    @classmethod
    def of(cls, polygons: list[FloatArray]) -> "Truth":
        """Sum over polygons (corners, 3)."""
        corners = np.concatenate(polygons)
        area = volume = 0.0
        for ring in polygons:
            vector = sum(
                np.cross(a, b) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)
            )
            area += float(np.linalg.norm(vector)) / 2
            volume += float(ring.mean(axis=0) @ vector) / 6
        return cls(area, corners.min(axis=0), corners.max(axis=0), volume)


def truth(path: Path) -> Truth:
    readers = {".obj": _obj, ".stl": _stl, ".ply": _ply, ".glb": _gltf, ".gltf": _gltf}
    return Truth.of(readers[path.suffix](path))


def _obj(path: Path) -> list[FloatArray]:
    places: list[list[float]] = []
    polygons = []
    for line in path.read_text(encoding="utf-8").replace("\\\n", " ").splitlines():
        match line.split():
            case ["v", *numbers]:
                places.append([float(one) for one in numbers[:3]])
            case ["f", *corners]:
                numbers_of = [int(corner.split("/")[0]) for corner in corners]
                polygons.append([places[n - 1 if n > 0 else n] for n in numbers_of])
    return [np.array(polygon) for polygon in polygons]


def _stl(path: Path) -> list[FloatArray]:
    content = path.read_bytes()
    if b"\0" in content:
        (n,) = struct.unpack_from("<I", content, 80)
        return [np.array(struct.unpack_from("<9f", content, 84 + 50 * k + 12)).reshape(3, 3)
                for k in range(n)]  # fmt: skip
    lines = [line.split() for line in content.decode().splitlines()]
    places = [[float(one) for one in words[1:]] for words in lines if words[:1] == ["vertex"]]
    return list(np.array(places).reshape(-1, 3, 3))


def _ply(path: Path) -> list[FloatArray]:
    """A file whose vertices begin with x, y and z as floats, and whose faces are one list."""
    head, _, data = path.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in head.decode().splitlines()]
    counts = {line[1]: int(line[2]) for line in words if line[0] == "element"}
    n_of_vertex = sum(line[:2] == ["property", "float"] for line in words)
    n = n_of_vertex * counts["vertex"]
    if words[1][1] == "ascii":
        stream = iter(data.split())
        places = np.array([float(next(stream)) for _ in range(n)])
        rings = [[int(next(stream)) for _ in range(int(next(stream)))]
                 for _ in range(counts["face"])]  # fmt: skip
    else:
        order = ">" if "big" in words[1][1] else "<"
        places = np.array(struct.unpack_from(f"{order}{n}f", data))
        at, rings = 4 * n, []
        for _ in range(counts["face"]):
            rings.append(list(struct.unpack_from(f"{order}{data[at]}i", data, at + 1)))
            at += 1 + 4 * data[at]
    return [places.reshape(-1, n_of_vertex)[ring, :3] for ring in rings]


def _gltf(path: Path) -> list[FloatArray]:
    """Triangle lists of a binary file with one buffer and one scene."""
    content = path.read_bytes()
    (size,) = struct.unpack_from("<I", content, 12)
    said: dict[str, Any] = json.loads(content[20 : 20 + size])
    binary = content[28 + size :]
    formats = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
    widths = {"SCALAR": 1, "VEC3": 3}

    def row(view: int, offset: int, form: str, width: int, number: int) -> list[float]:
        at = said["bufferViews"][view]
        step = at.get("byteStride", struct.calcsize(f"<{width}{form}"))
        start = at.get("byteOffset", 0) + offset + number * step
        return list(struct.unpack_from(f"<{width}{form}", binary, start))

    def rows(number: int) -> list[list[float]]:
        accessor = said["accessors"][number]
        width, form = widths[accessor["type"]], formats[accessor["componentType"]]
        start = accessor.get("byteOffset", 0)
        found = [[0.0] * width if "bufferView" not in accessor
                 else row(accessor["bufferView"], start, form, width, n)
                 for n in range(accessor["count"])]  # fmt: skip
        if (sparse := accessor.get("sparse")) is not None:
            for n in range(sparse["count"]):
                of_index = formats[sparse["indices"]["componentType"]]
                (index,) = row(sparse["indices"]["bufferView"], 0, of_index, 1, n)
                found[int(index)] = row(sparse["values"]["bufferView"], 0, form, width, n)
        if accessor.get("normalized"):
            largest = {"b": 127, "B": 255, "h": 32767, "H": 65535}[form]
            found = [[max(value / largest, -1.0) for value in one] for one in found]
        return found

    def shown(number: int, above: FloatArray) -> list[FloatArray]:
        node = said["nodes"][number]
        if "matrix" in node:
            own = np.array(node["matrix"]).reshape(4, 4, order="F")
        else:
            x, y, z, w = node.get("rotation", [0, 0, 0, 1])
            turned = np.array([
                [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
            ])  # fmt: skip
            own = np.eye(4)
            own[:3, :3] = turned @ np.diag(node.get("scale", [1, 1, 1]))
            own[:3, 3] = node.get("translation", [0, 0, 0])
        here = above @ own
        found = []
        primitives = said["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []
        for primitive in primitives:
            places = rows(primitive["attributes"]["POSITION"])
            indices = list(range(len(places)))
            if "indices" in primitive:
                indices = [int(index) for (index,) in rows(primitive["indices"])]
            for first in range(0, len(indices), 3):
                ring = [(here @ [*places[k], 1])[:3] for k in indices[first : first + 3]]
                # The front of what is mirrored is where its corners run the other way around.
                found.append(np.array(ring[:: int(np.sign(np.linalg.det(here)))]))
        for child in node.get("children", []):
            found += shown(child, here)
        return found

    roots = said["scenes"][said.get("scene", 0)]["nodes"]
    return [ring for root in roots for ring in shown(root, np.eye(4))]
