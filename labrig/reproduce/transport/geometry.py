"""Surfaces of a scene as one list of triangles, and the places on them that have states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self, TypeAlias

import numpy as np

from labrig.foundation.arrays import Float32Array, FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce.transport.mesh import Mesh
from labrig.reproduce.transport.start_points import (
    OnParticles,
    OnTexels,
    OnVertices,
    StartPoints,
    TexelMap,
)

#: How states lie on a surface: none of its own, texels (columns, rows), its vertices, or one for
#: each of the particles that its mesh consists of.
Samples: TypeAlias = tuple[int, int] | Literal["vertices", "particles"] | None
ONE_PLACE, TEXELS, VERTICES = 0, 1, 2
#: Vertices of the octahedron that a particle is.
OF_PARTICLE = 6


@dataclass(frozen=True, eq=False)
class Surface:
    """An object of a scene.

    Attributes
    ----------
    name
        Name of the object.
    mesh
        Its triangles.
    material
        Number of its material; -1 of a lamp, which reflects nothing.
    samples
        How states lie on it.
    lamp
        Number of the lamp that it is, else -1.
    is_two_sided
        Whether its back has the same material; else the back is black.
    material_of_texel
        Number of the material of each texel, shape (rows, columns); None if all have `material`.
    """

    name: str
    mesh: Mesh
    material: int
    samples: Samples = None
    lamp: int = -1
    is_two_sided: bool = False
    material_of_texel: Int32Array | None = None

    @property
    def n_places(self) -> int:
        """Number of places that have a state of their own, at least one."""
        if self.samples is None:
            return 1
        if self.samples == "vertices":
            return len(self.mesh.vertices_m)
        if self.samples == "particles":
            return len(self.mesh.vertices_m) // OF_PARTICLE
        return self.samples[0] * self.samples[1]

    @property
    def uv_of_places(self) -> FloatArray | None:
        """Texture coordinates of its places, shape (places, 2); None where it has none."""
        if isinstance(self.samples, tuple):
            columns, rows = self.samples
            row, column = np.divmod(np.arange(columns * rows), columns)
            return np.stack([(column + 0.5) / columns, (row + 0.5) / rows], axis=1)
        return self.mesh.uv if self.samples == "vertices" else None


@dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene, in single precision as they are traced.

    Attributes
    ----------
    surfaces
        Objects, in the order of the scene.
    triangles, normals
        Corners in m from `origin_m` (m, 3, 3), and unit normals (m, 3).
    uv
        Texture coordinates of the corners, shape (m, 3, 2); zero where there are none.
    corner_place
        Places of the corners, of surfaces with states at their vertices (m, 3).
    surface_of_face
        Number of the surface of each triangle, shape (m,).
    table
        A row for each surface: kind of its places, first place, columns, rows, lamp, two-sided.
    material_of_place
        Number of the material of each place, shape (places,); -1 is black.
    chart_of_face, chart_of_place
        Chart of each triangle (m,) and of each texel (places,), of surfaces with texels; see
        `TexelMap`.
    texel_maps
        Maps of the surfaces with texels, by their numbers.
    origin_m
        Middle of the scene, from which `triangles` are measured: single precision is finest there.
    """

    surfaces: tuple[Surface, ...]
    triangles: Float32Array
    normals: Float32Array
    uv: Float32Array
    corner_place: Int32Array
    surface_of_face: Int32Array
    table: Int32Array
    material_of_place: Int32Array
    chart_of_face: Int32Array
    chart_of_place: Int32Array
    texel_maps: Mapping[int, TexelMap]
    origin_m: FloatArray

    @classmethod
    def of(cls, surfaces: Sequence[Surface]) -> Self:
        """Put surfaces together.

        Raises
        ------
        UsageError
            There is no surface, or the texture coordinates of one with texels do not fit; see
            `TexelMap`.
        """
        if not surfaces:
            raise UsageError("expected a scene with objects, got none")
        triangles, normals, uvs, corners, owners, rows, materials = [], [], [], [], [], [], []
        charts, charts_of_places = [], []
        maps, first = {}, 0
        for number, surface in enumerate(surfaces):
            mesh, faces = surface.mesh, surface.mesh.faces
            triangles.append(mesh.vertices_m[faces])
            normals.append(mesh.normals)
            uvs.append(np.zeros((len(faces), 3, 2)) if mesh.uv is None else mesh.uv[faces])
            owners.append(np.full(len(faces), number))
            is_particle = surface.samples == "particles"
            corners.append((faces // OF_PARTICLE if is_particle else faces) + first)
            columns, height = surface.samples if isinstance(surface.samples, tuple) else (1, 1)
            kind = (
                TEXELS
                if isinstance(surface.samples, tuple)
                else VERTICES
                if surface.samples
                else ONE_PLACE
            )
            rows.append((kind, first, columns, height, surface.lamp, surface.is_two_sided))
            own = surface.material_of_texel
            materials.append(
                np.full(surface.n_places, surface.material) if own is None else own.ravel()
            )
            chart = np.zeros(len(faces), np.int32)
            chart_of_place = np.zeros(surface.n_places, np.int32)
            if isinstance(surface.samples, tuple):
                maps[number] = TexelMap.of(surface.name, mesh, surface.samples)
                chart, chart_of_place = maps[number].chart_of_face, maps[number].chart_of_texel
            charts.append(chart)
            charts_of_places.append(chart_of_place)
            first += surface.n_places
        corners_m = np.concatenate(triangles)
        flat = corners_m.reshape(-1, 3)
        origin_m = (flat.min(axis=0) + flat.max(axis=0)) / 2
        return cls(
            tuple(surfaces),
            np.ascontiguousarray(corners_m - origin_m, dtype=np.float32),
            np.ascontiguousarray(np.concatenate(normals), dtype=np.float32),
            np.ascontiguousarray(np.concatenate(uvs), dtype=np.float32),
            np.ascontiguousarray(np.concatenate(corners), dtype=np.int32),
            np.concatenate(owners).astype(np.int32),
            np.array(rows, dtype=np.int32),
            np.concatenate(materials).astype(np.int32),
            np.concatenate(charts),
            np.concatenate(charts_of_places),
            maps,
            origin_m,
        )

    @property
    def n_places(self) -> int:
        """Number of all places."""
        return len(self.material_of_place)

    @cached_property
    def size_m(self) -> float:
        """Diagonal of the box around all triangles, in m."""
        flat = self.triangles.reshape(-1, 3)
        return float(np.linalg.norm(flat.max(axis=0) - flat.min(axis=0)))

    @property
    def is_room(self) -> bool:
        """Whether a closed surface around all others has its front inside: no ray can leave it."""
        return self._room is not None

    @cached_property
    def _room(self) -> Mesh | None:
        flat = self.triangles.reshape(-1, 3)
        low, high = flat.min(axis=0) + self.origin_m, flat.max(axis=0) + self.origin_m
        nearly = 1e-5 * self.size_m
        rooms = (
            surface.mesh
            for surface in self.surfaces
            if surface.lamp < 0
            and (surface.mesh.vertices_m.min(axis=0) <= low + nearly).all()
            and (surface.mesh.vertices_m.max(axis=0) >= high - nearly).all()
            and surface.mesh.volume_m3 < 0
            and surface.mesh.is_closed
        )
        return next(rooms, None)

    def is_room_around(self, point_m: Sequence[float]) -> bool:
        """Return whether the scene is a room, and a point in m is inside."""
        return self._room is not None and self._room.solid_angle_sr(point_m) < -2 * np.pi

    def places_of(self, surface: int) -> slice:
        """Return the places of a surface."""
        first = int(self.table[surface, 1])
        return slice(first, first + self.surfaces[surface].n_places)

    def start_points(self, surface: int) -> StartPoints:
        """Return the points at which the paths of the places of a surface begin.

        Parameters
        ----------
        surface
            Number of a surface that has places with states of their own.
        """
        own = self.surfaces[surface]
        if own.samples == "particles":
            return OnParticles.of(own.mesh, own.n_places)
        if own.samples == "vertices":
            return OnVertices.of(own.mesh)
        return OnTexels.of(own.mesh, self.texel_maps[surface])
