"""Surfaces of a scene as one list of triangles, and the places on them that have states."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from labrig.errors import UsageError
from labrig.reproduce.compiled import compiled
from labrig.reproduce.transport.mesh import Mesh

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int32]

#: How states lie on a surface: none of its own, texels (columns, rows), its vertices, or one for
#: each of the particles that its mesh consists of.
Samples: TypeAlias = tuple[int, int] | Literal["vertices", "particles"] | None
ONE_PLACE, TEXELS, VERTICES = 0, 1, 2
#: Vertices of the octahedron that a particle is.
OF_PARTICLE = 6
#: Points along each edge of a texel at which its place on the surface is looked up.
LOOKUPS = 4
#: Part of the looked-up points that may belong to two triangles: rounding along their edges.
SHARED_POINTS = 0.02


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
    material_of_texel: IntArray | None = None

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
class StartPoints:
    """Points on surfaces, several in a row for each place.

    Attributes
    ----------
    position_m, normal
        Points in m from the geometry's `origin_m`, and unit normals there, shape (n, 3).
    place
        Place of each point, shape (n,).
    """

    position_m: Float32Array
    normal: Float32Array
    place: IntArray


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
    origin_m
        Middle of the scene, from which `triangles` are measured: single precision is finest there.
    """

    surfaces: tuple[Surface, ...]
    triangles: Float32Array
    normals: Float32Array
    uv: Float32Array
    corner_place: IntArray
    surface_of_face: IntArray
    table: IntArray
    material_of_place: IntArray
    origin_m: FloatArray

    @classmethod
    def of(cls, surfaces: Sequence[Surface]) -> Self:
        """Put surfaces together.

        Raises
        ------
        UsageError
            There is no surface, or one with texels has no texture coordinates, or some that are not
            finite.
        """
        if not surfaces:
            raise UsageError("expected a scene with objects, got none")
        triangles, normals, uvs, corners, owners, rows, materials = [], [], [], [], [], [], []
        first = 0
        for number, surface in enumerate(surfaces):
            mesh, faces = surface.mesh, surface.mesh.faces
            triangles.append(mesh.vertices_m[faces])
            normals.append(mesh.normals)
            uvs.append(_uv_of(surface)[faces])
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

    @cached_property
    def is_room(self) -> bool:
        """Whether a closed surface around all others has its front inside: no ray can leave it."""
        flat = self.triangles.reshape(-1, 3)
        low, high = flat.min(axis=0) + self.origin_m, flat.max(axis=0) + self.origin_m
        nearly = 1e-5 * self.size_m
        return any(
            (surface.mesh.vertices_m.min(axis=0) <= low + nearly).all()
            and (surface.mesh.vertices_m.max(axis=0) >= high - nearly).all()
            and surface.mesh.volume_m3 < 0
            and surface.mesh.is_closed
            for surface in self.surfaces
            if surface.lamp < 0
        )

    def places_of(self, surface: int) -> slice:
        """Return the places of a surface."""
        first = int(self.table[surface, 1])
        return slice(first, first + self.surfaces[surface].n_places)

    def starts(
        self, surface: int, per_place: int, rng: np.random.Generator, scattered: FloatArray
    ) -> StartPoints:
        """Return points on a surface, `per_place` for each place that lies on it.

        Parameters
        ----------
        surface
            Number of a surface whose states lie on texels or vertices.
        per_place
            Points for each place.
        rng
            Random numbers that choose triangles or parts of a texel.
        scattered
            Even numbers from 0 to 1 that choose points, shape (places, per_place, 2).

        Raises
        ------
        UsageError
            Two parts of the surface share texels, or no texel lies on it.
        """
        own = self.surfaces[surface]
        first = int(self.table[surface, 1])
        if own.samples == "particles":
            face, weights, place = _on_particles(own, per_place, rng, scattered)
        elif own.samples == "vertices":
            face, weights, place = _around_vertices(own.mesh, per_place, rng, scattered)
        else:
            face, weights, place = _on_texels(own, per_place, rng, scattered)
        corners = own.mesh.vertices_m[own.mesh.faces[face]]
        return StartPoints(
            (np.einsum("nk,nkc->nc", weights, corners) - self.origin_m).astype(np.float32),
            own.mesh.normals[face].astype(np.float32),
            (place + first).astype(np.int32),
        )


def _uv_of(surface: Surface) -> FloatArray:
    uv = surface.mesh.uv
    if isinstance(surface.samples, tuple):
        if uv is None:
            raise UsageError(
                f"{surface.name}: expected texture coordinates for its texels, got a mesh without; "
                "unwrap it, or give 'samples: vertices'"
            )
        if not np.isfinite(uv).all() or uv.min() < -1e-6 or uv.max() > 1 + 1e-6:
            raise UsageError(
                f"{surface.name}: expected texture coordinates from 0 to 1, got "
                f"{np.nanmin(uv):g} to {np.nanmax(uv):g}"
            )
    return np.zeros((len(surface.mesh.vertices_m), 2)) if uv is None else uv


def _around_vertices(
    mesh: Mesh, per_place: int, rng: np.random.Generator, scattered: FloatArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return triangles, weights of their corners, and vertices, for points near each vertex.

    A point lies the likelier near a vertex the larger the weight of the vertex there, so that the
    mean over the points is that which the vertex stands for.
    """
    vertex, area = mesh.faces.T.ravel(), np.tile(mesh.areas_m2, 3)
    corner = np.repeat(np.arange(3), len(mesh.faces))
    order = np.argsort(vertex, kind="stable")
    vertex, area, corner = vertex[order], area[order], corner[order]
    face = (order % len(mesh.faces)).astype(np.int32)
    end = np.cumsum(area)
    begin_of = np.searchsorted(vertex, np.arange(len(mesh.vertices_m)))
    end_of = np.searchsorted(vertex, np.arange(len(mesh.vertices_m)), side="right")
    total = np.r_[0.0, end]
    place = np.flatnonzero(total[end_of] > total[begin_of]).repeat(per_place)
    chosen = rng.random(len(place))
    level = total[begin_of[place]] * (1 - chosen) + total[end_of[place]] * chosen
    entry = np.clip(np.searchsorted(end, level), begin_of[place], end_of[place] - 1)
    # Weight w of the corner with density 6 w (1 − w), the rest of the two others evenly.
    first, second = scattered.reshape(-1, 2)[: len(place)].T
    own = _inverse_hat(first)
    weights = np.empty((len(place), 3))
    rows = np.arange(len(place))
    weights[rows, corner[entry]] = own
    weights[rows, (corner[entry] + 1) % 3] = (1 - own) * second
    weights[rows, (corner[entry] + 2) % 3] = (1 - own) * (1 - second)
    return face[entry], weights, place.astype(np.int32)


def _on_particles(
    surface: Surface, per_place: int, rng: np.random.Generator, scattered: FloatArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return triangles, weights of their corners, and particles, for points on each particle."""
    place = np.arange(surface.n_places).repeat(per_place)
    faces = len(surface.mesh.faces) // surface.n_places
    turn = rng.integers(0, faces, surface.n_places).repeat(per_place)
    face = faces * place + (turn + np.tile(np.arange(per_place), surface.n_places)) % faces
    first, second = scattered.reshape(-1, 2)[: len(place)].T
    root = np.sqrt(first)
    weights = np.stack([1 - root, root * second, root * (1 - second)], axis=1)
    return face.astype(np.int32), weights, place.astype(np.int32)


def _inverse_hat(evenly: FloatArray) -> FloatArray:
    """Return w where ∫₀ʷ 6 x (1 − x) dx = 3 w² − 2 w³ is as given: 1/2 − sin(arcsin(1 − 2 x)/3)."""
    return np.asarray(0.5 - np.sin(np.arcsin(1 - 2 * evenly) / 3))


def _on_texels(
    surface: Surface, per_place: int, rng: np.random.Generator, scattered: FloatArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return triangles, weights of their corners, and texels, for points on each texel."""
    kernels = compiled("transport.tracing_kernels")
    assert isinstance(surface.samples, tuple)
    assert surface.mesh.uv is not None
    columns, rows = surface.samples
    corners = surface.mesh.uv[surface.mesh.faces].astype(np.float32)
    face_at, n_shared = kernels.rasterised(corners, columns * LOOKUPS, rows * LOOKUPS)
    covered = int((face_at >= 0).sum())
    if not covered:
        raise UsageError(
            f"{surface.name}: expected texels on the surface, got none; see its texture"
        )
    if n_shared > SHARED_POINTS * covered:
        raise UsageError(
            f"{surface.name}: expected every texel at one place, got texture coordinates of which "
            f"{n_shared / covered:.0%} belong to two triangles; unwrap it without overlap"
        )
    parts = face_at.reshape(rows, LOOKUPS, columns, LOOKUPS).swapaxes(1, 2)
    parts = parts.reshape(rows * columns, LOOKUPS**2)
    n_parts = (parts >= 0).sum(axis=1)
    texel = np.flatnonzero(n_parts)
    # Covered parts first, in their order.
    order = np.argsort(parts < 0, axis=1, kind="stable")
    place = texel.repeat(per_place)
    even = scattered.reshape(-1, 2)[: len(place)]
    start = rng.integers(0, 2**31, len(texel)).repeat(per_place)
    turn = (start + np.tile(np.arange(per_place), len(texel))) % n_parts[place]
    part = order[place, turn]
    u = ((place % columns) + (part % LOOKUPS + even[:, 0]) / LOOKUPS) / columns
    v = ((place // columns) + (part // LOOKUPS + even[:, 1]) / LOOKUPS) / rows
    face, weights = kernels.located_in_texture(
        corners,
        face_at,
        np.stack([u, v], axis=1).astype(np.float32),
        np.stack(
            [
                place // columns * LOOKUPS + part // LOOKUPS,
                place % columns * LOOKUPS + part % LOOKUPS,
            ],
            axis=1,
        ).astype(np.int32),
    )
    return face, weights, place.astype(np.int32)
