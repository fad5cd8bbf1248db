"""Which triangle of a mesh lies where in its texture, and which parts of it belong together.

A chart is a part of a mesh that is one piece in the texture, too. Across the edge of a chart
neighbouring texels are of elsewhere on the surface: nothing is interpolated between them.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from labrig.foundation.arrays import FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce.compiled import compiled
from labrig.reproduce.transport.mesh import Mesh

#: Points along each edge of a texel at which its place on the surface is looked up, at least; and
#: along each edge of the texture.
LEAST_LOOKUPS, LEAST_POINTS = 4, 256
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
        across, up = (max(LEAST_LOOKUPS, math.ceil(LEAST_POINTS / size)) for size in samples)
        face_at, n_shared = compiled("transport.tracing_kernels").rasterised(
            corners, columns * across, rows * up
        )
        covered = int((mesh.areas_m2 > 0)[face_at[face_at >= 0]].sum())
        if not covered:
            raise UsageError(f"{name}: expected texels on the surface, got none; see its texture")
        if n_shared > SHARED_POINTS * covered:
            raise UsageError(
                f"{name}: expected every texel at one place, got texture coordinates of which "
                f"{n_shared / covered:.0%} belong to two triangles; unwrap it without overlap"
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
