"""Measured and fitted phosphors in the rendered dark room, at the photographs' exposures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.compare.glow import predicted_by
from labrig.compare.photographed_room import (
    DarkRoomScene,
    PhotographedRoom,
    ReflectedLight,
    picture_of,
    rendered_light,
)
from labrig.compare.run import MeasuredPatch
from labrig.fit import DecayFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Misfit, ResultWarning, Undetermined
from labrig.material import DECAY_LAWS, MAX_ORDER, Material, State, write_material
from labrig.optics import CameraResponse
from labrig.reproduce import (
    CARD_NAME,
    Assumptions,
    MaterialEntry,
    Scene,
    build_scene,
    camera_values,
    dark_room,
)
from labrig.results import RATE_SPECTRUM, Series

#: Gauss–Legendre nodes of an exposure, and their weights.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
NODES, WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2
#: Name of the rendering of the run's own material, and of that of Becquerel's law.
MEASURED, BECQUEREL = "measured", "Becquerel"
#: Names of laws that have no states: only their courses over time are shown.
STATELESS = {law.name: law.short_label for law in DECAY_LAWS.values() if not law.has_states} | {
    RATE_SPECTRUM: "spectrum"
}
#: Number of the scene's pictures of the glow, and paths that make smooth edges.
PICTURES, SMOOTH = 8, 16


@dataclass(frozen=True, eq=False)
class SeenPatch:
    """Camera values of a rendered patch: of the glow, and of the light that it or a card reflects.

    Attributes
    ----------
    glow
        Mean over each exposure, shape (n, C).
    reflected
        What was photographed under the lamp, and its rendering (C,); the sample before the card.
    """

    glow: FloatArray
    reflected: tuple[tuple[ReflectedLight, FloatArray], ...]


@dataclass(frozen=True, eq=False)
class SeenRoom:
    patches: Mapping[str, SeenPatch]
    notes: tuple[ResultWarning, ...]
    scene: DarkRoomScene


@dataclass(frozen=True, eq=False)
class FittedGlow:
    """Renderings of fits to a decay: means over the exposures and relative σ, by their names."""

    glow: Mapping[str, FloatArray]
    relative_sigma: Mapping[str, FloatArray]
    left_out: tuple[ResultWarning, ...]


class RenderedBench:
    """Renders the dark room with materials in it."""

    def __init__(
        self,
        room: PhotographedRoom,
        camera: CameraResponse,
        folder: Path,
        assumptions: Assumptions,
    ) -> None:
        self._room, self._camera = room, camera
        self._folder, self._assumptions = folder, assumptions
        self._picture = picture_of(room.layout)

    def measured(self, patches: Mapping[str, MeasuredPatch]) -> SeenRoom:
        """Render the run's materials, charged as the journal says, at all exposures."""
        room = self._room
        materials = {name: patch.material for name, patch in patches.items()}
        _require_known_light(materials, room)
        regions = {name: room.regions[name] for name in patches}
        programme = room.programme(list(materials.values()))
        scene = self._scene(materials, regions, programme, levels=0.0)
        times = {name: self._times(patch.series) for name, patch in patches.items()}
        lights = {name: room.sample_reflected(name) for name in patches}
        burning_s = room.burning_s()
        moments = [each.ravel() for each in times.values()]
        moments.append(np.array([burning_s]))
        moments += [np.array([light.at_s]) for light in lights.values() if light is not None]
        seen = self._seen(scene, regions, np.unique(np.concatenate(moments)))
        found = {}
        for name, patch in patches.items():
            reflected = []
            if (light := lights[name]) is not None and light.at_s is not None:
                reflected.append((light, seen[light.at_s][name]))
            if (card := room.card_reflected(patch.series)) is not None:
                # The card was photographed under a lamp that was warm.
                reflected.append((card, seen[burning_s][CARD_NAME] / scene.levels(burning_s)[0]))
            found[name] = SeenPatch(_exposed(seen, name, times[name]), tuple(reflected))
        glow_s = np.unique(np.concatenate([each.mean(axis=1) for each in times.values()]))
        shown = glow_s[np.unique(np.linspace(0, len(glow_s) - 1, PICTURES).astype(int))]
        after = [at_s for at_s in shown.tolist() if at_s > burning_s]
        paths = scene.file.paths.model_copy(update={"per_pixel": SMOOTH})
        file = scene.file.model_copy(update={"frames_s": (burning_s, *after), "paths": paths})
        return SeenRoom(found, scene.notes, DarkRoomScene(file, _files(materials)))

    def fitted(self, patch: MeasuredPatch, fits: Mapping[int, DecayFit]) -> FittedGlow:
        """Render what was fitted to the decay of a patch, its states full at lamp off.

        Laws without states have the colour of the rendered ones, and their own course over time.
        """
        series = patch.series
        left_out: list[ResultWarning] = []
        each: dict[str, tuple[tuple[State, ...], tuple[FloatArray, FloatArray]]] = {}
        for number, fit in fits.items():
            if fit.n_states != number:
                left_out.append(
                    Undetermined(
                        "states-unsupported",
                        "the decay does not support {requested} states",
                        patch.name,
                        requested=number,
                        supported=fit.n_states,
                    )
                )
                continue
            states = tuple(
                _full_state(patch.material, state.amplitude, state.k_r_per_s)
                for state in fit.states_at_lamp_off
            )
            each[predicted_by(number)] = (states, fit.signal(series.t_s, series.exposure_s))
        becquerel = next((law for law in fits[1].laws if law.name == "becquerel"), None)
        from_lamp_off = fits[1].reference.is_lamp_off
        if becquerel is not None and from_lamp_off and 0 < becquerel.shape <= 1 - 1 / MAX_ORDER:
            order = 1 / (1 - becquerel.shape)
            state = _full_state(
                patch.material, becquerel.amplitude, becquerel.rate_per_s / order, order
            )
            signal = becquerel.signal(series.t_s, series.exposure_s)
            each[BECQUEREL] = ((state,), signal)
        else:
            left_out.append(
                Misfit(
                    "no-kinetic-order",
                    "Becquerel's law fits with no kinetic order from above 1 to {most:g}",
                    patch.name,
                    most=MAX_ORDER,
                )
            )
        # All at once, side by side: nothing else lights them.
        regions = {
            prediction: (number / len(each), 0.0, 1 / len(each), 1.0)
            for number, prediction in enumerate(each)
        }
        materials = {
            prediction: patch.material.model_copy(update={"states": states})
            for prediction, (states, _) in each.items()
        }
        scene = self._scene(materials, regions, [(0.0, 0.0)], levels=1.0)
        times = series.t_s[:, None] + series.exposure_s[:, None] * NODES
        seen = self._seen(scene, regions, np.unique(times))
        glow = {prediction: _exposed(seen, prediction, times) for prediction in each}
        signals = {prediction: signal for prediction, (_, signal) in each.items()}
        colour = glow[predicted_by(1)].sum(axis=0)
        spectrum = fits[1].rate_spectrum
        for law in (*fits[1].laws, *(() if spectrum is None else (spectrum,))):
            if law.name in STATELESS:
                name = STATELESS[law.name]
                signals[name] = fits[1].signal(series.t_s, series.exposure_s, law.name)
                glow[name] = np.multiply.outer(signals[name][0], colour)
        return FittedGlow(
            glow,
            {
                prediction: np.sqrt(variance) / np.maximum(np.abs(signal), 1e-300)
                for prediction, (signal, variance) in signals.items()
            },
            tuple(left_out),
        )

    def _times(self, series: Series) -> FloatArray:
        """Return the nodes of the exposures on the room's clock, shape (n, nodes)."""
        off_s = np.array([self._room.off_s[unit] for unit in series.unit])
        return np.asarray((off_s + series.t_s)[:, None] + series.exposure_s[:, None] * NODES)

    def _scene(
        self,
        materials: Mapping[str, Material],
        regions: Mapping[str, Region],
        programme: Sequence[tuple[float, float]],
        levels: float,
    ) -> Scene:
        files = _files(materials)
        for name, material in files.items():
            write_material(self._folder / name, material)
        assumed = self._assumptions
        file = dark_room(
            "dark-room",
            {
                name: (
                    regions[name],
                    MaterialEntry(
                        file=file_name,
                        levels=levels,
                        assume_albedo=assumed.albedo,
                        assume_scale=assumed.scale,
                    ),
                )
                for name, file_name in zip(materials, files, strict=True)
            },
            self._room.lamp,
            programme,
            [programme[0][0]],
            self._picture,
            self._room.card,
        )
        return build_scene(file, self._folder)

    def _seen(
        self, scene: Scene, regions: Mapping[str, Region], times_s: FloatArray
    ) -> dict[float, dict[str, FloatArray]]:
        """Return the camera's values of each patch, and of the card, by time."""
        edges_nm = scene.bands.edges_nm
        light = rendered_light(scene, regions, self._picture, times_s)
        return {
            t_s: {
                name: camera_values(radiance, edges_nm, self._camera)
                for name, radiance in each.items()
            }
            for t_s, each in light.items()
        }


def _require_known_light(materials: Mapping[str, Material], room: PhotographedRoom) -> None:
    """Refuse glow in W beside light of which only the spectrum is known."""
    absolute = [each.name for each in materials.values() if each.scale == "absolute"]
    if absolute and not room.is_lux_read:
        raise UsageError(
            f"{absolute[0]}: the scale of its glow is absolute, and the lamp's illuminance is not "
            "known on this bench; read it with a luxmeter (luminance: under 'optics:' of the rig "
            "file, or illuminance_lux of labrig run irradiance)"
        )


def _files(materials: Mapping[str, Material]) -> dict[str, Material]:
    """Return materials by the names of their files."""
    return {f"material-{n}.yaml": each for n, each in enumerate(materials.values(), start=1)}


def _exposed(
    seen: Mapping[float, Mapping[str, FloatArray]], name: str, times_s: FloatArray
) -> FloatArray:
    """Return the mean over each exposure, whose nodes are a row of times, shape (n, C)."""
    values = np.array([[seen[t_s][name] for t_s in row] for row in times_s.tolist()])
    return np.asarray(np.einsum("k,nkc->nc", WEIGHTS, values))


def _full_state(
    material: Material, amplitude: float, k_r_per_s: float, order: float = 1.0
) -> State:
    """Return a state that is full at lamp off and then has an amplitude, in the material's colour.

    Λ has the mean spectrum of the material's states in its bands, Λ = a/k_r for r(0) = 1.
    """
    emitted = [state.reradiation for state in material.states if state.reradiation is not None]
    reradiation = None
    if emitted:
        shape = np.sum(emitted, axis=0)
        reradiation = tuple((amplitude / k_r_per_s * shape / shape.max()).tolist())
    return State(
        k_r_per_s=k_r_per_s,
        kinetic_order=order,
        amplitude=amplitude,
        r0=1.0,
        reradiation=reradiation,
    )
