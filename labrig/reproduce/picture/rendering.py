"""Pictures of a scene over time: states are charged by the light that falls on them, and glow.

Between pictures the levels of all phosphors are stepped through the light of the lamps and of each
other's glow; the picture is then the fold of the camera's paths.
"""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from labrig.errors import UsageError
from labrig.processors import n_processors
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.surface.field import Field
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.colour_folding import Sequences, colour_fold
from labrig.reproduce.transport.folding import Matrices, fold
from labrig.reproduce.transport.geometry import Geometry, Surface
from labrig.reproduce.transport.lamp import LampTable
from labrig.reproduce.transport.tracing import Paths, Tracer

Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

#: Part of the memory that paths and pictures may take, and copies of a picture at once.
LARGEST_PART, MOST_COPIES = 0.7, 6
#: Memory in bytes that tells where a texel lies on its surface.
OF_TEXEL = 300
#: First step after a change of light, as a part of the fastest relaxation; later ones grow.
FIRST_STEP, GROWTH = 0.25, 2.0
#: Change of the logarithm of all light at which steps grow no more; rounds and parts of a step.
MOST_CHANGE, ROUNDS, PARTS = 0.7, 2, 8
#: Relative change of light within a step that is none.
UNCHANGED = 1e-5
#: Rounds in which levels of a long charge settle, and their last change.
CHARGING_ROUNDS, SETTLED = 100, 1e-5
#: Rounds of what is emitted at once.
PROMPT_ROUNDS = 6
TINY = 1e-300
#: Part of the rays that may leave a closed room between its triangles: none do of a whole mesh.
MOST_ESCAPED = 1e-4
#: Steps of a scene that moves.
MOST_STEPS = 100_000


#: Is told what is done, and which part of it is, 0 to 1.
Report: TypeAlias = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture.

    Attributes
    ----------
    t_s
        Its time in s.
    radiance
        Spectral radiance in W m⁻² sr⁻¹ nm⁻¹, shape (height, width, bands).
    escaped_share
        Part of the rays of its paths that left a closed room between its triangles, and were traced
        again.
    """

    t_s: float
    radiance: Float32Array
    escaped_share: float = 0.0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may be wrong with the picture, one sentence each."""
        if self.escaped_share <= MOST_ESCAPED:
            return ()
        return (
            f"{self.escaped_share:.2%} of the rays left the closed room between its triangles and "
            "were traced again, so light near its edges may be wrong; join the vertices there",
        )


@dataclass(frozen=True)
class Seen:
    """What a pixel shows.

    Attributes
    ----------
    name
        Name of the object or the lamp; `nothing` where there is none.
    material
        Name of its material there; None of a lamp or of nothing.
    place
        Number of the place, among all of the scene; -1 of what has no material.
    """

    name: str
    material: str | None
    place: int


class Renderer:
    """Renders a scene, frame after frame.

    Parameters
    ----------
    scene
        The scene.
    threads
        Threads that trace and fold. Default: one for each processor.
    report
        Is called with what is done, such as the tracing of paths, and with the part of it that is,
        0 to 1: while levels are stepped, an estimate.
    traced
        Renderer of a scene with the same objects, lamps and camera, where nothing moves: its paths
        are taken over.

    Examples
    --------
    >>> from labrig.reproduce import Assumptions, Renderer, load_scene
    >>> scene = load_scene("cornell-box").resized(width_px=8, height_px=8, paths=4)
    >>> renderer = Renderer(scene)
    >>> frame = renderer.frame(-1.0)
    >>> frame.radiance.shape, bool(frame.radiance.min() >= 0)
    ((8, 8, 24), True)
    """

    def __init__(
        self,
        scene: Scene,
        threads: int | None = None,
        report: Report = lambda what, part: None,
        traced: "Renderer | None" = None,
    ) -> None:
        self._scene, self._report = scene, report
        self._threads = threads or n_processors()
        _require_memory(scene)
        self._matrices = Matrices.of(scene.materials)
        self._t_s = scene.file.programme[0].at_s
        geometry = scene.geometry(self._t_s)
        self._material_of_place = geometry.material_of_place
        self._states = _states(scene, geometry)
        self._albedo_factor = _albedo_factor(scene, self._states, geometry.n_places)
        self._record: Callable[[float, FloatArray], None] | None = None
        self._view: _View | None = None if traced is None else traced._view
        self._charge_at_first()

    @property
    def t_s(self) -> float:
        """Time that has been reached, in s."""
        return self._t_s

    @property
    def levels(self) -> dict[str, Float32Array]:
        """Levels of each phosphor at all its places, by its name: (states, places)."""
        return {state.name: state.field.levels.copy() for state in self._states}

    def restore(self, t_s: float, levels: dict[str, Float32Array]) -> None:
        """Go on from the levels of an earlier rendering at a time in s."""
        for state in self._states:
            state.field.levels[:] = levels[state.name]
        self._t_s = t_s

    def emitted_at(self, t_s: float, levels: dict[str, Float32Array]) -> Float32Array:
        """Return the radiance that each place emits by itself at kept levels (places, bands)."""
        self.restore(t_s, levels)
        return self._emitted()

    @property
    def memory_bytes(self) -> int:
        """Memory of the kept paths in bytes."""
        return 0 if self._view is None else self._view.nbytes

    def frame(self, t_s: float) -> Frame:
        """Advance to a time and return its picture.

        Parameters
        ----------
        t_s
            Time in s, not before the time that has been reached.
        """
        self._advance(t_s)
        view = self._view_at(t_s)
        camera = self._scene.camera
        light = self._fold_of(self._glow(view, t_s), t_s)(view.of_camera())
        picture = light.reshape(camera.height_px, camera.width_px, -1)
        return Frame(t_s, picture, view.escaped_share)

    def frames(self) -> Iterator[Frame]:
        """Return the pictures at all times of the scene that were not passed yet."""
        for t_s in self._scene.file.frames_s:
            if t_s >= self._t_s:
                yield self.frame(t_s)

    def places_of(self, name: str) -> IntArray:
        """Return the places of a phosphor of the scene, none if it is nowhere (places,)."""
        own = [state.places for state in self._states if state.name == name]
        return own[0] if own else np.zeros(0, np.int32)

    def irradiance_of_lamps(self) -> FloatArray:
        """Return the irradiance by each lamp at its full strength, after all reflections.

        Returns
        -------
        ndarray
            Irradiance in W m⁻² nm⁻¹ at the places with states, zero elsewhere, shape (lamps,
            places, bands).
        """
        view = self._view_at(self._t_s)
        dark = np.zeros((len(self._material_of_place), len(self._scene.bands)), np.float32)
        return np.array(
            [
                view.irradiance(self._fold_with(dark, self._light_of_lamps(levels)))
                for levels in np.eye(len(self._scene.file.lamps))
            ]
        ).reshape(-1, *dark.shape)

    def emitted(self) -> Float32Array:
        """Return the radiance that each place emits by itself at the time that was reached.

        Returns
        -------
        ndarray
            Radiance in W m⁻² sr⁻¹ nm⁻¹, shape (places, bands).
        """
        return self._emitted()

    def irradiance(self) -> FloatArray:
        """Return the irradiance by lamps and glow at the time that was reached.

        Returns
        -------
        ndarray
            Irradiance in W m⁻² nm⁻¹ at the places with states, zero elsewhere, shape (places,
            bands).
        """
        return self._irradiance(self._view_at(self._t_s), self._t_s)

    def advance(
        self, t_s: float, record: Callable[[float, FloatArray], None] | None = None
    ) -> None:
        """Step all levels to a time.

        Parameters
        ----------
        t_s
            Time in s, not before the time that has been reached.
        record
            What is called for each step of a scene where nothing moves, with its begin in s and the
            mean irradiance during it, shape (places, bands).
        """
        self._record = record
        self._advance(t_s)
        self._record = None

    def picture(self, glow: Float32Array, levels: ArrayLike) -> Float32Array:
        """Return the picture of any glow under lamps of any levels.

        Parameters
        ----------
        glow
            Radiance that each place emits by itself, shape (places, bands).
        levels
            Level of each lamp, as a factor of its strength, shape (lamps,).

        Returns
        -------
        ndarray
            Spectral radiance in W m⁻² sr⁻¹ nm⁻¹, shape (height, width, bands).
        """
        camera = self._scene.camera
        lamps = self._light_of_lamps(np.asarray(levels, dtype=np.float64))
        light = self._fold_with(glow, lamps)(self._view_at(self._t_s).of_camera())
        return light.reshape(camera.height_px, camera.width_px, -1)

    def colours(self, glow: Float32Array, levels: ArrayLike, to_rgb: FloatArray) -> Float32Array:
        """Return the picture of any glow under lamps of any levels in three channels.

        It is that of `picture`, quicker where few materials are coloured.

        Parameters
        ----------
        glow, levels
            As of `picture`.
        to_rgb
            Channels by the light in the bands, shape (3, bands).

        Returns
        -------
        ndarray
            Channels, shape (height, width, 3).
        """
        view, materials, camera = (
            self._view_at(self._t_s),
            self._scene.materials,
            self._scene.camera,
        )
        # An albedo that differs from place to place is no material of a path.
        sequences = view.sequences(materials) if self._albedo_factor is None else None
        if sequences is None:
            return np.asarray(self.picture(glow, levels) @ to_rgb.T, dtype=np.float32)
        lamps = self._light_of_lamps(np.asarray(levels, dtype=np.float64))
        light = colour_fold(
            view.of_camera(), sequences, materials, self._material_of_place, glow, lamps, to_rgb,
            self._threads,
        )  # fmt: skip
        return light.reshape(camera.height_px, camera.width_px, 3)

    def seen_at(self, x: float, y: float) -> Seen:
        """Return what most paths of a pixel meet first.

        Parameters
        ----------
        x, y
            Where the pixel is, as fractions of the picture's width and height from its upper left.
        """
        camera = self._scene.camera
        column, row = int(x * camera.width_px), int(y * camera.height_px)
        pixel = min(row, camera.height_px - 1) * camera.width_px + min(column, camera.width_px - 1)
        view = self._view_at(self._t_s)
        first = view.first_places(pixel)
        values, counts = np.unique(first, return_counts=True)
        found = int(values[counts.argmax()])
        if found < 0:
            lamp = -2 - found
            return Seen(list(self._scene.file.lamps)[lamp] if lamp >= 0 else "nothing", None, -1)
        geometry = view.geometry
        number = int(np.searchsorted(geometry.table[:, 1], found, side="right")) - 1
        material = int(self._material_of_place[found])
        named = list(self._scene.file.materials)[material] if material >= 0 else None
        return Seen(geometry.surfaces[number].name, named, found)

    @property
    def seen_places(self) -> IntArray:
        """Places that some pixel shows, rising."""
        return self._view_at(self._t_s).seen_places()

    @property
    def first_places(self) -> IntArray:
        """Places that the paths of each pixel meet first, shape (height, width, paths).

        A lamp is −2 less its number, and nothing −1.
        """
        camera, paths = self._scene.camera, self._view_at(self._t_s).of_camera()
        found = np.concatenate([each.first_places for each in paths])
        return found.reshape(camera.height_px, camera.width_px, -1)

    def _view_at(self, t_s: float) -> "_View":
        """Return paths; they are traced anew only where something moves."""
        if self._view is None or (self._scene.is_moving and self._view.t_s != t_s):
            self._view = _View(self._scene, t_s, self._threads, self._report)
        return self._view

    def _lamps(self, t_s: float) -> Float32Array:
        return self._light_of_lamps(self._scene.levels(t_s))

    def _light_of_lamps(self, levels: FloatArray) -> Float32Array:
        # A lamp may move, but shines alike everywhere.
        lamps = self._scene.lamps(self._t_s)
        light = np.array([lamp.light for lamp in lamps]).reshape(len(lamps), len(self._scene.bands))
        return np.asarray(levels[:, None] * light, dtype=np.float32)

    def _emitted(self, irradiance: FloatArray | None = None) -> Float32Array:
        """Return the radiance that each place emits by itself, shape (places, bands)."""
        glow = np.zeros((len(self._material_of_place), len(self._scene.bands)), np.float32)
        for state in self._states:
            light = None if irradiance is None else irradiance[state.places].T
            glow[state.places] = state.field.radiance(light).T
        return glow

    def _glow(self, view: "_View", t_s: float) -> Float32Array:
        """Return the emitted radiance with what the light makes emit at once."""
        glow = self._emitted()
        if not any(state.field.parameters.prompt for state in self._states):
            return glow
        # What is emitted at once excites more of it.
        for _ in range(PROMPT_ROUNDS):
            glow = self._emitted(view.irradiance(self._fold_of(glow, t_s)))
        return glow

    def _irradiance(self, view: "_View", t_s: float) -> FloatArray:
        """Return the irradiance at all places, zero where it is not needed (places, bands)."""
        return view.irradiance(self._fold_of(self._glow(view, t_s), t_s))

    def _fold_of(self, glow: Float32Array, t_s: float) -> Callable[..., Float32Array]:
        """Return the fold of paths with a glow and the light of a time."""
        return self._fold_with(glow, self._lamps(t_s))

    def _fold_with(self, glow: Float32Array, lamps: Float32Array) -> Callable[..., Float32Array]:
        """Return the fold of paths with a glow and lamps."""
        return partial(
            fold,
            matrices=self._matrices,
            material_of_place=self._material_of_place,
            albedo_factor=self._albedo_factor,
            glow=glow,
            lamps=lamps,
            threads=self._threads,
        )

    def _charge_at_first(self) -> None:
        charged = [state for state in self._states if state.is_charged]
        if not charged:
            return
        view = self._view_at(self._t_s)
        for _ in range(CHARGING_ROUNDS):
            light = self._irradiance(view, self._t_s)
            before = [state.field.levels.copy() for state in charged]
            for state in charged:
                state.field.charge_to_equilibrium(light[state.places].T)
            changed = [
                float(np.abs(state.field.levels - levels).max())
                for state, levels in zip(charged, before, strict=True)
            ]
            if max(changed) < SETTLED:
                return
            self._report("charging at the beginning", math.log(max(changed)) / math.log(SETTLED))

    def _advance(self, to_s: float) -> None:
        """Step all levels to a time."""
        if not self._states or to_s <= self._t_s:
            self._t_s = max(self._t_s, to_s)
            return
        changes = [part.at_s for part in self._scene.file.programme]
        edges = [self._t_s, *(t for t in changes if self._t_s < t < to_s), to_s]
        for begin, end in pairwise(edges):
            if self._scene.is_moving:
                self._follow(begin, end)
            else:
                self._settle(begin, end)
        self._t_s = to_s

    def _settle(self, begin_s: float, end_s: float) -> None:
        """Step through a time in which the lamps are constant, and only the glow changes.

        Light that fades does so nearly as an exponential: so it is taken between the beginning
        and the end of a step, which is found in rounds. Steps grow while light hardly changes.
        """
        view = self._view_at(begin_s)
        t_s, step_s, n_steps = begin_s, 0.0, 0
        light = self._irradiance(view, begin_s)
        while t_s < end_s:
            step_s = max(step_s, FIRST_STEP / self._fastest(light))
            if end_s - t_s < 1.2 * step_s:
                step_s = end_s - t_s
            before = [state.field.levels.copy() for state in self._states]
            self._step(light, step_s)
            later = self._irradiance(view, begin_s)
            for _ in range(ROUNDS):
                if np.abs(later - light).max() <= UNCHANGED * light.max():
                    break
                for state, levels in zip(self._states, before, strict=True):
                    state.field.levels[:] = levels
                self._glide(light, later, step_s)
                later = self._irradiance(view, begin_s)
            if self._record is not None:
                middles = [_between(light, later, (part + 0.5) / PARTS) for part in range(PARTS)]
                self._record(t_s, np.mean(middles, axis=0))
            t_s = end_s if step_s == end_s - t_s else t_s + step_s
            change = abs(math.log(max(float(later.sum()), TINY) / max(float(light.sum()), TINY)))
            step_s *= min(GROWTH, MOST_CHANGE / max(change, TINY))
            light, n_steps = later, n_steps + 1
            self._report(_levels_until(end_s), n_steps / (n_steps + (end_s - t_s) / step_s))

    def _glide(self, light: FloatArray, later: FloatArray, step_s: float) -> None:
        """Step through light that goes over into another, exponentially where both shine."""
        for part in range(PARTS):
            self._step(_between(light, later, (part + 0.5) / PARTS), step_s / PARTS)

    def _follow(self, begin_s: float, end_s: float) -> None:
        """Step through a time in which something moves, which is where it is in mid-step."""
        longest = self._scene.file.step_s or math.inf
        parts = max(1, math.ceil((end_s - begin_s) / longest - 1e-9))
        if parts > MOST_STEPS:
            raise UsageError(
                f"{self._scene.file.name}: expected at most {MOST_STEPS} steps between two "
                f"pictures, got {parts:g}; give a longer 'step_s'"
            )
        edges = np.linspace(begin_s, end_s, parts + 1).tolist()
        for number, (low, high) in enumerate(pairwise(edges), 1):
            middle = (low + high) / 2
            view = _View(self._scene, middle, self._threads)
            self._step(self._irradiance(view, middle), high - low)
            self._report(_levels_until(end_s), number / parts)

    def _step(self, light: FloatArray, step_s: float) -> None:
        for state in self._states:
            state.field.step(light[state.places].T, step_s)

    def _fastest(self, light: FloatArray) -> float:
        """Return the fastest rate at which a level relaxes, in 1/s."""
        rates = []
        for state in self._states:
            parameters = state.field.parameters
            samples = light[state.places]
            if parameters.k_e_per_s.ndim == 2:
                kappa = parameters.k_e_per_s @ samples.T
            else:
                kappa = np.einsum("ibs,sb->is", parameters.k_e_per_s, samples)
            rates.append(float(np.max(kappa + np.atleast_2d(parameters.k_r_per_s.T).T)))
        return max(rates)


@dataclass(frozen=True, eq=False)
class _State:
    """Levels of one phosphor, at all places that are made of it."""

    name: str
    material: int
    places: IntArray
    texels: IntArray | None
    field: Field
    is_charged: bool


class _View:
    """Paths in the arrangement at one time; the camera's are traced when they are first needed."""

    def __init__(
        self, scene: Scene, t_s: float, threads: int, report: Report = lambda what, part: None
    ) -> None:
        self.t_s = t_s
        self._scene, self._threads, self._report = scene, threads, report
        self._geometry = scene.geometry(t_s)
        lamps = LampTable.of(scene.lamps(t_s), self._geometry)
        paths = scene.file.paths
        self._tracer = Tracer(self._geometry, lamps, scene.path_length, paths.seed)
        self._of_places: dict[int, list[Paths]] | None = None
        self._of_camera: list[Paths] = []
        self._sequences: Sequences | None = None
        self._has_many_sequences = False

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
            of_place = self._geometry.material_of_place
            self._sequences = Sequences.of(self.of_camera(), materials, of_place)
            self._has_many_sequences = self._sequences is None
        return self._sequences

    @property
    def geometry(self) -> Geometry:
        """Surfaces in this arrangement."""
        return self._geometry

    def first_places(self, pixel: int) -> IntArray:
        """Return the places that the paths of a pixel meet first, -2 - n of lamp n (paths,)."""
        for paths in self.of_camera():
            if pixel < paths.n_targets:
                own = slice(pixel * paths.per_target, (pixel + 1) * paths.per_target)
                return paths.first_places[own]
            pixel -= paths.n_targets
        raise AssertionError("a pixel within the picture")

    def seen_places(self) -> IntArray:
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
    def escaped_share(self) -> float:
        """Part of the rays that left a closed room."""
        n_rays = sum(len(each.place) for each in self._all)
        return sum(each.n_escaped for each in self._all) / max(n_rays, 1)

    def irradiance(self, folded: Callable[..., Float32Array]) -> FloatArray:
        """Return the irradiance at all places with states (places, bands).

        Parameters
        ----------
        folded
            The fold with a glow and lamps.
        """
        light = np.zeros((self._geometry.n_places, len(self._scene.bands)))
        for number, paths in self._from_places().items():
            surface, own = self._geometry.surfaces[number], self._geometry.places_of(number)
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
            surfaces = self._geometry.surfaces
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


def _between(light: FloatArray, later: FloatArray, x: float) -> FloatArray:
    """Return light on its way into another, at a part x of it: exponentially where both shine."""
    both = (light > 0) & (later > 0)
    ratio = np.divide(later, light, out=np.ones_like(light), where=both)
    return np.where(both, light * ratio**x, (1 - x) * light + x * later)


def _levels_until(t_s: float) -> str:
    return f"charging and decay up to {t_s:g} s"


def _nearest_lit(lit: IntArray, surface: Surface) -> IntArray:
    """Return for each place of a surface the nearest that lies on it, by its texture."""
    if not isinstance(surface.samples, tuple) or len(lit) == surface.n_places:
        return np.arange(surface.n_places, dtype=np.int32)
    columns, rows = surface.samples
    is_beside = np.ones((rows, columns), bool)
    is_beside.ravel()[lit] = False
    row, column = distance_transform_edt(is_beside, return_distances=False, return_indices=True)
    return np.asarray((row * columns + column).ravel(), dtype=np.int32)


def _states(scene: Scene, geometry: Geometry) -> list[_State]:
    """Return the phosphors that are somewhere in the scene."""
    has_samples = np.concatenate(
        [np.full(surface.n_places, surface.samples is not None) for surface in geometry.surfaces]
    )
    entries = list(scene.file.materials.values())
    states = []
    for number, material in enumerate(scene.materials):
        places = np.flatnonzero((geometry.material_of_place == number) & has_samples)
        if material.parameters is None or not len(places):
            continue
        given = entries[number].levels
        is_charged = given == "charged"
        texels, parameters = None, material.parameters
        if material.texture is not None:
            texels = _texels(material, number, geometry)[places]
            parameters = parameters.at(texels)
        field = Field(parameters, len(places), 0.0 if given == "charged" else given)
        name = list(scene.file.materials)[number]
        states.append(_State(name, number, places.astype(np.int32), texels, field, is_charged))
    return states


def _texels(material: SurfaceMaterial, number: int, geometry: Geometry) -> IntArray:
    """Return the texel of a material's texture at every place, zero of others, shape (places,)."""
    assert material.texture is not None
    texels = np.zeros(geometry.n_places, np.int32)
    for index, surface in enumerate(geometry.surfaces):
        own = geometry.places_of(index)
        if surface.samples is None or not (geometry.material_of_place[own] == number).any():
            continue
        if (uv := surface.uv_of_places) is None:
            raise UsageError(
                f"{surface.name}: expected texture coordinates for the 'texture' of "
                f"{material.name}, got a surface without"
            )
        texels[own] = material.texture.texel_at(uv)
    return texels


def _albedo_factor(scene: Scene, states: list[_State], n_places: int) -> Float32Array | None:
    """Return the factor of the albedo of every place, None where there is none."""
    factor = np.ones(n_places, np.float32)
    for state in states:
        texture = scene.materials[state.material].texture
        of_texel = None if texture is None else texture.texels("albedo_factor")
        if of_texel is not None and state.texels is not None:
            factor[state.places] = of_texel[state.texels]
    return None if (factor == 1).all() else factor


def _require_memory(scene: Scene) -> None:
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
    needed += MOST_COPIES * 4 * len(scene.bands) * (places + camera.width_px * camera.height_px)
    needed += OF_TEXEL * places
    for material in scene.materials:
        if material.texture is not None and material.parameters is not None:
            states = material.parameters.n_states
            needed += 4 * states * (1 + 2 * len(scene.bands)) * places
    if needed > LARGEST_PART * there:
        raise UsageError(
            f"{scene.file.name}: expected paths that fit into {LARGEST_PART * there / 1e9:.1f} GB, "
            f"of {there / 1e9:.1f} GB of memory, got {needed / 1e9:.1f} GB; take fewer paths "
            "(--paths), a smaller picture (--size) or fewer texels"
        )
