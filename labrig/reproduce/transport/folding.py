"""Light along kept paths, from the far end: L = glow + M (direct · lamps + L of the next).

Of kept paths in three channels: light that comes from a vertex to the camera was changed by the
materials before it on the path; in most scenes few have a colour. So paths are sorted by the
coloured materials that they pass. Of each such sequence the three channels by the light in the
bands are found once, and a vertex takes one product instead of one for each band and vertex before
it. The picture is that of `fold`, but for rounding.
"""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, FloatArray, Int32Array
from labrig.reproduce.compiled import compiled
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.tracing import Paths


@dataclass(frozen=True, eq=False)
class Matrices:
    """Matrices of all materials of a scene, as the compiled function takes them.

    Attributes
    ----------
    values
        Matrices, transposed so that what one band gives to all others lies side by side, shape
        (materials, bands in, bands out).
    first, last
        Range of the bands out that each band in gives to, shape (materials, bands in).
    is_diagonal
        Whether light keeps its wavelength, shape (materials,).
    """

    values: Float32Array
    first: Int32Array
    last: Int32Array
    is_diagonal: NDArray[np.bool_]

    @classmethod
    def of(cls, materials: Sequence[SurfaceMaterial]) -> Self:
        """Put the matrices of materials together."""
        values = np.stack([material.matrix.T for material in materials]).astype(np.float32)
        given = values != 0
        any_given = given.any(axis=2)
        last = np.where(any_given, values.shape[2] - np.argmax(given[:, :, ::-1], axis=2), 0)
        return cls(
            np.ascontiguousarray(values),
            np.where(any_given, np.argmax(given, axis=2), 0).astype(np.int32),
            last.astype(np.int32),
            np.array([material.is_diagonal for material in materials]),
        )


def fold(
    paths: Iterable[Paths],
    matrices: Matrices,
    material_of_place: Int32Array,
    glow: Float32Array,
    lamps: Float32Array,
    threads: int,
    *,
    albedo_factor: Float32Array | None = None,
    incident: bool = False,
) -> Float32Array:
    """Return the light of kept paths, the mean for each pixel or place.

    Parameters
    ----------
    paths
        Paths, of consecutive pixels or places.
    matrices
        Matrices of the materials.
    material_of_place
        Number of the material of each place, -1 for black (places,).
    glow
        Radiance that each place emits by itself, shape (places, bands).
    lamps
        Light of each lamp, see `Lamp`, shape (lamps, bands).
    threads
        Threads that fold at the same time.
    albedo_factor
        Factor of what the material of each place returns, shape (places,); None for 1 everywhere.
    incident
        Whether the irradiance at the first vertices is wanted, in W m⁻² nm⁻¹, instead of the
        radiance from them in W m⁻² sr⁻¹ nm⁻¹.

    Returns
    -------
    ndarray
        Light of each pixel or place (targets, bands).

    Examples
    --------
    A room whose walls glow and return half of the light is twice as bright as its glow.

    >>> import numpy as np
    >>> from labrig.reproduce import (
    ...     Bands, Geometry, LampTable, Matrices, Mesh, PathLength, Pinhole, Surface, Tracer, fold,
    ...     of_albedo,
    ... )
    >>> room = Geometry.of([Surface("room", Mesh.box((0, 0, 0), (2, 3, 2), inward=True), 0)])
    >>> tracer = Tracer(room, LampTable.of([], room), PathLength(40, survival=0.0))
    >>> camera = Pinhole((0, 0, 0), (1, 0, 0), width_px=2, height_px=2)
    >>> paths = list(tracer.from_camera(camera, per_pixel=1, threads=1))
    >>> walls = Matrices.of([of_albedo("grey", 0.5, Bands.even(400, 700, 3))])
    >>> no_lamps = np.zeros((0, 3), np.float32)
    >>> glow = np.ones((1, 3), np.float32)
    >>> fold(paths, walls, room.material_of_place, glow, no_lamps, 1)[0].tolist()
    [2.0, 2.0, 2.0]
    """
    fold_paths = compiled("transport.folding_kernels").fold_paths
    if albedo_factor is None:
        albedo_factor = np.ones(len(material_of_place), np.float32)
    arguments = (
        matrices.values, matrices.first, matrices.last, matrices.is_diagonal,
        np.ascontiguousarray(material_of_place, dtype=np.int32),
        np.ascontiguousarray(albedo_factor, dtype=np.float32),
        np.ascontiguousarray(glow, dtype=np.float32),
        np.ascontiguousarray(lamps, dtype=np.float32), incident,
    )  # fmt: skip

    def part(own: Paths) -> Float32Array:
        light = np.empty((own.n_targets, glow.shape[1]), np.float32)
        fold_paths(
            own.per_target, own.first, own.place, own.weight, own.light, own.seen_lamp,
            *arguments, light,
        )  # fmt: skip
        return light

    if threads < 2:
        return np.concatenate([part(own) for own in paths])
    paths = list(paths)
    # A thread takes longer to start than a small part to fold.
    if len(paths) < 2:
        return np.concatenate([part(own) for own in paths])
    with ThreadPoolExecutor(threads, thread_name_prefix="fold") as pool:
        return np.concatenate(list(pool.map(part, paths)))


#: Sequences of coloured materials that are told apart.
MAX_SEQUENCES = 30_000
#: Relative difference of the albedo of two bands that is no colour.
GREY = 1e-6


@dataclass(frozen=True, eq=False)
class Sequences:
    """Sequences of coloured materials on the way from the camera to each vertex of paths.

    Attributes
    ----------
    grey
        Albedo of each material that is grey, 0 of others, shape (materials,).
    number
        Number of each coloured material among them, -1 of grey ones, shape (materials,).
    child
        Sequence that follows another by a coloured material, -1 of none (sequences, coloured).
    of_vertex
        Sequence before each vertex, for each of the paths.
    carried
        Factor of the light from each vertex by weights and grey materials, for each of the paths.
    """

    grey: Float32Array
    number: Int32Array
    child: Int32Array
    of_vertex: tuple[Int32Array, ...]
    carried: tuple[Float32Array, ...]

    @classmethod
    def of(
        cls,
        paths: Sequence[Paths],
        materials: Sequence[SurfaceMaterial],
        material_of_place: Int32Array,
    ) -> Self | None:
        """Return the sequences of paths; None if there are too many to be kept.

        Materials with states count as coloured, whatever their albedo, which may change.
        """
        grey, number = greys(materials)
        kernel = compiled("transport.folding_kernels").sequences
        child = np.full((MAX_SEQUENCES, int(number.max()) + 1), -1, np.int32)
        found, carried, count = [], [], 1
        for own in paths:
            found.append(np.zeros(len(own.place), np.int32))
            carried.append(np.zeros(len(own.place), np.float32))
            count = kernel(
                own.per_target, own.first, own.place, own.weight, material_of_place, grey, number,
                child, count, found[-1], carried[-1],
            )  # fmt: skip
            if count < 0:
                return None
        return cls(grey, number, child[:count], tuple(found), tuple(carried))

    def fit(self, materials: Sequence[SurfaceMaterial]) -> bool:
        """Return whether they are those of materials, too."""
        grey, number = greys(materials)
        return bool((grey == self.grey).all() and (number == self.number).all())

    def colours(self, materials: Sequence[SurfaceMaterial], to_rgb: FloatArray) -> Float32Array:
        """Return the channels by the bands at the end of each sequence (sequences, 3, bands)."""
        coloured = np.flatnonzero(self.number >= 0)
        found = np.empty((len(self.child), *to_rgb.shape), np.float32)
        level, found[0] = np.zeros(1, np.int64), to_rgb
        while len(level):
            later = []
            for column, material in enumerate(coloured.tolist()):
                next_ = self.child[level, column]
                is_there = next_ >= 0
                found[next_[is_there]] = found[level[is_there]] @ materials[material].matrix
                later.append(next_[is_there])
            level = np.concatenate([*later, np.zeros(0, np.int32)])
        return found


def greys(materials: Sequence[SurfaceMaterial]) -> tuple[Float32Array, Int32Array]:
    """Return the albedo of grey materials (materials,), and numbers of the others (materials,)."""
    grey = np.zeros(len(materials), np.float32)
    number = np.full(len(materials), -1, np.int32)
    count = 0
    for index, material in enumerate(materials):
        diagonal = np.diagonal(material.matrix)
        is_even = np.ptp(diagonal) <= GREY * diagonal.max()
        if material.parameters is None and material.is_diagonal and is_even:
            grey[index] = diagonal[0]
        else:
            number[index] = count
            count += 1
    return grey, number


def colour_fold(
    paths: Sequence[Paths],
    sequences: Sequences,
    materials: Sequence[SurfaceMaterial],
    material_of_place: Int32Array,
    glow: Float32Array,
    lamps: Float32Array,
    to_rgb: FloatArray,
    threads: int,
) -> Float32Array:
    """Return three channels of the light of kept paths, the mean for each pixel.

    Parameters
    ----------
    paths, sequences
        Paths of the camera, and what they pass.
    materials, material_of_place
        Materials, and the number of that of each place, -1 for black (places,).
    glow
        Radiance that each place emits by itself, shape (places, bands).
    lamps
        Light of each lamp, shape (lamps, bands).
    to_rgb
        Channels by the light in the bands, shape (3, bands).
    threads
        Threads that fold at the same time.

    Returns
    -------
    ndarray
        Channels of each pixel (targets, 3).
    """
    kernel = compiled("transport.folding_kernels").fold_colours
    colours = sequences.colours(materials, to_rgb)
    is_on = lamps.any(axis=1)
    of_lamps = np.ascontiguousarray(np.einsum("scb,lb->slc", colours, lamps), np.float32)
    arguments = (
        material_of_place, sequences.grey, sequences.number, sequences.child, colours,
        np.ascontiguousarray(glow, np.float32), glow.any(axis=1), of_lamps, is_on,
    )  # fmt: skip

    def part(number: int) -> Float32Array:
        own = paths[number]
        light = np.empty((own.n_targets, 3), np.float32)
        kernel(
            own.per_target, own.first, own.place, own.light, own.seen_lamp,
            sequences.of_vertex[number], sequences.carried[number], *arguments, light,
        )  # fmt: skip
        return light

    # A thread takes longer to start than a small part to fold.
    if threads < 2 or len(paths) < 2:
        return np.concatenate([part(number) for number in range(len(paths))])
    with ThreadPoolExecutor(threads, thread_name_prefix="fold") as pool:
        return np.concatenate(list(pool.map(part, range(len(paths)))))
