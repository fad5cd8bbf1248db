"""Lamps of a scene, as the paths see them: a place or a direction, and a factor for each band."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Self, TypeAlias

import numpy as np

from labrig.foundation.arrays import Float32Array, FloatArray, Int32Array
from labrig.reproduce.transport.geometry import Geometry

LampKind: TypeAlias = Literal["point", "area", "distant", "sky"]
KINDS: tuple[LampKind, ...] = ("point", "area", "distant", "sky")


@dataclass(frozen=True, eq=False)
class Lamp:
    """A source of light.

    Attributes
    ----------
    name
        Name of the lamp.
    kind
        `point`: its light is a radiant intensity in W sr⁻¹ nm⁻¹; `area`: a radiance in W m⁻² sr⁻¹
        nm⁻¹ of the front of its surface; `distant`: an irradiance in W m⁻² nm⁻¹ across its
        direction; `sky`: a radiance from all directions in which nothing is.
    light
        That quantity in each band of the rendering, shape (bands,).
    vector
        Position in m of a point, unit direction towards a distant lamp.
    """

    name: str
    kind: LampKind
    light: FloatArray
    vector: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class LampTable:
    """Lamps as the compiled functions take them; see `tracing_kernels.towards_lamps`."""

    kind: Int32Array
    vector: Float32Array
    first: Int32Array
    faces: Int32Array
    share: Float32Array
    area: Float32Array

    @classmethod
    def of(cls, lamps: Sequence[Lamp], geometry: Geometry) -> Self:
        """Put lamps together with the triangles of those that are surfaces."""
        first, faces, shares, areas = [0], [], [], []
        for number in range(len(lamps)):
            own = [
                np.flatnonzero(geometry.surface_of_face == index)
                for index, surface in enumerate(geometry.surfaces)
                if surface.lamp == number
            ]
            area_of = [
                surface.mesh.areas_m2 for surface in geometry.surfaces if surface.lamp == number
            ]
            triangles = np.concatenate(own) if own else np.zeros(0, int)
            areas_m2 = np.concatenate(area_of) if area_of else np.zeros(0)
            faces.append(triangles)
            shares.append(np.cumsum(areas_m2) / max(areas_m2.sum(), 1e-30))
            areas.append(areas_m2.sum())
            first.append(first[-1] + len(triangles))
        return cls(
            np.array([KINDS.index(lamp.kind) for lamp in lamps], dtype=np.int32),
            np.array(
                [
                    np.array(lamp.vector) - (geometry.origin_m if lamp.kind == "point" else 0.0)
                    for lamp in lamps
                ],
                dtype=np.float32,
            ).reshape(-1, 3),
            np.array(first, dtype=np.int32),
            np.concatenate([*faces, np.zeros(0)]).astype(np.int32),
            np.concatenate([*shares, np.zeros(0)]).astype(np.float32),
            np.array(areas, dtype=np.float32),
        )

    def __len__(self) -> int:
        return len(self.kind)
