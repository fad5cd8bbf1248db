"""Paths through a scene, traced without any wavelength, and kept.

What a path meets does not depend on colours, on the levels of phosphors or on the brightness of
lamps: one set of paths serves all bands, all times and all parameters (see `folding`), until
something moves.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce.compiled import compiled
from labrig.reproduce.transport.geometry import Geometry
from labrig.reproduce.transport.lamp import LampTable

#: Positions are lifted off their surface by this part of the scene's size.
LIFT = 1e-5
#: Paths that are traced at once.
CHUNK = 1 << 16
#: Most vertices of a path that roulette ends: one in 10⁸ paths is longer.
LONGEST = 80
#: How often a ray that left a room between two triangles is tried anew.
TRIALS = 8


@dataclass(frozen=True)
class PathLength:
    """How paths end.

    Attributes
    ----------
    vertices
        Vertices that every path has, at least 1.
    survival
        Probability to go on after each later one (Russian roulette), 0 to below 1. The light of
        those that go on counts the more, so that the mean stays that of endless paths; 0 ends all
        paths there, and what comes later is missing.
    """

    vertices: int = 4
    survival: float = 0.75

    def __post_init__(self) -> None:
        if self.vertices < 1 or not 0 <= self.survival < 1:
            raise UsageError(
                "expected one or more vertices and a survival from 0 to below 1, got "
                f"{self.vertices} and {self.survival:g}"
            )

    @property
    def mean_vertices(self) -> float:
        """Number of vertices of a path that never leaves the scene, on average."""
        return self.vertices + self.survival / (1 - self.survival)

    def nbytes(self, n_paths: int, n_lamps: int) -> int:
        """Return the memory of so many kept paths in a closed scene, in bytes."""
        of_path, of_vertex = 10, 8 + 4 * n_lamps
        return round(n_paths * (of_path + of_vertex * self.mean_vertices))


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths from a number of places, several for each, vertices one after another.

    Attributes
    ----------
    per_target
        Number of paths for each pixel or place.
    first
        First vertex of each path, and the end of the last one, shape (paths + 1,).
    place
        Place of each vertex (n,); -1 is black.
    weight
        Weight of the light that comes from the next vertex, shape (n,).
    light
        Factor of the light of each lamp at each vertex, shape (n, lamps).
    seen_lamp
        Lamp that a path sees before it meets any surface, -1 for none, shape (paths,).
    n_escaped
        Rays that left a room between its triangles, and were traced again.
    """

    per_target: int
    first: NDArray[np.int64]
    place: Int32Array
    weight: Float32Array
    light: Float32Array
    seen_lamp: NDArray[np.int16]
    n_escaped: int = 0

    @property
    def nbytes(self) -> int:
        """Memory of the paths in bytes."""
        arrays = (self.first, self.place, self.weight, self.light, self.seen_lamp)
        return sum(each.nbytes for each in arrays)

    @property
    def n_targets(self) -> int:
        """Number of pixels or places."""
        return (len(self.first) - 1) // self.per_target

    @property
    def first_places(self) -> Int32Array:
        """Place that each path meets first; -1 is black or nothing, -2 - n lamp n (paths,)."""
        found = np.full(len(self.first) - 1, -1, np.int32)
        meets = self.first[1:] > self.first[:-1]
        found[meets] = self.place[self.first[:-1][meets]]
        return np.where(self.seen_lamp >= 0, -2 - self.seen_lamp, found).astype(np.int32)


@dataclass(frozen=True)
class Pinhole:
    """A camera without a lens.

    Attributes
    ----------
    position_m, look_at_m
        Where it is, and a point in the middle of its picture, in m.
    up
        Direction that is upwards in the picture.
    vertical_fov_deg
        Angle from the lower to the upper edge, in degrees.
    width_px, height_px
        Size of the picture.

    Raises
    ------
    UsageError
        The angle or the size is none, or it looks at its own place or along `up`.

    Examples
    --------
    >>> from labrig.reproduce import Pinhole
    >>> Pinhole((0, 0, 1), (0, 0, 0), up=(0, 1, 0)).axes.round().tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """

    position_m: tuple[float, float, float]
    look_at_m: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    vertical_fov_deg: float = 40.0
    width_px: int = 256
    height_px: int = 256

    def __post_init__(self) -> None:
        if not 0 < self.vertical_fov_deg < 180:
            raise UsageError(
                f"expected an angle of view from 0 to 180°, got {self.vertical_fov_deg:g}°"
            )
        if self.width_px < 1 or self.height_px < 1:
            raise UsageError(f"expected a size in pixels, got {self.width_px} × {self.height_px}")
        away = np.subtract(self.position_m, self.look_at_m)
        length = np.linalg.norm(away) * np.linalg.norm(self.up)
        if not np.linalg.norm(np.cross(self.up, away)) > 1e-9 * length:
            raise UsageError(
                "expected a camera that looks at another point than its own, and not upwards, got "
                f"position {list(self.position_m)}, look_at {list(self.look_at_m)}"
            )

    @property
    def axes(self) -> FloatArray:
        """Unit vectors to the right, upwards and backwards in the picture, the rows of (3, 3)."""
        backwards = np.subtract(self.position_m, self.look_at_m)
        backwards = backwards / np.linalg.norm(backwards)
        right = np.cross(self.up, backwards)
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(backwards, right), backwards])

    def rays(
        self, pixels: Int32Array, within: FloatArray, origin_m: FloatArray
    ) -> tuple[Float32Array, Float32Array]:
        """Return origins and unit directions of rays.

        Parameters
        ----------
        pixels
            Numbers of pixels, row by row from the upper left (n,).
        within
            Where in each pixel, 0 to 1 from its upper left corner (n, 2).
        origin_m
            Point from which origins are measured, in m (3,).
        """
        eye = np.array(self.position_m, dtype=np.float64)
        right, up, backwards = self.axes
        half = np.tan(np.deg2rad(self.vertical_fov_deg) / 2)
        row, column = np.divmod(pixels, self.width_px)
        x = (2 * (column + within[:, 0]) - self.width_px) / self.height_px * half
        y = (1 - 2 * (row + within[:, 1]) / self.height_px) * half
        direction = x[:, None] * right + y[:, None] * up - backwards
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        begin = np.broadcast_to((eye - origin_m).astype(np.float32), direction.shape)
        return np.ascontiguousarray(begin), direction.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Met:
    """Points at which rays arrive.

    Attributes
    ----------
    position, normal
        Points in m from the origin of the geometry, and unit normals there, shape (n, 3).
    place
        Places (n,); negative of a lamp, or of nothing.
    """

    position: Float32Array
    normal: Float32Array
    place: Int32Array

    def of(self, rays: NDArray[np.integer[Any]]) -> "Met":
        """Return where some of the rays arrive."""
        return Met(self.position[rays], self.normal[rays], self.place[rays])


class Tracer:
    """Traces paths in one arrangement of surfaces and lamps.

    Parameters
    ----------
    geometry
        Surfaces.
    lamps
        Lamps.
    length
        How paths end.
    seed
        Beginning of the random numbers: the same seed gives the same paths, whatever the number of
        threads.

    Raises
    ------
    UsageError
        The extra `labrig[render]` is missing.
    """

    def __init__(
        self, geometry: Geometry, lamps: LampTable, length: PathLength, seed: int = 1
    ) -> None:
        self._geometry, self._lamps, self._length, self._seed = geometry, lamps, length, seed
        self._kernels = compiled("transport.tracing_kernels")
        self._scene = _embree_scene(geometry.triangles)
        self._sky = (
            int(np.argmax(lamps.kind == self._kernels.SKY))
            if (lamps.kind == self._kernels.SKY).any()
            else -1
        )

    def from_camera(self, camera: Pinhole, per_pixel: int, threads: int) -> Iterator[Paths]:
        """Trace paths from the pixels of a camera.

        Parameters
        ----------
        camera
            The camera.
        per_pixel
            Paths for each pixel.
        threads
            Threads that trace at the same time.

        Yields
        ------
        Paths
            Of some pixels each, in order.
        """
        at_once = max(1, CHUNK // per_pixel)
        n_pixels = camera.width_px * camera.height_px
        is_inside = self._geometry.is_room_around(camera.position_m)

        def part(number: int) -> Paths:
            chosen = np.arange(number * at_once, min((number + 1) * at_once, n_pixels))
            pixels = np.repeat(chosen, per_pixel).astype(np.int32)
            rng = np.random.default_rng((self._seed, 0, number))
            even = _even(len(chosen), per_pixel, 4 + 2 * len(self._lamps), rng)

            def rays(within: Float32Array, of: Int32Array) -> tuple[Float32Array, Float32Array]:
                where = within.astype(np.float64)
                return camera.rays(of, where, self._geometry.origin_m)

            def elsewhere(lost: NDArray[np.intp]) -> Float32Array:
                return rays(rng.random((len(lost), 2), np.float32), pixels[lost])[1]

            origin, direction = rays(even[:, :2], pixels)
            met = self._meet(origin, direction, rng)
            n_escaped = self._again(origin, elsewhere, met, rng) if is_inside else 0
            return self._seen(met, per_pixel, even[:, 2:], rng, n_escaped)

        yield from _in_threads(part, -(-n_pixels // at_once), threads)

    def from_surface(self, surface: int, per_place: int, threads: int) -> Iterator[Paths]:
        """Trace paths from all places of a surface; their first vertex is the place itself.

        From a two-sided one every other path begins at its back: the sum over both sides is twice
        the mean.

        Parameters
        ----------
        surface
            Number of the surface.
        per_place
            Paths for each place.
        threads
            Threads that trace at the same time.

        Yields
        ------
        Paths
            Of some places each, in order; places that do not lie on the surface have none.
        """
        geometry = self._geometry
        starts = geometry.start_points(surface)
        first_face = np.searchsorted(geometry.surface_of_face, surface).astype(np.int32)
        at_once = max(1, CHUNK // per_place)

        def part(number: int) -> Paths:
            chosen = slice(number * at_once, (number + 1) * at_once)
            places = starts.places[chosen]
            rng = np.random.default_rng((self._seed, 1, surface, number))
            even = _even(len(places), per_place, 4 + 2 * len(self._lamps), rng)
            scattered = even[:, :2].reshape(len(places), per_place, 2).astype(np.float64)
            face, weights = starts.at(chosen, scattered, rng)
            face += first_face
            position = np.einsum("nk,nkc->nc", weights, geometry.triangles[face])
            normal = geometry.normals[face]
            if geometry.surfaces[surface].is_two_sided:
                side = rng.integers(0, 2, (len(places), 1)) + np.arange(per_place)
                normal[side.ravel() % 2 == 1] *= -1
            places = places + geometry.places_of(surface).start
            return self._walk(
                Met(
                    position.astype(np.float32) + np.float32(LIFT * geometry.size_m) * normal,
                    normal,
                    places.astype(np.int32).repeat(per_place),
                ),
                np.full(len(normal), -1, np.int16),
                per_place,
                even[:, 2:],
                rng,
            )

        yield from _in_threads(part, -(-len(starts.places) // at_once), threads)

    def _seen(
        self,
        met: "Met",
        per_target: int,
        even: Float32Array,
        rng: np.random.Generator,
        n_escaped: int,
    ) -> Paths:
        """Follow paths from where their first rays arrived."""
        is_lamp = met.place <= self._kernels.FIRST_LAMP
        seen = np.where(is_lamp, self._kernels.FIRST_LAMP - met.place, -1)
        if self._sky >= 0:
            seen = np.where(met.place == self._kernels.NOTHING, self._sky, seen)
        return self._walk(met, seen.astype(np.int16), per_target, even, rng, n_escaped)

    def _walk(
        self,
        first: "Met",
        seen: NDArray[np.int16],
        per_target: int,
        even: Float32Array,
        rng: np.random.Generator,
        n_escaped: int = 0,
    ) -> Paths:
        """Follow paths from their first vertices to their ends."""
        n_paths, lamps = len(first.place), len(self._lamps)
        path = np.flatnonzero(first.place >= 0).astype(np.int32)
        here, even = first.of(path), even[path]
        depths: list[tuple[Int32Array, Int32Array, Float32Array, Float32Array]] = []
        depth = 0
        while len(path):
            chance = even if depth == 0 else rng.random((len(path), 2 + 2 * lamps), np.float32)
            light = self._light(here.position, here.normal, chance[:, 2:])
            weight = np.ones(len(path), np.float32)
            depths.append((path, here.place, weight, light))
            depth += 1
            goes_on = np.ones(len(path), bool)
            if depth >= self._length.vertices:
                survival = 0.0 if depth >= LONGEST else self._length.survival
                goes_on = rng.random(len(path), np.float32) < survival
                weight[:] = 1 / survival if survival else 0.0
            on = np.flatnonzero(goes_on)
            here = here.of(on)
            met = self._meet(here.position, self._scattered(here, chance[on, :2]), rng)
            if self._geometry.is_room:
                n_escaped += self._again(
                    here.position, partial(self._scattered_anew, here, rng), met, rng
                )
            if self._sky >= 0:
                away = on[met.place == self._kernels.NOTHING]
                light[away, self._sky] += weight[away]
            arrived = np.flatnonzero(met.place >= 0)
            path, here = path[on[arrived]], met.of(arrived)
        return _in_order(n_paths, per_target, seen, depths, lamps, n_escaped)

    def _scattered(self, here: "Met", chance: Float32Array) -> Float32Array:
        """Return directions into which light is scattered (n, 3)."""
        direction = np.empty((len(here.place), 3), np.float32)
        self._kernels.scatter(here.position, here.normal, np.ascontiguousarray(chance), direction)
        return direction

    def _scattered_anew(
        self, here: "Met", rng: np.random.Generator, lost: NDArray[np.intp]
    ) -> Float32Array:
        return self._scattered(here.of(lost), rng.random((len(lost), 2), np.float32))

    def _meet(
        self, origin: Float32Array, direction: Float32Array, rng: np.random.Generator
    ) -> "Met":
        """Return where rays arrive."""
        geometry = self._geometry
        n = len(origin)
        met = Met(np.empty((n, 3), np.float32), np.empty((n, 3), np.float32), np.empty(n, np.int32))
        if n:
            hit = self._scene.run(origin, direction, output=True)
            self._kernels.locate(
                hit["primID"], hit["u"], hit["v"], direction, rng.random(n, np.float32),
                geometry.triangles, geometry.normals, geometry.uv, geometry.corner_place,
                geometry.surface_of_face, geometry.table, geometry.chart_of_face,
                geometry.chart_of_place, np.float32(LIFT * geometry.size_m),
                met.position, met.normal, met.place,
            )  # fmt: skip
        return met

    def _again(
        self,
        origin: Float32Array,
        directions: Callable[[NDArray[np.intp]], Float32Array],
        met: "Met",
        rng: np.random.Generator,
    ) -> int:
        """Trace rays anew, in other directions, that left the room between its triangles.

        What they meet is put into `met`; their number is returned.
        """
        n_escaped = 0
        for _ in range(TRIALS):
            lost = np.flatnonzero(met.place == self._kernels.NOTHING)
            if not len(lost):
                break
            n_escaped += len(lost)
            found = self._meet(origin[lost], directions(lost), rng)
            met.position[lost], met.normal[lost] = found.position, found.normal
            met.place[lost] = found.place
        return n_escaped

    def _light(
        self, position: Float32Array, normal: Float32Array, chance: Float32Array
    ) -> Float32Array:
        """Return the factor of each lamp at points, shape (n, lamps)."""
        lamps, geometry, n = self._lamps, self._geometry, len(position)
        factor = np.zeros((n, len(lamps)), np.float32)
        if not len(lamps):
            return factor
        to = np.empty((n, len(lamps), 3), np.float32)
        self._kernels.towards_lamps(
            position, normal, np.ascontiguousarray(chance).reshape(n, len(lamps), 2),
            geometry.triangles, geometry.normals, lamps.kind, lamps.vector, lamps.first,
            lamps.faces, lamps.share, lamps.area, np.float32(2 * geometry.size_m), to, factor,
        )  # fmt: skip
        for lamp in range(len(lamps)):
            reaches = np.flatnonzero(factor[:, lamp])
            if not len(reaches):
                continue
            hidden = self._scene.run(
                np.ascontiguousarray(position[reaches]),
                np.ascontiguousarray(to[reaches, lamp]),
                np.full(len(reaches), self._kernels.NEARLY, np.float32),
                query="OCCLUDED",
            )
            factor[reaches[hidden >= 0], lamp] = 0.0
        return factor


def _in_order(
    n_paths: int,
    per_target: int,
    seen: NDArray[np.int16],
    depths: list[tuple[Int32Array, Int32Array, Float32Array, Float32Array]],
    lamps: int,
    n_escaped: int,
) -> Paths:
    """Return what was recorded depth by depth, path by path."""
    n_vertices = np.zeros(n_paths, np.int64)
    for path, *_ in depths:
        n_vertices[path] += 1
    first = np.zeros(n_paths + 1, np.int64)
    np.cumsum(n_vertices, out=first[1:])
    place, weight = np.empty(first[-1], np.int32), np.empty(first[-1], np.float32)
    light = np.empty((first[-1], lamps), np.float32)
    for depth, (path, own_place, own_weight, own_light) in enumerate(depths):
        at = first[path] + depth
        place[at], weight[at], light[at] = own_place, own_weight, own_light
    return Paths(per_target, first, place, weight, light, seen, n_escaped)


def _even(targets: int, per_target: int, dimensions: int, rng: np.random.Generator) -> Float32Array:
    """Return points from 0 to 1 that are spread evenly for each target, each set shifted by chance.

    An additive sequence of the roots of xᵈ⁺¹ = x + 1 (M. Roberts, 2018), shape (targets ·
    per_target, dimensions).
    """
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = (1 / root ** np.arange(1, dimensions + 1)) % 1
    points = np.arange(per_target)[:, None] * steps
    shifts = rng.random((targets, 1, dimensions))
    shifted = ((points + shifts) % 1).astype(np.float32).reshape(-1, dimensions)
    return np.minimum(shifted, np.float32(1 - 2**-24))


def _in_threads(part: Callable[[int], Paths], n_parts: int, threads: int) -> Iterator[Paths]:
    if threads < 2 or n_parts < 2:
        yield from map(part, range(n_parts))
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="paths") as pool:
        yield from pool.map(part, range(n_parts))


def _embree_scene(triangles: Float32Array) -> Any:
    """Return Embree's scene of triangles, built."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise UsageError(
            "labrig render needs Embree, whose package embreex is missing or does not load "
            f"({error}): pip install 'labrig[render]', on Linux (x86-64), Windows or macOS 13 on"
        ) from None
    scene = EmbreeScene()
    TriangleMesh(scene, triangles)
    # It is built by the first ray, and before threads use it.
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene
