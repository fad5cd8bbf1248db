"""Pictures of a scene over time: states are charged by the light that falls on them, and glow.

Between pictures the levels of all phosphors are stepped through the light of the lamps and of each
other's glow; the picture is then the fold of the camera's paths.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import Float32Array, FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.foundation.processors import n_processors
from labrig.foundation.result_warning import Disturbance, ResultWarning
from labrig.reproduce.picture.view import Report, View, require_memory
from labrig.reproduce.scene.built_scene import Scene
from labrig.reproduce.surface.field import Field
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.folding import Matrices, colour_fold, fold
from labrig.reproduce.transport.geometry import Geometry


@dataclass(frozen=True, eq=False)
class PhosphorState:
    """Levels of one phosphor, at all places that are made of it.

    Attributes
    ----------
    name
        Name of the material in the scene.
    material
        Number of the material.
    places
        Numbers of its places, shape (places,).
    texels
        Texel of its texture at each of them; None without a texture.
    field
        Its levels.
    is_charged
        Whether it begins in equilibrium with the light.
    """

    name: str
    material: int
    places: Int32Array
    texels: Int32Array | None
    field: Field
    is_charged: bool


def phosphor_states(scene: Scene, geometry: Geometry) -> list[PhosphorState]:
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
        states.append(
            PhosphorState(name, number, places.astype(np.int32), texels, field, is_charged)
        )
    return states


def _texels(material: SurfaceMaterial, number: int, geometry: Geometry) -> Int32Array:
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


def albedo_factor(scene: Scene, states: list[PhosphorState], n_places: int) -> Float32Array | None:
    """Return the factor of the albedo of every place, None where there is none."""
    factor = np.ones(n_places, np.float32)
    for state in states:
        texture = scene.materials[state.material].texture
        of_texel = None if texture is None else texture.texels("albedo_factor")
        if of_texel is not None and state.texels is not None:
            factor[state.places] = of_texel[state.texels]
    return None if (factor == 1).all() else factor


#: Is called for each step with its start in s and the mean irradiance during it.
Record = Callable[[float, FloatArray], None]

#: First step after a change of light, as a part of the fastest relaxation; later ones grow.
FIRST_STEP, GROWTH = 0.25, 2.0
#: Change of the logarithm of all light at which steps grow no more; rounds and parts of a step.
MAX_CHANGE, ROUNDS, PARTS = 0.7, 2, 8
#: Relative change of light within a step that is none.
UNCHANGED = 1e-5
#: Rounds in which levels of a long charge settle, and their last change.
CHARGING_ROUNDS, SETTLED = 100, 1e-5
#: Rounds of what is emitted at once.
PROMPT_ROUNDS = 6
TINY = 1e-300
#: Part of the rays that may leave a closed room between its triangles: none do of a whole mesh.
MAX_ESCAPED = 1e-4
#: Steps of a scene that moves.
MAX_STEPS = 100_000


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
        Part of the rays of its paths, and of those of the steps up to it, that left a closed room
        between its triangles, and were traced again.
    """

    t_s: float
    radiance: Float32Array
    escaped_share: float = 0.0

    @property
    def warnings(self) -> tuple[ResultWarning, ...]:
        """Warnings about the picture."""
        if self.escaped_share <= MAX_ESCAPED:
            return ()
        return (
            Disturbance(
                "rays-escaped",
                "{escaped_share:.2%} of the rays left the closed room between its triangles and "
                "were traced again, so light near its edges may be wrong; join the vertices there",
                escaped_share=self.escaped_share,
            ),
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
        require_memory(scene)
        self._matrices = Matrices.of(scene.materials)
        self._t_s = scene.file.programme[0].at_s
        self._view: View = (
            View(scene, self._t_s, self._threads, report) if traced is None else traced._view
        )
        geometry = self._view.geometry
        self._material_of_place = geometry.material_of_place
        self._states = phosphor_states(scene, geometry)
        self._albedo_factor = albedo_factor(scene, self._states, geometry.n_places)
        # Rays of steps of a scene that moves, whose paths are not kept.
        self._n_rays, self._n_escaped = 0, 0
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
        return self.emitted()

    @property
    def memory_bytes(self) -> int:
        """Memory of the kept paths in bytes."""
        return self._view.nbytes

    def frame(self, t_s: float) -> Frame:
        """Advance to a time and return its picture.

        Parameters
        ----------
        t_s
            Time in s, not before the time that has been reached.
        """
        self.advance(t_s)
        view = self._view_at(t_s)
        camera, lamps = self._scene.camera, self._lamps(t_s)
        light = self._folds(self._glow(view, lamps), lamps)(view.of_camera())
        picture = light.reshape(camera.height_px, camera.width_px, -1)
        escaped = (self._n_escaped + view.n_escaped) / max(self._n_rays + view.n_rays, 1)
        return Frame(t_s, picture, escaped)

    def frames(self) -> Iterator[Frame]:
        """Return the pictures at all times of the scene that were not passed yet."""
        for t_s in self._scene.file.frames_s:
            if t_s >= self._t_s:
                yield self.frame(t_s)

    def places_of(self, name: str) -> Int32Array:
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
                view.irradiance(self._folds(dark, self._light_of_lamps(levels)))
                for levels in np.eye(len(self._scene.file.lamps))
            ]
        ).reshape(-1, *dark.shape)

    def emitted(self, irradiance: FloatArray | None = None) -> Float32Array:
        """Return the radiance that each place emits by itself at the time that was reached.

        Parameters
        ----------
        irradiance
            Irradiance in W m⁻² nm⁻¹ of which a part is emitted at once, where materials do so,
            shape (places, bands); None for darkness.

        Returns
        -------
        ndarray
            Radiance in W m⁻² sr⁻¹ nm⁻¹, shape (places, bands).
        """
        glow = np.zeros((len(self._material_of_place), len(self._scene.bands)), np.float32)
        for state in self._states:
            light = None if irradiance is None else irradiance[state.places].T
            glow[state.places] = state.field.radiance(light).T
        return glow

    def irradiance(self) -> FloatArray:
        """Return the irradiance by lamps and glow at the time that was reached.

        Returns
        -------
        ndarray
            Irradiance in W m⁻² nm⁻¹ at the places with states, zero elsewhere, shape (places,
            bands).
        """
        return self._light_in(self._view_at(self._t_s), self._lamps(self._t_s))

    def advance(self, t_s: float, record: Record | None = None) -> None:
        """Step all levels to a time.

        Parameters
        ----------
        t_s
            Time in s, not before the time that has been reached.
        record
            What is called for each step of a scene where nothing moves, with its start in s and the
            mean irradiance during it, shape (places, bands).
        """
        if not self._states or t_s <= self._t_s:
            self._t_s = max(self._t_s, t_s)
            return
        changes = [part.at_s for part in self._scene.file.programme]
        edges = [self._t_s, *(at_s for at_s in changes if self._t_s < at_s < t_s), t_s]
        for begin, end in pairwise(edges):
            if self._scene.is_moving:
                self._follow(begin, end)
            else:
                self._settle(begin, end, record)
        self._t_s = t_s

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
        light = self._folds(glow, lamps)(self._view_at(self._t_s).of_camera())
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
    def seen_places(self) -> Int32Array:
        """Places that some pixel shows, rising."""
        return self._view_at(self._t_s).seen_places()

    @property
    def first_places(self) -> Int32Array:
        """Places that the paths of each pixel meet first, shape (height, width, paths).

        A lamp is −2 less its number, and nothing −1.
        """
        camera, paths = self._scene.camera, self._view_at(self._t_s).of_camera()
        found = np.concatenate([each.first_places for each in paths])
        return found.reshape(camera.height_px, camera.width_px, -1)

    def _view_at(self, t_s: float) -> View:
        """Return paths; they are traced anew only where something moves."""
        if self._scene.is_moving and self._view.t_s != t_s:
            self._view = View(self._scene, t_s, self._threads, self._report)
        return self._view

    def _lamps(self, t_s: float) -> Float32Array:
        return self._light_of_lamps(self._scene.levels(t_s))

    def _light_of_lamps(self, levels: FloatArray) -> Float32Array:
        # A lamp may move, but shines alike everywhere.
        lamps = self._scene.lamps(self._t_s)
        light = np.array([lamp.light for lamp in lamps]).reshape(len(lamps), len(self._scene.bands))
        return np.asarray(levels[:, None] * light, dtype=np.float32)

    def _glow(self, view: View, lamps: Float32Array) -> Float32Array:
        """Return the emitted radiance with what the light makes emit at once."""
        glow = self.emitted()
        if not any(state.field.parameters.prompt for state in self._states):
            return glow
        # What is emitted at once excites more of it.
        for _ in range(PROMPT_ROUNDS):
            glow = self.emitted(view.irradiance(self._folds(glow, lamps)))
        return glow

    def _light_in(self, view: View, lamps: Float32Array) -> FloatArray:
        """Return the irradiance at all places, zero where it is not needed (places, bands)."""
        return view.irradiance(self._folds(self._glow(view, lamps), lamps))

    def _folds(self, glow: Float32Array, lamps: Float32Array) -> Callable[..., Float32Array]:
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
        view, lamps = self._view_at(self._t_s), self._lamps(self._t_s)
        for _ in range(CHARGING_ROUNDS):
            light = self._light_in(view, lamps)
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

    def _settle(self, begin_s: float, end_s: float, record: Record | None) -> None:
        """Step through a time in which the lamps are constant, and only the glow changes.

        Light that fades does so nearly as an exponential: so it is taken between the beginning
        and the end of a step, which is found in rounds. Steps grow while light hardly changes.
        """
        view, lamps = self._view_at(begin_s), self._lamps(begin_s)
        t_s, step_s, n_steps = begin_s, 0.0, 0
        light = self._light_in(view, lamps)
        while t_s < end_s:
            step_s = max(step_s, FIRST_STEP / self._fastest(light))
            if end_s - t_s < 1.2 * step_s:
                step_s = end_s - t_s
            before = [state.field.levels.copy() for state in self._states]
            self._step(light, step_s)
            later = self._light_in(view, lamps)
            for _ in range(ROUNDS):
                if np.abs(later - light).max() <= UNCHANGED * light.max():
                    break
                for state, levels in zip(self._states, before, strict=True):
                    state.field.levels[:] = levels
                self._glide(light, later, step_s)
                later = self._light_in(view, lamps)
            if record is not None:
                middles = [_between(light, later, (part + 0.5) / PARTS) for part in range(PARTS)]
                record(t_s, np.mean(middles, axis=0))
            t_s = end_s if step_s == end_s - t_s else t_s + step_s
            change = abs(math.log(max(float(later.sum()), TINY) / max(float(light.sum()), TINY)))
            step_s *= min(GROWTH, MAX_CHANGE / max(change, TINY))
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
        if parts > MAX_STEPS:
            raise UsageError(
                f"{self._scene.file.name}: expected at most {MAX_STEPS} steps between two "
                f"pictures, got {parts:g}; give a longer 'step_s'"
            )
        edges = np.linspace(begin_s, end_s, parts + 1).tolist()
        for number, (low, high) in enumerate(pairwise(edges), 1):
            middle = (low + high) / 2
            view = View(self._scene, middle, self._threads)
            self._step(self._light_in(view, self._lamps(middle)), high - low)
            self._n_rays += view.n_rays
            self._n_escaped += view.n_escaped
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


def _between(light: FloatArray, later: FloatArray, x: float) -> FloatArray:
    """Return light on its way into another, at a part x of it: exponentially where both shine."""
    both = (light > 0) & (later > 0)
    ratio = np.divide(later, light, out=np.ones_like(light), where=both)
    return np.where(both, light * ratio**x, (1 - x) * light + x * later)


def _levels_until(t_s: float) -> str:
    return f"charging and decay up to {t_s:g} s"
