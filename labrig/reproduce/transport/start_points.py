"""Points on a surface at which the paths of its places begin, as even by area as they can be.

A chart is a part of a mesh that is one piece in the texture, too. Across the edge of a chart
neighbouring texels are of elsewhere on the surface: nothing is interpolated between them.
"""

import math
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from labrig.foundation.arrays import FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce.compiled import compiled
from labrig.reproduce.transport.mesh import Mesh

#: Points along each edge of a texel at which its place on the surface is looked up, at least; and
#: along each edge of the texture.
MIN_LOOKUPS, MIN_POINTS = 4, 256
#: Part of the looked-up points that may belong to two triangles: rounding along their edges.
SHARED_POINTS = 0.02
#: Decimals of texture coordinates, and of places relative to the mesh, at which vertices are one.
SAME_DECIMALS = 6


@dataclass(frozen=True, eq=False)
class TexelMap:
    """Triangles in a texture.

    Attributes
    ----------
    columns, rows
        Size of the texture in texels.
    across, up
        Points along the edges of a texel.
    face_at
        Triangle at each point, -1 beside all, shape (rows · up, columns · across).
    chart_of_face
        Chart of each triangle, shape (m,).
    chart_of_texel
        Chart of which most of each texel is, -1 beside all, shape (rows · columns,).
    """

    columns: int
    rows: int
    across: int
    up: int
    face_at: Int32Array
    chart_of_face: Int32Array
    chart_of_texel: Int32Array

    @classmethod
    def of(cls, name: str, mesh: Mesh, samples: tuple[int, int]) -> Self:
        """Return the map of a mesh.

        Parameters
        ----------
        name
            Name of the object, for errors.
        mesh
            The mesh.
        samples
            Columns and rows of the texture.

        Raises
        ------
        UsageError
            The mesh has no texture coordinates, some lie beside the texture, two parts of it share
            texels, or no texel lies on it.
        """
        columns, rows = samples
        corners = texture_coordinates(name, mesh)[mesh.faces].astype(np.float32)
        across, up = (max(MIN_LOOKUPS, math.ceil(MIN_POINTS / size)) for size in samples)
        face_at, n_shared = compiled("transport.tracing_kernels").rasterised(
            corners, columns * across, rows * up
        )
        covered = int((mesh.areas_m2 > 0)[face_at[face_at >= 0]].sum())
        if not covered:
            raise UsageError(f"{name}: expected texels on the surface, got none; see its texture")
        if n_shared > SHARED_POINTS * covered:
            raise UsageError(
                f"{name}: expected every texel at one place, got texture coordinates of which "
                f"{100 * n_shared / covered:.0f} % belong to two triangles; unwrap it without "
                "overlap"
            )
        chart_of_face = _charts(mesh)
        cells = np.where(face_at >= 0, chart_of_face[face_at], -1)
        by_texel = cells.reshape(rows, up, columns, across).swapaxes(1, 2)
        chart_of_texel = _majority(by_texel.reshape(rows * columns, up * across))
        return cls(columns, rows, across, up, face_at, chart_of_face, chart_of_texel)

    def faces_in(self, texels: Int32Array) -> Int32Array:
        """Return the triangles at the points of some texels, shape (texels, up · across)."""
        row, column = np.divmod(texels, self.columns)
        blocks = self.face_at.reshape(self.rows, self.up, self.columns, self.across)
        return np.ascontiguousarray(blocks[row, :, column, :].reshape(len(texels), -1))


def texture_coordinates(name: str, mesh: Mesh) -> FloatArray:
    """Return the texture coordinates of the vertices of a mesh, shape (n, 2).

    Raises
    ------
    UsageError
        There are none, or some are not finite or beside the texture.
    """
    uv = mesh.uv
    if uv is None:
        raise UsageError(
            f"{name}: expected texture coordinates for its texels, got a mesh without; unwrap it, "
            "or give 'samples: vertices'"
        )
    if not np.isfinite(uv).all() or uv.min() < -1e-6 or uv.max() > 1 + 1e-6:
        raise UsageError(
            f"{name}: expected texture coordinates from 0 to 1, got {np.nanmin(uv):g} to "
            f"{np.nanmax(uv):g}"
        )
    return uv


def _charts(mesh: Mesh) -> Int32Array:
    """Return the chart of each triangle: those that share vertices here and in the texture."""
    assert mesh.uv is not None
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    relative = (mesh.vertices_m - low) / max(float((high - low).max()), 1e-300)
    places = np.round(np.hstack([relative, mesh.uv]), SAME_DECIMALS)
    _, same = np.unique(places, axis=0, return_inverse=True)
    a, b, c = same.reshape(-1)[mesh.faces].T
    n = len(mesh.vertices_m)
    edges = coo_array((np.ones(2 * len(a), np.int8), (np.r_[a, b], np.r_[b, c])), shape=(n, n))
    _, chart = connected_components(edges, directed=False)
    return np.asarray(chart[a], dtype=np.int32)


def _majority(charts: Int32Array) -> Int32Array:
    """Return what most of the numbers ≥ 0 in each row are, -1 of a row without (n, k)."""
    # The middle one of those in order is the majority wherever there is one.
    ordered = np.sort(charts, axis=1)
    n_beside = (ordered < 0).sum(axis=1)
    middle = np.minimum((n_beside + charts.shape[1]) // 2, charts.shape[1] - 1)
    return np.asarray(ordered[np.arange(len(ordered)), middle], dtype=np.int32)


#: What is surely below 1, also of a sum over many texels.
BELOW_ONE = 1 - 1e-9


class StartPoints(Protocol):
    """Points on a surface, several for each of its places."""

    @property
    def places(self) -> Int32Array:
        """Places that lie on the surface, counted from its first, shape (n,)."""

    def at(
        self, chosen: slice, scattered: FloatArray, rng: np.random.Generator
    ) -> tuple[Int32Array, FloatArray]:
        """Return triangles (points,) and weights of their corners (points, 3), place by place.

        Parameters
        ----------
        chosen
            Which of `places`.
        scattered
            Even numbers from 0 to 1 that choose points, shape (places, per place, 2).
        rng
            Random numbers that choose triangles or parts of a texel.
        """


@dataclass(frozen=True, eq=False)
class OnVertices:
    """Points around vertices.

    A point lies the likelier near a vertex the larger the weight of the vertex there, so that the
    mean over the points is that which the vertex stands for.
    """

    places: Int32Array
    _face: Int32Array
    _corner: Int32Array
    _end: FloatArray
    _first: NDArray[np.int64]
    _last: NDArray[np.int64]

    @classmethod
    def of(cls, mesh: Mesh) -> "OnVertices":
        """Return the points of a mesh."""
        vertex = mesh.faces.T.ravel()
        order = np.argsort(vertex, kind="stable")
        end = np.cumsum(np.tile(mesh.areas_m2, 3)[order])
        numbers = np.arange(len(mesh.vertices_m))
        first = np.searchsorted(vertex[order], numbers)
        last = np.searchsorted(vertex[order], numbers, side="right")
        total = np.r_[0.0, end]
        places = np.flatnonzero(total[last] > total[first])
        return cls(
            places.astype(np.int32),
            (order % len(mesh.faces)).astype(np.int32),
            (order // len(mesh.faces)).astype(np.int32),
            end,
            first[places],
            last[places],
        )

    def at(
        self, chosen: slice, scattered: FloatArray, rng: np.random.Generator
    ) -> tuple[Int32Array, FloatArray]:
        """Return triangles and weights of their corners; see `StartPoints`."""
        per_place = scattered.shape[1]
        first, last = (each[chosen].repeat(per_place) for each in (self._first, self._last))
        low, high = np.where(first > 0, self._end[first - 1], 0.0), self._end[last - 1]
        level = low + rng.random(len(first)) * (high - low)
        entry = np.clip(np.searchsorted(self._end, level), first, last - 1)
        # Weight w of the corner with density 6 w (1 − w), the rest of the two others evenly.
        own, second = _inverse_hat(scattered[..., 0].ravel()), scattered[..., 1].ravel()
        weights = np.empty((len(entry), 3))
        rows, corner = np.arange(len(entry)), self._corner[entry]
        weights[rows, corner] = own
        weights[rows, (corner + 1) % 3] = (1 - own) * second
        weights[rows, (corner + 2) % 3] = (1 - own) * (1 - second)
        return self._face[entry], weights


@dataclass(frozen=True, eq=False)
class OnParticles:
    """Points on particles, each of so many triangles of the same size."""

    places: Int32Array
    _n_faces: int

    @classmethod
    def of(cls, mesh: Mesh, n_particles: int) -> "OnParticles":
        """Return the points of a mesh of particles."""
        return cls(np.arange(n_particles, dtype=np.int32), len(mesh.faces) // n_particles)

    def at(
        self, chosen: slice, scattered: FloatArray, rng: np.random.Generator
    ) -> tuple[Int32Array, FloatArray]:
        """Return triangles and weights of their corners; see `StartPoints`."""
        own = self.places[chosen]
        turn = rng.integers(0, self._n_faces, len(own))[:, np.newaxis]
        side = (turn + np.arange(scattered.shape[1])) % self._n_faces
        face = self._n_faces * own[:, np.newaxis] + side
        root, second = np.sqrt(scattered[..., 0]).ravel(), scattered[..., 1].ravel()
        weights = np.stack([1 - root, root * second, root * (1 - second)], axis=1)
        return face.ravel().astype(np.int32), weights


@dataclass(frozen=True, eq=False)
class OnTexels:
    """Points in texels, as even on the surface as its triangles are in the texture.

    A texel is divided into the cells of its map. A cell is taken as often as the part of the
    surface is large that lies there.
    """

    places: Int32Array
    _map: TexelMap
    _corners: NDArray[np.float32]
    _density: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, texel_map: TexelMap) -> "OnTexels":
        """Return the points of a mesh with texels."""
        assert mesh.uv is not None
        corners = mesh.uv[mesh.faces]
        u, v = np.moveaxis(corners[:, 1:] - corners[:, :1], -1, 0)
        in_texture = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        # Of triangles without an area in the texture there is no cell.
        density = mesh.areas_m2 / np.where(in_texture > 0, in_texture, np.inf)
        lit = (density > 0)[texel_map.face_at] & (texel_map.face_at >= 0)
        of_texels = lit.reshape(texel_map.rows, texel_map.up, texel_map.columns, texel_map.across)
        is_on_surface = of_texels.any(axis=(1, 3))
        places = np.flatnonzero(is_on_surface).astype(np.int32)
        return cls(places, texel_map, corners.astype(np.float32), density)

    def at(
        self, chosen: slice, scattered: FloatArray, rng: np.random.Generator
    ) -> tuple[Int32Array, FloatArray]:
        """Return triangles and weights of their corners; see `StartPoints`."""
        texels, per_place = self.places[chosen], scattered.shape[1]
        across, up = self._map.across, self._map.up
        faces = self._map.faces_in(texels)
        end = np.cumsum(np.where(faces >= 0, self._density[faces], 0.0)).reshape(faces.shape)
        low = np.r_[0.0, end[:-1, -1]][:, np.newaxis]
        evenly = (np.arange(per_place) + rng.random((len(texels), 1))) / per_place
        level = low + evenly * BELOW_ONE * (end[:, -1:] - low)
        cell = np.searchsorted(end.ravel(), level.ravel(), side="right")
        up_cell, across_cell = np.divmod(cell % (across * up), across)
        row, column = np.divmod(texels.repeat(per_place), self._map.columns)
        at_row, at_column = row * up + up_cell, column * across + across_cell
        n_rows, n_columns = self._map.face_at.shape
        uv = np.stack(
            [
                (at_column + scattered[..., 0].ravel()) / n_columns,
                (at_row + scattered[..., 1].ravel()) / n_rows,
            ],
            axis=1,
        )
        face, weights = compiled("transport.tracing_kernels").located_in_texture(
            self._corners,
            self._map.face_at,
            uv.astype(np.float32),
            np.stack([at_row, at_column], axis=1).astype(np.int32),
        )
        return face, weights


def _inverse_hat(evenly: FloatArray) -> FloatArray:
    """Return w where ∫₀ʷ 6 x (1 − x) dx = 3 w² − 2 w³ is as given: 1/2 − sin(arcsin(1 − 2 x)/3)."""
    return np.asarray(0.5 - np.sin(np.arcsin(1 - 2 * evenly) / 3))
