"""Compiled parts of tracing: where a ray arrived, where it goes next, and which lamps shine there.

Everything is in single precision, as Embree is.
"""

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, Int32Array

#: Kinds of lamps.
POINT, AREA, DISTANT, SKY = 0, 1, 2, 3
#: What a ray met that is no place: nothing, the back of a surface, and from there down the lamps.
NOTHING, BACK, FIRST_LAMP = -1, -2, -3
#: Part of the way to a lamp beyond which a surface is the lamp itself.
NEARLY = np.float32(0.9999)
COMPILED: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
}


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def locate(
    face: Int32Array,
    u: Float32Array,
    v: Float32Array,
    direction: Float32Array,
    chance: Float32Array,
    triangles: Float32Array,
    normals: Float32Array,
    uv: Float32Array,
    corner_place: Int32Array,
    surface_of_face: Int32Array,
    table: Int32Array,
    chart_of_face: Int32Array,
    chart_of_place: Int32Array,
    offset: np.float32,
    position: Float32Array,
    normal: Float32Array,
    place: Int32Array,
) -> None:
    """Write where rays arrived: position just above the surface, its normal, and the place.

    A place between texels or vertices is one of them by chance, as often as its weight says: the
    mean over many rays is the interpolated value. A texel of another chart, which is elsewhere on
    the surface, is none of them.

    Parameters
    ----------
    face, u, v
        Triangle of each ray and its coordinates there, -1 without one (n,).
    direction
        Directions of the rays (n, 3).
    chance
        Random numbers (n,) from 0 to 1.
    triangles, normals, uv, corner_place, surface_of_face, table, chart_of_face, chart_of_place
        The geometry.
    offset
        Distance in m by which a position is lifted off its surface.
    position, normal, place
        What is written; the place is `NOTHING`, `BACK` or a lamp where there is none.
    """
    for i in range(len(face)):
        f = face[i]
        if f < 0:
            place[i] = NOTHING
            continue
        b, c = u[i], v[i]
        a = np.float32(1) - b - c
        facing = np.float32(0)
        for k in range(3):
            facing += normals[f, k] * direction[i, k]
        row = table[surface_of_face[f]]
        if facing >= 0 and row[5] == 0:
            place[i] = BACK
            continue
        if row[4] >= 0:
            place[i] = FIRST_LAMP - row[4]
            continue
        side = np.float32(1) if facing < 0 else np.float32(-1)
        for k in range(3):
            normal[i, k] = side * normals[f, k]
            position[i, k] = (
                a * triangles[f, 0, k] + b * triangles[f, 1, k] + c * triangles[f, 2, k]
            ) + offset * normal[i, k]
        if row[0] == 0:
            place[i] = row[1]
        elif row[0] == 1:
            s = (a * uv[f, 0, 0] + b * uv[f, 1, 0] + c * uv[f, 2, 0]) * row[2]
            t = (a * uv[f, 0, 1] + b * uv[f, 1, 1] + c * uv[f, 2, 1]) * row[3]
            # Two numbers of one: the second is what is left of the first.
            many = chance[i] * np.float32(4096)
            column = math.floor(s - np.float32(0.5) + math.floor(many) / np.float32(4096))
            line = math.floor(t - np.float32(0.5) + (many - math.floor(many)))
            column = min(max(column, 0), row[2] - 1)
            line = min(max(line, 0), row[3] - 1)
            texel = row[1] + line * row[2] + column
            if chart_of_place[texel] != chart_of_face[f]:
                column = min(max(math.floor(s), 0), row[2] - 1)
                line = min(max(math.floor(t), 0), row[3] - 1)
                texel = row[1] + line * row[2] + column
            place[i] = texel
        elif chance[i] < a:
            place[i] = corner_place[f, 0]
        elif chance[i] < a + b:
            place[i] = corner_place[f, 1]
        else:
            place[i] = corner_place[f, 2]


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def scatter(
    position: Float32Array, normal: Float32Array, chance: Float32Array, direction: Float32Array
) -> None:
    """Write directions as a Lambertian surface scatters: as likely as their cosine.

    Parameters
    ----------
    position, normal
        Where rays begin, and the unit normals there (n, 3).
    chance
        Random numbers from 0 to 1 (n, 2).
    direction
        Directions of length 1, which are written (n, 3).
    """
    for i in range(len(position)):
        x, y, z = normal[i]
        sign = np.float32(math.copysign(1.0, z))
        # An orthonormal basis without branches (Duff et al., JCGT 6, 2017).
        a = np.float32(-1) / (sign + z)
        b = x * y * a
        radius = math.sqrt(chance[i, 0])
        angle = np.float32(2 * math.pi) * chance[i, 1]
        p, q = np.float32(radius * math.cos(angle)), np.float32(radius * math.sin(angle))
        h = np.float32(math.sqrt(max(np.float32(0), np.float32(1) - chance[i, 0])))
        direction[i, 0] = p * (np.float32(1) + sign * x * x * a) + q * b + h * x
        direction[i, 1] = p * sign * b + q * (sign + y * y * a) + h * y
        direction[i, 2] = -p * sign * x - q * y + h * z


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def towards_lamps(
    position: Float32Array,
    normal: Float32Array,
    chance: Float32Array,
    triangles: Float32Array,
    normals: Float32Array,
    kind: Int32Array,
    vector: Float32Array,
    first: Int32Array,
    faces: Int32Array,
    share: Float32Array,
    area: Float32Array,
    size: np.float32,
    to: Float32Array,
    factor: Float32Array,
) -> None:
    """Write ways to a point on each lamp, and the factor of its light if nothing is between.

    The radiance that a surface of matrix M returns of a lamp is M · factor · lamp, where `lamp` is
    an intensity (point), a radiance (area) or an irradiance (distant).

    Parameters
    ----------
    position, normal
        Points and unit normals there (n, 3).
    chance
        Random numbers from 0 to 1 (n, lamps, 2).
    triangles, normals
        The geometry.
    kind, vector
        Kinds of lamps, and their position in m or the direction to them (lamps, 3).
    first, faces, share, area
        Triangles of lamp l are `faces[first[l] : first[l + 1]]`, `share` the part of its `area` in
        m² up to the end of each.
    size
        A length in m beyond the scene, for lamps without a place.
    to
        Ways, which are written; their end is `NEARLY` the lamp (n, lamps, 3).
    factor
        Factors, which are written; zero where the lamp is below the horizon (n, lamps).
    """
    for i in range(len(position)):
        for lamp in range(len(kind)):
            factor[i, lamp] = np.float32(0)
            to[i, lamp, 0] = to[i, lamp, 1] = np.float32(0)
            to[i, lamp, 2] = np.float32(1)
            if kind[lamp] == 3:
                continue
            facing = np.float32(1)
            f = -1
            b = c = np.float32(0)
            if kind[lamp] == 1:
                low, high = first[lamp], first[lamp + 1]
                if low == high:
                    continue
                f_at = min(_first_not_below(share, low, high, chance[i, lamp, 0]), high - 1)
                before = share[f_at - 1] if f_at > low else np.float32(0)
                rest = (chance[i, lamp, 0] - before) / (share[f_at] - before)
                root = math.sqrt(min(max(rest, np.float32(0)), np.float32(1)))
                f = faces[f_at]
                b, c = root * (np.float32(1) - chance[i, lamp, 1]), root * chance[i, lamp, 1]
            way = np.empty(3, np.float32)
            square = np.float32(0)
            above = np.float32(0)
            for k in range(3):
                if kind[lamp] == 2:
                    way[k] = vector[lamp, k] * size
                elif kind[lamp] == 0:
                    way[k] = vector[lamp, k] - position[i, k]
                else:
                    way[k] = (
                        (np.float32(1) - b - c) * triangles[f, 0, k]
                        + b * triangles[f, 1, k]
                        + c * triangles[f, 2, k]
                        - position[i, k]
                    )
                square += way[k] * way[k]
                above += way[k] * normal[i, k]
            length = np.float32(math.sqrt(square))
            if above <= 0 or length == 0:
                continue
            if kind[lamp] == 1:
                facing = np.float32(0)
                for k in range(3):
                    facing -= way[k] * normals[f, k]
                if facing <= 0:
                    continue
                facing *= area[lamp] / length
            for k in range(3):
                to[i, lamp, k] = way[k]
            cosine = above / length
            if kind[lamp] == 2:
                factor[i, lamp] = cosine / np.float32(math.pi)
            else:
                factor[i, lamp] = cosine * facing / (np.float32(math.pi) * square)


@numba.njit(no_cpython_wrapper=True, **COMPILED)  # type: ignore[untyped-decorator]
def _first_not_below(values: Float32Array, low: int, high: int, wanted: np.float32) -> int:
    """Return where in the ascending `values[low:high]` the first is that is not below `wanted`."""
    while low < high:
        middle = (low + high) // 2
        if values[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def rasterised(corners: Float32Array, columns: int, rows: int) -> tuple[Int32Array, int]:
    """Return the triangle at each point of a grid over the texture, and how many have several.

    Parameters
    ----------
    corners
        Texture coordinates of triangles (m, 3, 2).
    columns, rows
        Size of the grid, whose points are the middles of its cells.

    Returns
    -------
    tuple
        Number of the triangle at each point, -1 without one (rows, columns); and the number of
        points that lie well inside of two triangles.
    """
    face_at = np.full((rows, columns), -1, np.int32)
    n_shared = 0
    inside = np.float32(0.01)
    for f in range(len(corners)):
        s, t = corners[f, :, 0] * columns, corners[f, :, 1] * rows
        det = (s[1] - s[0]) * (t[2] - t[0]) - (s[2] - s[0]) * (t[1] - t[0])
        if det == 0:
            continue
        # Functions of arrays take longer to compile than all of this.
        left = math.floor(min(s[0], s[1], s[2]) - 0.5)
        right = math.ceil(max(s[0], s[1], s[2]) - 0.5)
        low = math.floor(min(t[0], t[1], t[2]) - 0.5)
        high = math.ceil(max(t[0], t[1], t[2]) - 0.5)
        for row in range(max(low, 0), min(high + 1, rows)):
            for column in range(max(left, 0), min(right + 1, columns)):
                x, y = column + np.float32(0.5) - s[0], row + np.float32(0.5) - t[0]
                b = (x * (t[2] - t[0]) - y * (s[2] - s[0])) / det
                c = (y * (s[1] - s[0]) - x * (t[1] - t[0])) / det
                least = min(b, c, 1 - b - c)
                if least < 0:
                    continue
                if face_at[row, column] >= 0 and least > inside:
                    n_shared += 1
                face_at[row, column] = f
    return face_at, n_shared


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def located_in_texture(
    corners: Float32Array, face_at: Int32Array, uv: Float32Array, cell: Int32Array
) -> tuple[Int32Array, NDArray[np.float64]]:
    """Return the triangles in which points of the texture lie, and the weights of their corners.

    Near an edge a point may lie in the triangle of a neighbouring cell of the grid. One beside all
    triangles that are near is moved onto that of its own cell.

    Parameters
    ----------
    corners
        Texture coordinates of triangles (m, 3, 2).
    face_at
        Triangle at each point of the grid, from `rasterised` (rows, columns).
    uv, cell
        Points (n, 2), and row and column of the cell of the grid of each (n, 2), which has a
        triangle; by rounding the point may lie just beside it.

    Returns
    -------
    tuple
        Numbers of triangles (n,) and weights (n, 3).
    """
    rows, columns = face_at.shape
    faces = np.empty(len(uv), np.int32)
    weights = np.empty((len(uv), 3))
    near = ((0, 0), (0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1))
    for i in range(len(uv)):
        row, column = cell[i, 0], cell[i, 1]
        for k in range(len(near) + 1):
            # The last one is the triangle of the own cell again.
            down, right = near[k % len(near)]
            at_row, at_column = row + down, column + right
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                continue
            f = face_at[at_row, at_column]
            if f < 0:
                continue
            s, t = corners[f, :, 0], corners[f, :, 1]
            x, y = uv[i, 0] - s[0], uv[i, 1] - t[0]
            det = (s[1] - s[0]) * (t[2] - t[0]) - (s[2] - s[0]) * (t[1] - t[0])
            b = (x * (t[2] - t[0]) - y * (s[2] - s[0])) / det
            c = (y * (s[1] - s[0]) - x * (t[1] - t[0])) / det
            is_inside = min(b, c, 1 - b - c) >= -1e-5
            if is_inside or k == len(near):
                b, c, a = max(b, 0.0), max(c, 0.0), max(1 - b - c, 0.0)
                faces[i] = f
                weights[i, 0] = a / (a + b + c)
                weights[i, 1] = b / (a + b + c)
                weights[i, 2] = c / (a + b + c)
                break
    return faces, weights
