"""Triangle meshes, and the shapes that a scene file names."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from labrig.foundation.arrays import FloatArray, Int32Array
from labrig.foundation.errors import UsageError

IntArray64 = NDArray[np.int64]

PARTLY_UNWRAPPED = (
    "expected texture coordinates on all faces or on none, got them on some; unwrap all of the mesh"
)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise as seen from their front.

    Attributes
    ----------
    vertices_m
        Places of the vertices in m, shape (n, 3).
    faces
        Three vertices of each triangle, shape (m, 3).
    uv
        Texture coordinates of the vertices, 0 to 1, shape (n, 2); None if there are none.

    Examples
    --------
    >>> from labrig.reproduce import Mesh
    >>> wall = Mesh.rectangle((0, 0, 0), (2, 0, 0), (0, 3, 0))
    >>> wall.area_m2, wall.normals[0].tolist()
    (6.0, [0.0, 0.0, 1.0])
    >>> round(Mesh.sphere((0, 0, 0), 1.0).volume_m3, 1)
    4.2
    """

    vertices_m: FloatArray
    faces: Int32Array
    uv: FloatArray | None = None

    @classmethod
    def rectangle(cls, corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike) -> Self:
        """Return a parallelogram, whose front is where edge_u × edge_v points to.

        Parameters
        ----------
        corner_m
            One corner in m.
        edge_u_m, edge_v_m
            Edges from it in m; texture coordinates rise along them.
        """
        corner, u, v = (
            np.asarray(each, dtype=np.float64) for each in (corner_m, edge_u_m, edge_v_m)
        )
        vertices = np.array([corner, corner + u, corner + u + v, corner + v])
        faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
        return cls(vertices, faces, np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64))

    @classmethod
    def disk(cls, centre_m: ArrayLike, normal: ArrayLike, radius_m: float, parts: int = 96) -> Self:
        """Return a disk, as a polygon of the same area.

        Parameters
        ----------
        centre_m
            Centre in m.
        normal
            Direction of its front.
        radius_m
            Radius in m.
        parts
            Corners of the polygon.
        """
        first, second, _ = frame(np.asarray(normal, dtype=np.float64))
        angle = np.arange(parts) * 2 * np.pi / parts
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        radius = radius_m * np.sqrt(2 * np.pi / parts / np.sin(2 * np.pi / parts))
        centre = np.asarray(centre_m, dtype=np.float64)
        vertices = np.vstack([centre, centre + radius * ring @ np.array([first, second])])
        around = np.arange(parts) + 1
        faces = np.stack([np.zeros(parts, int), around, np.roll(around, -1)], axis=1)
        uv = np.vstack([[0.5, 0.5], 0.5 + 0.5 * ring])
        return cls(vertices, faces.astype(np.int32), uv)

    @classmethod
    def box(
        cls, centre_m: ArrayLike, size_m: ArrayLike, turned_deg: float = 0.0, inward: bool = False
    ) -> Self:
        """Return a box, whose sides lie side by side in the texture, three by two.

        Parameters
        ----------
        centre_m
            Centre in m.
        size_m
            Lengths of its edges in m.
        turned_deg
            Turn about the vertical, in degrees.
        inward
            Whether its front is inside, as of a room.
        """
        half = np.asarray(size_m, dtype=np.float64) / 2
        turn = rotation(np.array([0.0, 0.0, 1.0]), turned_deg)
        vertices, faces, uv = [], [], []
        for number, (axis, side) in enumerate(
            (axis, side) for axis in range(3) for side in (1, -1)
        ):
            u, v = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]]
            if side < 0:
                u, v = v, u
            normal = side * np.eye(3)[axis]
            corners = [normal - u - v, normal + u - v, normal + u + v, normal - u + v]
            column, row = number % 3, number // 3
            vertices += [turn @ (half * corner) for corner in corners]
            uv += [((column + s) / 3, (row + t) / 2) for s, t in ((0, 0), (1, 0), (1, 1), (0, 1))]
            faces += [[4 * number + k for k in triangle] for triangle in ((0, 1, 2), (0, 2, 3))]
        mesh = cls(
            np.array(vertices) + np.asarray(centre_m, dtype=np.float64),
            np.array(faces, dtype=np.int32),
            np.array(uv),
        )
        return mesh.turned_over() if inward else mesh

    @classmethod
    def sphere(
        cls, centre_m: ArrayLike, radius_m: float, rows: int = 48, inward: bool = False
    ) -> Self:
        """Return a sphere of rows of triangles, of the same area.

        Parameters
        ----------
        centre_m
            Centre in m.
        radius_m
            Radius in m.
        rows
            Number of rows from pole to pole; there are twice as many columns.
        inward
            Whether its front is inside.
        """
        polar, around = np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, 2 * rows + 1)
        polar, around = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
        unit = np.stack(
            [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=1
        )
        columns = 2 * rows + 1
        at = np.arange(rows * 2 * rows) // (2 * rows) * columns + np.arange(rows * 2 * rows) % (
            2 * rows
        )
        below = at + columns
        first = np.stack([at, below, below + 1], axis=1)
        second = np.stack([at, below + 1, at + 1], axis=1)
        is_pole = at // columns
        faces = np.vstack([first[is_pole < rows - 1], second[is_pole > 0]]).astype(np.int32)
        uv = np.stack([around / (2 * np.pi), 1 - polar / np.pi], axis=1)
        # Flat triangles within a sphere have less area than it: they are moved outwards.
        of_unit = cls(unit, faces, uv)
        radius = radius_m * np.sqrt(4 * np.pi / of_unit.area_m2)
        mesh = cls(np.asarray(centre_m, dtype=np.float64) + radius * unit, faces, uv)
        return mesh.turned_over() if inward else mesh

    @classmethod
    def grid(
        cls, corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, parts: int
    ) -> Self:
        """Return a parallelogram of many triangles, which can be deformed.

        Parameters
        ----------
        corner_m, edge_u_m, edge_v_m
            As of `rectangle`.
        parts
            Number of parts along each edge.
        """
        corner, u, v = (
            np.asarray(each, dtype=np.float64) for each in (corner_m, edge_u_m, edge_v_m)
        )
        row, column = np.divmod(np.arange((parts + 1) ** 2), parts + 1)
        uv = np.stack([column, row], axis=1) / parts
        corners = np.arange((parts + 1) ** 2)[(row < parts) & (column < parts)]
        across = corners + parts + 2
        faces = np.vstack(
            [
                np.stack([corners, corners + 1, across], axis=1),
                np.stack([corners, across, across - 1], axis=1),
            ]
        )
        return cls(corner + uv @ np.array([u, v]), faces.astype(np.int32), uv)

    @classmethod
    def octahedra(cls, centre_m: ArrayLike, radius_m: float) -> Self:
        """Return a small octahedron at each of some places, six vertices each.

        Parameters
        ----------
        centre_m
            Places in m, shape (n, 3).
        radius_m
            Distance of the vertices from them in m.
        """
        centres = np.asarray(centre_m, dtype=np.float64).reshape(-1, 3)
        corners = np.vstack([np.eye(3), -np.eye(3)])
        vertices = (centres[:, None] + radius_m * corners).reshape(-1, 3)
        faces = np.array(
            [
                [x, y, z] if (x + y + z) % 2 else [x, z, y]
                for x in (0, 3)
                for y in (1, 4)
                for z in (2, 5)
            ]
        )
        number = 6 * np.arange(len(centres))[:, None, None]
        return cls(vertices, (faces + number).reshape(-1, 3).astype(np.int32))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return several meshes as one.

        Parameters
        ----------
        parts
            The meshes.

        Raises
        ------
        UsageError
            Some have texture coordinates and some have none.
        """
        uvs = [part.uv for part in parts if part.uv is not None]
        if len(uvs) not in (0, len(parts)):
            raise UsageError(PARTLY_UNWRAPPED)
        first = np.cumsum([0, *(len(part.vertices_m) for part in parts)])
        faces = [part.faces + begin for part, begin in zip(parts, first, strict=False)]
        return cls(
            np.concatenate([np.empty((0, 3)), *(part.vertices_m for part in parts)]),
            np.concatenate([np.empty((0, 3)), *faces]).astype(np.int32),
            np.concatenate(uvs) if uvs else None,
        )

    @property
    def normals(self) -> FloatArray:
        """Unit normals of the triangles, zero of those without area, shape (m, 3)."""
        twice = self._twice_area_vectors()
        length = np.linalg.norm(twice, axis=1, keepdims=True)
        return np.asarray(twice / np.where(length > 0, length, 1.0))

    @property
    def areas_m2(self) -> FloatArray:
        """Areas of the triangles in m², shape (m,)."""
        return np.asarray(np.linalg.norm(self._twice_area_vectors(), axis=1) / 2)

    @property
    def area_m2(self) -> float:
        """Area of all triangles in m²."""
        return float(self.areas_m2.sum())

    @property
    def volume_m3(self) -> float:
        """Volume that a closed mesh encloses in m³, negative if its front is inside."""
        a, b, c = self.vertices_m[self.faces].swapaxes(0, 1)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    def solid_angle_sr(self, point_m: ArrayLike) -> float:
        """Return the solid angle of the triangles from a point, in sr.

        Triangles that turn their back to the point count as positive: a closed mesh with its front
        outside has 4π from within, one with its front inside −4π, and 0 from without (A. van
        Oosterom and J. Strackee, *The solid angle of a plane triangle*, 1983).

        Parameters
        ----------
        point_m
            The point in m, on none of the triangles.
        """
        corners = self.vertices_m[self.faces] - np.asarray(point_m, dtype=np.float64)
        a, b, c = corners.swapaxes(0, 1)
        length_a, length_b, length_c = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a)))
        below = length_a * length_b * length_c + ab * length_c + bc * length_a + ca * length_b
        return float(2 * np.arctan2(volume, below).sum())

    @property
    def is_closed(self) -> bool:
        """Whether each edge has a triangle on both sides, vertices at one place being one."""
        edges, back = self._edges()
        return bool(np.isin(back, edges).all())

    @property
    def is_turned_alike(self) -> bool:
        """Whether no two triangles run along an edge in the same direction, each alone there."""
        edges, back = self._edges()
        same_way, count = np.unique(edges, return_counts=True)
        return not bool((~np.isin(same_way[count == 2], back)).any())

    def pieces(self, most_at_edge: int | None = None) -> list[Self]:
        """Return the parts that share no edge, vertices at one place being one.

        Parameters
        ----------
        most_at_edge
            Number of triangles at an edge above which it parts them; None for any number.
        """
        faces = self._places_of_corners
        before = np.roll(faces, 1, axis=1)
        number = np.minimum(faces, before) * len(self.vertices_m) + np.maximum(faces, before)
        _, edge, count = np.unique(number, return_inverse=True, return_counts=True)
        edge = edge.reshape(-1)
        joins = (faces != before).ravel()
        if most_at_edge is not None:
            joins &= count[edge] <= most_at_edge
        # Triangles and edges are the nodes of one graph.
        ends = np.arange(len(faces)).repeat(3)[joins], len(faces) + edge[joins]
        n = len(faces) + len(count)
        graph = coo_array((np.ones(len(ends[0]), np.int8), ends), shape=(n, n))
        piece = connected_components(graph, directed=False)[1][: len(faces)]
        order = np.argsort(piece, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(piece[order])) + 1)
        return [replace(self, faces=self.faces[group]).without_loose_vertices() for group in groups]

    def without_loose_vertices(self) -> Self:
        """Return the mesh without the vertices that no triangle has."""
        used, faces = np.unique(self.faces, return_inverse=True)
        if len(used) == len(self.vertices_m):
            return self
        uv = None if self.uv is None else self.uv[used]
        return replace(
            self,
            vertices_m=self.vertices_m[used],
            faces=faces.reshape(-1, 3).astype(np.int32),
            uv=uv,
        )

    @cached_property
    def _places_of_corners(self) -> IntArray64:
        """Return a number for the place of each corner of the triangles, shape (m, 3)."""
        _, same = np.unique(np.round(self.vertices_m, 9), axis=0, return_inverse=True)
        return np.asarray(same.reshape(-1)[self.faces], dtype=np.int64)

    def _edges(self) -> tuple[IntArray64, IntArray64]:
        """Return a number for each edge of each triangle, and that of the way back along it."""
        faces = self._places_of_corners
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
        n = len(self.vertices_m)
        return edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]

    def turned_over(self) -> Self:
        """Return the mesh with its front on the other side."""
        return replace(self, faces=np.ascontiguousarray(self.faces[:, ::-1]))

    def _twice_area_vectors(self) -> FloatArray:
        a, b, c = self.vertices_m[self.faces].swapaxes(0, 1)
        return np.cross(b - a, c - a)


def frame(normal: FloatArray) -> FloatArray:
    """Return two directions across a direction, and the direction, as rows of length 1."""
    unit = normal / np.linalg.norm(normal)
    other = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = np.cross(other, unit)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(unit, first), unit])


def rotation(axis: FloatArray, angle_deg: float) -> FloatArray:
    """Return the matrix of a turn about an axis of length 1 (Rodrigues)."""
    angle = np.deg2rad(angle_deg)
    across = np.cross(np.eye(3), axis)
    return np.asarray(np.eye(3) - np.sin(angle) * across + (1 - np.cos(angle)) * across @ across)
