"""Polygons and strips of mesh files as triangles of the same corners."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.reproduce.transport.mesh import frame

IntArray = NDArray[np.int64]

#: Parts of the square of a polygon's size below which an area is a rounding error.
NO_AREA, CROSSED = 1e-12, 1e-6
#: Most corners of a polygon: the time to divide it grows with the square of their number.
MAX_POLYGON_CORNERS = 10_000


def triangles(
    places_m: FloatArray,
    lengths: IntArray,
    named: Callable[[int], str] = lambda number: f"face {number + 1}",
) -> IntArray:
    """Divide polygons into triangles, two fewer than each has corners.

    All corners are kept, those on straight edges too: a neighbour may have an edge of its own
    there. What is not flat is divided as it looks from its front.

    Parameters
    ----------
    places_m
        Places of the corners of all polygons, one polygon after the other, shape (n, 3).
    lengths
        Number of corners of each polygon, which follow each other around it.
    named
        Name of a polygon for a message, by its number from 0.

    Returns
    -------
    ndarray
        Corners of the triangles by their numbers, shape (m, 3).

    Raises
    ------
    UsageError
        A polygon has fewer than three corners or too many, or crosses itself.
    """
    if lengths.min(initial=3) < 3:
        number = int(np.argmin(lengths))
        raise UsageError(
            f"expected faces of three corners or more, got {lengths[number]} of {named(number)}"
        )
    if lengths.max(initial=3) > MAX_POLYGON_CORNERS:
        number = int(np.argmax(lengths))
        raise UsageError(
            f"expected faces of at most {MAX_POLYGON_CORNERS} corners, got {lengths[number]} of "
            f"{named(number)}; divide it into smaller faces"
        )
    first = np.cumsum(lengths) - lengths
    found = [np.empty((0, 3), np.int64)]
    for n in np.unique(lengths).tolist():
        polygons = np.flatnonzero(lengths == n)
        corners = first[polygons, np.newaxis] + np.arange(n)
        if n > 3:
            corners = _from_a_corner_that_sees_all(corners, places_m)
        fans = np.stack([np.broadcast_to(corners[:, :1], (len(corners), n - 2)),
                         corners[:, 1:-1], corners[:, 2:]], axis=2)  # fmt: skip
        if n > 3:
            for number in np.flatnonzero(~_sees_all(places_m[corners])).tolist():
                inner = _ears_cut(places_m[corners[number]], named(int(polygons[number])))
                fans[number] = corners[number][inner]
        found.append(fans.reshape(-1, 3))
    return np.concatenate(found)


def strip_triangles(n_corners: int) -> IntArray:
    """Return the corners of the triangles of a strip, each second one turned over (n − 2, 3)."""
    first = np.arange(max(n_corners - 2, 0))
    odd = first % 2
    return np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)


def _from_a_corner_that_sees_all(corners: IntArray, places_m: FloatArray) -> IntArray:
    """Return polygons of as many corners so that the first sees all others, where one does.

    Tried are the first two: of a concave quadrilateral, one of them does.
    """
    next_first = np.roll(corners, -1, axis=1)
    is_better = ~_sees_all(places_m[corners]) & _sees_all(places_m[next_first])
    return np.where(is_better[:, np.newaxis], next_first, corners)


def _sees_all(rings_m: FloatArray) -> NDArray[np.bool_]:
    """Return whether the first corner of each polygon sees all of it, of polygons (k, n, 3)."""
    spokes = rings_m[:, 1:] - rings_m[:, :1]
    twice = np.cross(spokes[:, :-1], spokes[:, 1:])
    area = np.linalg.norm(twice, axis=2).sum(axis=1)
    is_line = area <= NO_AREA * (spokes**2).sum(axis=2).max(axis=1)
    whole = twice.sum(axis=1)
    length = np.linalg.norm(whole, axis=1)
    front = whole / np.where(length > 0, length, 1.0)[:, np.newaxis]
    height = np.einsum("kij,kj->ki", twice, front)
    across = spokes - np.einsum("kij,kj->ki", spokes, front)[..., np.newaxis] * front[:, np.newaxis]
    dot = np.einsum("kij,kij->ki", across[:, :-1], across[:, 1:])
    # A spiral turns once more around the corner.
    turned = np.arctan2(height, dot).sum(axis=1)
    goes_on = (height >= -NO_AREA * area[:, np.newaxis]).all(axis=1) & (turned < 2 * np.pi - 1e-9)
    return np.asarray(is_line | (goes_on & (length > NO_AREA * area)))


def _ears_cut(ring_m: FloatArray, name: str) -> IntArray:
    """Return the triangles of one polygon that has hollows, shape (n − 2, 3)."""
    spokes = ring_m - ring_m[0]
    whole = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
    size = float((spokes**2).sum(axis=1).max())
    if np.linalg.norm(whole) > NO_AREA * size:
        flat = np.ascontiguousarray(spokes @ frame(whole)[:2].T / np.sqrt(size))
        cut = np.asarray(_manifold3d().triangulate([flat]), dtype=np.int64)
        a, b, c = flat[cut].swapaxes(0, 1)
        twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        if len(cut) == len(ring_m) - 2 and twice.min() > -CROSSED:
            return cut
    raise UsageError(
        f"expected faces that do not cross themselves, got {name}, which does or is far from "
        "flat; divide it into triangles"
    )


def _manifold3d() -> Any:
    try:
        import manifold3d
    except ModuleNotFoundError as error:
        raise UsageError(
            f"polygons with hollows need an extra ({error.name} is missing): "
            "pip install 'labrig[render]'"
        ) from None
    return manifold3d
