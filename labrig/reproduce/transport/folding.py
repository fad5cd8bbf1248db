"""Light along kept paths, from the far end: L = glow + M (direct · lamps + L of the next)."""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, Int32Array
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
