"""Paths in the arrangement of a scene at one time, and the light that they bring.

The paths of the camera and those of the places with states are traced when they are first needed.
"""

import os
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.ndimage import distance_transform_edt

from labrig.foundation.arrays import Float32Array, FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.folding import Sequences
from labrig.reproduce.transport.geometry import Surface
from labrig.reproduce.transport.lamp import LampTable
from labrig.reproduce.transport.tracing import Paths, Tracer

#: Part of the memory that paths and pictures may take, and copies of a picture at once.
MAX_PART, MAX_COPIES = 0.7, 6
#: Memory in bytes that tells where a texel lies on its surface.
OF_TEXEL = 300

#: Is told what is done, and which part of it is, 0 to 1.
Report: TypeAlias = Callable[[str, float], None]


class View:
    """Paths in the arrangement at one time.

    Parameters
    ----------
    scene
        The scene.
    t_s
        The time in s.
    threads
        Threads that trace.
    report
        Is told which part of the paths is traced.
    """

    def __init__(
        self, scene: Scene, t_s: float, threads: int, report: Report = lambda what, part: None
    ) -> None:
        self.t_s = t_s
        self.geometry = scene.geometry(t_s)
        self._scene, self._threads, self._report = scene, threads, report
        self._of_places: dict[int, list[Paths]] | None = None
        self._of_camera: list[Paths] = []
        self._sequences: Sequences | None = None
        self._has_many_sequences = False

    @cached_property
    def _tracer(self) -> Tracer:
        lamps = LampTable.of(self._scene.lamps(self.t_s), self.geometry)
        return Tracer(self.geometry, lamps, self._scene.path_length, self._scene.file.paths.seed)

    def of_camera(self) -> list[Paths]:
        """Return the paths of all pixels."""
        if not self._of_camera:
            per_pixel = self._scene.file.paths.per_pixel
            camera = self._scene.camera
            n_done, n_pixels = 0, camera.width_px * camera.height_px
            for paths in self._tracer.from_camera(camera, per_pixel, self._threads):
                self._of_camera.append(paths)
                n_done += paths.n_targets
                self._report("tracing paths of the picture", n_done / n_pixels)
        return self._of_camera

    def sequences(self, materials: Sequence[SurfaceMaterial]) -> Sequences | None:
        """Return the coloured materials that paths of pixels pass; None if there are too many."""
        if self._sequences is not None and not self._sequences.fit(materials):
            self._sequences = None
        if self._sequences is None and not self._has_many_sequences:
            of_place = self.geometry.material_of_place
            self._sequences = Sequences.of(self.of_camera(), materials, of_place)
            self._has_many_sequences = self._sequences is None
        return self._sequences

    def first_places(self, pixel: int) -> Int32Array:
        """Return the places that the paths of a pixel meet first, -2 - n of lamp n (paths,)."""
        for paths in self.of_camera():
            if pixel < paths.n_targets:
                own = slice(pixel * paths.per_target, (pixel + 1) * paths.per_target)
                return paths.first_places[own]
            pixel -= paths.n_targets
        raise AssertionError("a pixel within the picture")

    def seen_places(self) -> Int32Array:
        """Return the places that some path meets first, rising."""
        found = np.unique(np.concatenate([paths.first_places for paths in self.of_camera()]))
        return found[found >= 0]

    @property
    def _all(self) -> list[Paths]:
        of_places = (self._of_places or {}).values()
        return [*(each for parts in of_places for each in parts), *self._of_camera]

    @property
    def nbytes(self) -> int:
        """Memory of all paths in bytes."""
        return sum(each.nbytes for each in self._all)

    @property
    def n_rays(self) -> int:
        """Number of rays of all paths."""
        return sum(len(each.place) for each in self._all)

    @property
    def n_escaped(self) -> int:
        """Number of rays that left a closed room between its triangles, and were traced again."""
        return sum(each.n_escaped for each in self._all)

    def irradiance(self, folded: Callable[..., Float32Array]) -> FloatArray:
        """Return the irradiance at all places with states (places, bands).

        Parameters
        ----------
        folded
            The fold with a glow and lamps.
        """
        light = np.zeros((self.geometry.n_places, len(self._scene.bands)))
        for number, paths in self._from_places().items():
            surface, own = self.geometry.surfaces[number], self.geometry.places_of(number)
            lit = np.concatenate([each.place[each.first[: -1 : each.per_target]] for each in paths])
            sides = 2.0 if surface.is_two_sided else 1.0
            # Noise of a measured matrix may make it negative.
            light[lit] = sides * np.maximum(folded(paths, incident=True), 0.0)
            light[own] = light[own][_nearest_lit(lit - own.start, surface)]
        return light

    def _from_places(self) -> dict[int, list[Paths]]:
        """Return the paths from the places of each surface with states."""
        if self._of_places is None:
            per_place = self._scene.file.paths.per_place
            surfaces = self.geometry.surfaces
            own = {n: each.n_places for n, each in enumerate(surfaces) if each.samples is not None}
            n_done, self._of_places = 0, {}
            for number, n_places in own.items():
                traced = self._of_places.setdefault(number, [])
                begun = n_done
                for paths in self._tracer.from_surface(number, per_place, self._threads):
                    traced.append(paths)
                    n_done += paths.n_targets
                    self._report("tracing paths of phosphors", n_done / sum(own.values()))
                n_done = begun + n_places
        return self._of_places


def _nearest_lit(lit: Int32Array, surface: Surface) -> Int32Array:
    """Return for each place of a surface the nearest that lies on it, by its texture."""
    if not isinstance(surface.samples, tuple) or len(lit) == surface.n_places:
        return np.arange(surface.n_places, dtype=np.int32)
    columns, rows = surface.samples
    is_beside = np.ones((rows, columns), bool)
    is_beside.ravel()[lit] = False
    row, column = distance_transform_edt(is_beside, return_distances=False, return_indices=True)
    return np.asarray((row * columns + column).ravel(), dtype=np.int32)


def require_traceable(scene: Scene) -> None:
    """Refuse a scene through which no paths can be traced, before a picture is begun.

    Parameters
    ----------
    scene
        The scene.

    Raises
    ------
    UsageError
        Its paths take more memory than there is, or a mesh does not have the texture coordinates
        that its texels need.

    Examples
    --------
    >>> from labrig.reproduce import load_scene, require_traceable
    >>> require_traceable(load_scene("cornell-box"))
    """
    require_memory(scene)
    scene.geometry(scene.file.programme[0].at_s)


def require_memory(scene: Scene) -> None:
    """Refuse a scene whose paths take more memory than there is."""
    try:
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return  # Windows does not tell
    camera, paths = scene.file.camera, scene.file.paths
    places = sum(
        surface.n_places
        for surface in scene.surfaces(scene.file.programme[0].at_s)
        if surface.samples is not None
    )
    n_paths = camera.width_px * camera.height_px * paths.per_pixel + places * paths.per_place
    needed = scene.path_length.nbytes(n_paths, len(scene.file.lamps))
    needed += MAX_COPIES * 4 * len(scene.bands) * (places + camera.width_px * camera.height_px)
    needed += OF_TEXEL * places
    for material in scene.materials:
        if material.texture is not None and material.parameters is not None:
            states = material.parameters.n_states
            needed += 4 * states * (1 + 2 * len(scene.bands)) * places
    if needed > MAX_PART * there:
        raise UsageError(
            f"{scene.file.name}: expected paths that fit into {MAX_PART * there / 1e9:.1f} GB, "
            f"of {there / 1e9:.1f} GB of memory, got {needed / 1e9:.1f} GB; take fewer paths "
            "(--paths), a smaller picture (--size) or fewer texels"
        )
