"""The dark room of a run, rendered through the measured camera, beside its photographs.

What is compared is glow over reflected light: the photographs' by the settings of the camera, the
rendering's by the measured curves, whose channels have the ratios of the card under the lamp. The
dark room of the run's material is charged by the lamp as the journal says; beside it are the sums
of one, two and three exponentials and Becquerel's law that were fitted to the decay, whose
brightness is fitted, too.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from labrig.acquire import read_rig_file
from labrig.bench_optics import with_shipped_camera
from labrig.compare.glow import GlowComparison, compare_scaled, glow_sigma, predicted_by
from labrig.compare.nalbach2017 import emission
from labrig.compare.photographed_room import SAMPLE, PhotographedRoom, ReflectedLight
from labrig.compare.residuals import Refit, fits_by_states
from labrig.compare.run import MeasuredPatch, measured_camera, read_patches, references_by_patch
from labrig.compare.viewing import DEFAULT_WHITE, FloatArray, Viewing, viewing
from labrig.errors import DataError, UsageError
from labrig.fit import DecayFit
from labrig.material import MAX_ORDER, Material, State, write_material
from labrig.optics import CameraResponse
from labrig.record import read_run
from labrig.region import Region
from labrig.reproduce import (
    CARD_NAME,
    Assumptions,
    DarkRoomPicture,
    MaterialEntry,
    Renderer,
    Scene,
    SceneFile,
    build_scene,
    camera_values,
    dark_room,
)
from labrig.results import Series, read_result
from labrig.yaml_file import yaml_text

#: Height of the frame in the rendering; its light is even on every sample.
HEIGHT_PX, MOST_PX = 32, 512
#: Gauss–Legendre nodes of an exposure, and their weights.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
NODES, WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2
#: Name of the rendering of the run's own material, and of that of Becquerel's law.
MEASURED, BECQUEREL = "measured", "Becquerel"
#: Name of the scene's file, number of its pictures of the glow, and paths that make smooth edges.
SCENE_FILE, PICTURES, SMOOTH = "dark-room.yaml", 8, 16
NOTHING_ASSUMED = Assumptions()
#: Lightness of the photographed patch.
LIGHTNESS = 50.0


@dataclass(frozen=True, eq=False)
class GlowRatio:
    """Glow over reflected light in one channel, photographed and rendered.

    Attributes
    ----------
    channel
        Name of the channel, in which the glow is brightest.
    reflected_by
        What was lit by the lamp: the sample or the grey card.
    photographed, photographed_sigma
        Ratio of each photograph and σ, shape (n,).
    rendered, rendered_sigma
        Ratio of each rendering by name and σ by the σ of its material or fit, shape (n,).
    """

    channel: str
    reflected_by: str
    photographed: FloatArray
    photographed_sigma: FloatArray
    rendered: Mapping[str, FloatArray]
    rendered_sigma: Mapping[str, FloatArray]

    def excess(self, name: str) -> FloatArray:
        """Return rendered over photographed ratio − 1, shape (n,)."""
        return np.asarray(self.rendered[name] / self.photographed - 1)

    def in_sigma(self, name: str) -> FloatArray:
        """Return the difference of the two ratios in σ, shape (n,)."""
        sigma = np.hypot(self.photographed_sigma, self.rendered_sigma[name])
        return np.asarray((self.rendered[name] - self.photographed) / sigma)


@dataclass(frozen=True, eq=False)
class RenderedPatch:
    """A patch, photographed and rendered.

    Attributes
    ----------
    each
        Comparison in which every photograph has L* = 50, and its rendering the same factor.
    common
        Comparison in which one factor for all brings the brightest photograph to L* = 50.
    ratio
        Glow over reflected light.
    """

    each: GlowComparison
    common: GlowComparison
    ratio: GlowRatio


@dataclass(frozen=True, eq=False)
class DarkRoomScene:
    """The dark room of a run as a scene of `labrig render`.

    Attributes
    ----------
    file
        The scene, with pictures under the lamp and of the glow.
    materials
        Materials by the names under which the scene names their files.
    """

    file: SceneFile
    materials: Mapping[str, Material]

    def write(self, folder: Path) -> Path:
        """Write scene and materials into a folder, and return the path of the scene."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, material in self.materials.items():
            write_material(folder / name, material)
        path = folder / SCENE_FILE
        content = self.file.model_dump(mode="json", exclude_none=True)
        path.write_text(yaml_text(content), encoding="utf-8")
        return path


@dataclass(frozen=True, eq=False)
class RenderedComparison:
    """The dark room of a run, rendered beside its photographs.

    Attributes
    ----------
    patches
        All patches.
    description
        How it was compared, for people.
    notes
        What was assumed, one sentence each.
    left_out
        Renderings that are not possible, with the reason.
    scene
        The dark room with the measured materials; None if no patch could be compared.
    """

    patches: tuple[RenderedPatch, ...]
    description: str
    notes: tuple[str, ...]
    left_out: tuple[str, ...]
    scene: DarkRoomScene | None = None


def compare_rendered(
    folder: Path,
    refit: Refit,
    materials: Sequence[str] = (),
    assumptions: Assumptions = NOTHING_ASSUMED,
    white: str = DEFAULT_WHITE,
    camera: str | None = None,
) -> RenderedComparison:
    """Render the dark room of a run at its exposures, and compare it with the photographs.

    Parameters
    ----------
    folder
        Run folder with a result.
    refit
        Function that fits a series with a given number of states and a given relative flicker.
    materials
        Materials that take the place of the run's own, as `MATERIAL` or `PATCH=MATERIAL`, by
        shipped name or path: those of a run that measured more than this one.
    assumptions
        Albedo and scale to assume where the material has none.
    white
        CIE illuminant that is the white of CIELAB, such as `D65`.
    camera
        Camera curves that replace those with which the run was processed, by shipped name or path.

    Returns
    -------
    RenderedComparison
        Colours and ratios of all photographs of the glow.

    Raises
    ------
    UsageError
        A measurement is missing without which nothing can be rendered: camera curves, lamp,
        reflected light, emission spectrum, albedo or scale.
    DataError
        There is no result, or it is damaged.

    References
    ----------
    Nalbach, Seidel, Ritschel, "Practical Capture and Reproduction of Phosphorescent Appearance"
    (2017), section 5.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.compare import compare_rendered
    >>> def refit(series, states, flicker):
    ...     return labrig.fit_series(series, states, flicker=flicker)
    >>> compared = compare_rendered(Path("runs/phosphor"), refit)  # doctest: +SKIP
    >>> compared.patches[0].each.mean("measured") < 2  # doctest: +SKIP
    True
    """
    patches = read_patches(folder)
    given = references_by_patch(materials, list(patches))
    patches = {
        name: replace(patch, material=_completed(given.get(name, patch.material)))
        for name, patch in patches.items()
    }
    curves, reasons = measured_camera(folder, camera)
    if curves is None:
        raise UsageError(f"the dark room cannot be rendered: {reasons[0]}")
    rig = with_shipped_camera(read_rig_file(folder / "rig.yaml"), read_run(folder).camera_identity)
    room = PhotographedRoom.of(folder, rig, read_result(folder))
    own = _own_names(patches, room)
    with tempfile.TemporaryDirectory() as place:
        bench = _Bench(room, curves, Path(place), assumptions)
        measured = bench.measured({own[name]: patch for name, patch in patches.items()})
        conversion = viewing(curves, white)
        compared, left_out, notes = [], [], list(measured.notes)
        for name, patch in patches.items():
            try:
                fits = fits_by_states(patch.series, patch.flicker, refit)
                fitted = bench.fitted(patch, fits)
            except DataError as error:
                left_out.append(f"{name} is left out: {error}")
                continue
            left_out += fitted.left_out
            compared.append(
                _compare(
                    patch,
                    measured.patches[own[name]],
                    fitted,
                    conversion,
                    room,
                    is_same_camera=camera is None,
                )
            )
    return RenderedComparison(
        tuple(compared),
        _description(conversion, [each.ratio.reflected_by for each in compared], room, left_out),
        tuple(dict.fromkeys(notes)),
        tuple(left_out),
        measured.scene if compared else None,
    )


def _completed(material: Material) -> Material:
    """Return the material with Λ of states whose level, and therefore Λ, its file leaves open.

    Level, rates and Λ of such a state have a common scale that its charge does not tell, and that
    its glow after the same charge does not depend on: Λ k_r r(0)ᵇ is its amplitude.
    """
    emitted = [state.reradiation for state in material.states if state.reradiation is not None]
    if not emitted or material.irradiance_norm is None:
        return material
    spectrum, bands_nm = emission(material), material.bands_nm
    assert spectrum is not None
    shape = np.asarray(spectrum.in_bands(bands_nm or ()))
    states = []
    for state in material.states:
        light = state.k_r_per_s * (state.r0 or 0.0) ** state.kinetic_order
        if state.reradiation is None and state.amplitude is not None and light > 0:
            reradiation = tuple((state.amplitude / light * shape).tolist())
            state = state.model_copy(update={"reradiation": reradiation})
        states.append(state)
    return material.model_copy(update={"states": tuple(states)})


def _own_names(patches: Mapping[str, MeasuredPatch], room: PhotographedRoom) -> dict[str, str]:
    """Return the names that patches have in the decay's result: the only one has its sample's."""
    if len(patches) == 1 and len(room.regions) == 1:
        return dict(zip(patches, room.regions, strict=True))
    if missing := sorted(set(patches) - set(room.regions)):
        raise DataError(f"the region of {missing[0]} is not known; process the run again")
    return {name: name for name in patches}


@dataclass(frozen=True, eq=False)
class _SeenPatch:
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
class _Seen:
    patches: Mapping[str, _SeenPatch]
    notes: tuple[str, ...]
    scene: DarkRoomScene


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Renderings of fits to a decay: means over the exposures and relative σ, by their names."""

    glow: Mapping[str, FloatArray]
    relative_sigma: Mapping[str, FloatArray]
    left_out: tuple[str, ...]


class _Bench:
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
        aspect = room.layout.width / room.layout.height
        width_px = min(max(round(HEIGHT_PX * aspect), 1), MOST_PX)
        self._picture = DarkRoomPicture(width_px, max(round(width_px / aspect), 8))

    def measured(self, patches: Mapping[str, MeasuredPatch]) -> _Seen:
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
            found[name] = _SeenPatch(_exposed(seen, name, times[name]), tuple(reflected))
        glow_s = np.unique(np.concatenate([each.mean(axis=1) for each in times.values()]))
        shown = glow_s[np.unique(np.linspace(0, len(glow_s) - 1, PICTURES).astype(int))]
        after = [at_s for at_s in shown.tolist() if at_s > burning_s]
        paths = scene.file.paths.model_copy(update={"per_pixel": SMOOTH})
        file = scene.file.model_copy(update={"frames_s": (burning_s, *after), "paths": paths})
        return _Seen(found, scene.notes, DarkRoomScene(file, _files(materials)))

    def fitted(self, patch: MeasuredPatch, fits: Mapping[int, DecayFit]) -> _Fitted:
        """Render what was fitted to the decay of a patch, its states full at lamp off."""
        series, left_out = patch.series, []
        each: dict[str, tuple[tuple[State, ...], tuple[FloatArray, FloatArray]]] = {}
        for number, fit in fits.items():
            if fit.n_states != number:
                left_out.append(f"{patch.name}: the decay does not support {number} states")
                continue
            states = tuple(
                _full_state(patch.material, state.amplitude, state.k_r_per_s)
                for state in fit.states
            )
            each[predicted_by(number)] = (states, fit.signal(series.t_s, series.exposure_s))
        becquerel = next((law for law in fits[1].laws if law.name == "becquerel"), None)
        if becquerel is not None and 0 < becquerel.shape <= 1 - 1 / MAX_ORDER:
            order = 1 / (1 - becquerel.shape)
            state = _full_state(
                patch.material, becquerel.amplitude, becquerel.rate_per_s / order, order
            )
            signal = becquerel.signal(series.t_s, series.exposure_s)
            each[BECQUEREL] = ((state,), signal)
        else:
            left_out.append(
                f"{patch.name}: Becquerel's law fits with no kinetic order from above 1 to "
                f"{MAX_ORDER:g}"
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
        return _Fitted(
            {prediction: _exposed(seen, prediction, times) for prediction in each},
            {
                prediction: np.sqrt(variance) / np.maximum(np.abs(signal), 1e-300)
                for prediction, (_, (signal, variance)) in each.items()
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
        renderer, edges_nm = Renderer(scene, threads=1), scene.bands.edges_nm
        pixels = {name: self._pixel(region) for name, region in regions.items()}
        if CARD_NAME in scene.file.objects:
            pixels[CARD_NAME] = (-1, self._picture.width_px // 2)
        rows, columns = np.transpose(list(pixels.values()))
        seen = {}
        for t_s in times_s.tolist():
            radiance = renderer.frame(t_s).radiance[rows, columns]
            values = camera_values(radiance, edges_nm, self._camera)
            seen[t_s] = dict(zip(pixels, values, strict=True))
        return seen

    def _pixel(self, region: Region) -> tuple[int, int]:
        """Return row and column of the pixel in the middle of a region."""
        x, y, wide, high = region
        return (
            int((y + high / 2) * self._picture.height_px),
            int((x + wide / 2) * self._picture.width_px),
        )


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


def _compare(
    patch: MeasuredPatch,
    measured: _SeenPatch,
    fitted: _Fitted,
    conversion: Viewing,
    room: PhotographedRoom,
    *,
    is_same_camera: bool,
) -> RenderedPatch:
    """Compare photographs of a patch with the renderings, in the photographs' unit."""
    series = patch.series
    if not measured.reflected:
        raise UsageError(
            f"{patch.name}: expected a photograph of reflected light beside the glow, got none; "
            "photograph the sample under the lamp (daylight: true), or behind a door the grey card "
            "(labrig run irradiance)"
        )
    # The channels' ratios are those of the card under the known lamp.
    white, as_rendered = measured.reflected[-1]
    gain = white.values / as_rendered
    rendered = {MEASURED: gain * measured.glow}
    own = glow_sigma(patch.material, series, is_same_camera=is_same_camera)
    if measured.reflected[0][0].name == SAMPLE:
        own = np.hypot(own, _albedo_sigma(patch.material))
    sigma = {MEASURED: own}
    for name, glow in fitted.glow.items():
        values = gain * glow
        rendered[name] = values * (np.sum(values * series.values) / np.sum(values**2))
        sigma[name] = fitted.relative_sigma[name]
    luminance = np.maximum(series.values @ conversion.to_xyz[1], 1e-300)
    target = ((LIGHTNESS + 16) / 116) ** 3
    brightest = np.full_like(luminance, luminance.max())
    each, common = (
        compare_scaled(series, rendered, conversion, patch.flicker, target / factor[:, None])
        for factor in (luminance, brightest)
    )
    light, lit = measured.reflected[0]
    return RenderedPatch(each, common, _ratio(patch, light, gain * lit, rendered, sigma, room))


def _albedo_sigma(material: Material) -> float:
    """Return the relative σ of the light that a material reflects, the mean over its albedo."""
    albedo = material.albedo
    if albedo is None or albedo.sigma is None:
        return 0.0
    return float(np.sum(albedo.sigma) / np.sum(albedo.value))


def _ratio(
    patch: MeasuredPatch,
    light: ReflectedLight,
    reference: FloatArray,
    rendered: Mapping[str, FloatArray],
    sigma: Mapping[str, FloatArray],
    room: PhotographedRoom,
) -> GlowRatio:
    """Return glow over reflected light in the channel in which the glow is brightest."""
    series = patch.series
    channel = int(np.argmax(series.values.sum(axis=0)))
    photographed = series.values[:, channel] / light.values[channel]
    noise = np.nan_to_num(series.sigma[:, channel]) / light.values[channel]
    shutter = np.array([room.shutter_sigma(exposure_s) for exposure_s in series.exposure_s])
    common = np.sqrt(patch.flicker**2 + light.relative_sigma**2 + shutter**2)
    ratios = {name: values[:, channel] / reference[channel] for name, values in rendered.items()}
    return GlowRatio(
        channel=series.channels[channel],
        reflected_by=light.name,
        photographed=photographed,
        photographed_sigma=np.hypot(noise, common * np.abs(photographed)),
        rendered=ratios,
        rendered_sigma={name: sigma[name] * np.abs(ratio) for name, ratio in ratios.items()},
    )


def _description(
    conversion: Viewing,
    reflected_by: Sequence[str],
    room: PhotographedRoom,
    left_out: Sequence[str],
) -> str:
    by = " and ".join(dict.fromkeys(reflected_by))
    sentences = [
        "The dark room is rendered at the exposures of the photographs, in bands of 10 nm; its "
        f"light is that of the lamp as {by} reflects it in the photographs.",
        f"'{MEASURED}': the measured material, charged as the journal says; the others: fits to "
        "the decay, whose brightness is fitted, too.",
        f"CIELAB: {conversion.source}.",
        f"ΔE is CIEDE2000 with L* = {LIGHTNESS:g} of every photograph, and with one exposure for "
        "all, the brightest at that; a rendering has the factor of its photograph.",
        *_unread(room),
        *(f"Left out: {reason}." for reason in left_out),
    ]
    return " ".join(sentences)


def _unread(room: PhotographedRoom) -> tuple[str, ...]:
    """Return a sentence on the lamp's illuminance, where none was read."""
    if room.is_lux_read:
        return ()
    return (
        f"The illuminance of the lamp was not read; {room.lamp.illuminance_lux:g} lx are taken, on "
        "which absolute luminances of the scene depend, but no ratio.",
    )
