"""The dark room of a run: its lamp and when it burned, its card, where the samples lay."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import BaseModel

from labrig.acquire import RigFile
from labrig.bench_optics import calibration, illuminance_lx
from labrig.calibration import (
    CAMERA_KIND,
    FADE_KIND,
    IRRADIANCE_KIND,
    CalibrationKind,
    CameraFile,
    CardLight,
    FadeFile,
    IrradianceFile,
    flicker_of,
    relative_sensitivity,
    shutter_sigma,
)
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.output_file import make_folder, write_text
from labrig.foundation.region import Region, region_pixels
from labrig.foundation.yaml_file import yaml_text
from labrig.material import Material, ReradiationMatrix, write_fluorescent, write_material
from labrig.optics import Spectrum
from labrig.record import FrameRole, RunRecord, read_run
from labrig.reduce import SensorLayout, SeriesFrame, reduce_patches, sensor_layout
from labrig.reproduce import CARD_NAME, DarkRoomLamp, DarkRoomPicture, Renderer, Scene, SceneFile
from labrig.results import ChainResult, ResultWithDecays, RunResult, Series, write_csv

#: Height of the frame in the rendering; its light is even on every sample.
HEIGHT_PX, MAX_PX = 32, 512
#: Name of the scene's file.
SCENE_FILE = "dark-room.yaml"


@dataclass(frozen=True, eq=False)
class DarkRoomScene:
    """The dark room of a run as a scene of `labrig render`.

    Attributes
    ----------
    file
        The scene, with pictures under the lamp and of the glow.
    materials
        Materials by the names under which the scene names their files.
    lights
        Spectra of lamps that are files of the scene's own, by the names of these.
    """

    file: SceneFile
    materials: Mapping[str, Material | ReradiationMatrix]
    lights: Mapping[str, Spectrum] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Write scene, materials and lights into a folder, and return the path of the scene."""
        make_folder(folder)
        for name, material in self.materials.items():
            if isinstance(material, Material):
                write_material(folder / name, material)
            else:
                write_fluorescent(folder / name, material)
        for name, light in self.lights.items():
            pairs = zip(light.wavelength_nm, light.value, strict=True)
            rows = [(f"{nm:.9g}", f"{value:.9g}") for nm, value in pairs]
            write_csv(folder / name, ("wavelength_nm", "value"), rows)
        path = folder / SCENE_FILE
        content = self.file.model_dump(mode="json", exclude_none=True)
        write_text(path, yaml_text(content))
        return path


def fractions_of(region: Region, layout: SensorLayout) -> Region:
    """Return a region in fractions of the frame."""
    x, y, wide, high = region_pixels(region, layout.width, layout.height)
    return (x / layout.width, y / layout.height, wide / layout.width, high / layout.height)


def picture_of(layout: SensorLayout) -> DarkRoomPicture:
    """Return a small picture with the aspect of a sensor."""
    aspect = layout.width / layout.height
    width_px = min(max(round(HEIGHT_PX * aspect), 1), MAX_PX)
    return DarkRoomPicture(width_px, max(round(width_px / aspect), 8))


def rendered_light(
    scene: Scene, regions: Mapping[str, Region], picture: DarkRoomPicture, times_s: FloatArray
) -> dict[float, dict[str, FloatArray]]:
    """Return the spectral radiance (bands,) of each sample, and of the card, by time in s."""
    renderer = Renderer(scene, threads=1)
    pixels = {name: _pixel(region, picture) for name, region in regions.items()}
    if CARD_NAME in scene.file.objects:
        pixels[CARD_NAME] = (-1, picture.width_px // 2)
    rows, columns = np.transpose(list(pixels.values()))
    seen = {}
    for t_s in times_s.tolist():
        radiance = renderer.frame(t_s).radiance[rows, columns]
        seen[t_s] = dict(zip(pixels, radiance, strict=True))
    return seen


def _pixel(region: Region, picture: DarkRoomPicture) -> tuple[int, int]:
    """Return row and column of the pixel in the middle of a region."""
    x, y, wide, high = region
    return int((y + high / 2) * picture.height_px), int((x + wide / 2) * picture.width_px)


FileT = TypeVar("FileT", bound=BaseModel)

#: Illuminance where none was read; what is compared does not depend on it.
ANY_LUX = 1000.0
#: Steps of the lamp's fade, and the light that is left when they end.
FADE_STEPS, DARK = 12, 1e-3
#: Edges of the steps in which the lamp's housing warms, in its time constants.
WARMING_STEPS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)
#: Names of what was photographed under the lamp.
SAMPLE, CARD = "the sample", "the grey card"


@dataclass(frozen=True, eq=False)
class ReflectedLight:
    """Light of something under the lamp, in DN/s at the settings of the glow's photographs.

    Attributes
    ----------
    name
        `SAMPLE` or `CARD`.
    values
        Signal of each channel, shape (C,).
    relative_sigma
        Relative σ, with that of the ratio of the settings.
    at_s
        Middle of the photograph in s on the room's clock; None of the card.
    """

    name: str
    values: FloatArray
    relative_sigma: float
    at_s: float | None


@dataclass(frozen=True, eq=False)
class PhotographedRoom:
    """The dark room of a run; its clock begins at the lamp off of the first decay.

    Attributes
    ----------
    lamp
        The lamp.
    card
        Path of the grey card's reflectance; None if the rig file names none.
    card_light
        Light of the card in the irradiance calibration; None if it is not known.
    camera
        Calibration of the camera; None takes nominal settings.
    layout
        Size of the frame.
    regions
        Region of each patch as fractions of the frame, by the name in the decay's result.
    switches
        Times in s of the lamp's switches, rising, and whether it went on.
    off_s
        Time in s of the lamp off before each decay, by its unit.
    is_lux_read
        Whether the lamp's illuminance was read from a meter.
    """

    lamp: DarkRoomLamp
    card: str | None
    card_light: CardLight | None
    camera: CameraFile | None
    layout: SensorLayout
    regions: Mapping[str, Region]
    switches: tuple[tuple[float, bool], ...]
    off_s: Mapping[str, float]
    is_lux_read: bool
    _fade: FadeFile | None
    _run: RunRecord
    _began_s: float

    @classmethod
    def of(cls, folder: Path, rig: RigFile, result: RunResult) -> "PhotographedRoom":
        """Read the room of a processed run.

        Raises
        ------
        UsageError
            The rig file does not name the lamp's spectrum.
        DataError
            The run has no photographs of a decay, or the journal no lamp off before them.
        """
        run, decay = _decay(folder, result)
        if rig.optics.lamp is None:
            raise UsageError(
                f"rig '{rig.name}': expected the spectrum of the lamp, by which the dark room is "
                "lit; name its curve under 'optics:', such as 'lamp: halogen_3000k'"
            )
        off_s = dict(_lamps_off(run))
        if not off_s:
            raise DataError(f"{folder}: the journal does not say when the lamp went off")
        began_s = min(off_s.values())
        layout = sensor_layout(_untimed(run, FrameRole.DECAY)[0])
        provided = result.provides()
        irradiance = _calibration(provided, rig, IRRADIANCE_KIND)
        lux = _lux(rig, irradiance)
        return cls(
            lamp=DarkRoomLamp(str(resources.curve_path(rig.optics.lamp)), lux or ANY_LUX),
            card=None
            if rig.optics.grey_card is None
            else str(resources.curve_path(rig.optics.grey_card)),
            card_light=None if irradiance is None else irradiance.card,
            camera=_calibration(provided, rig, CAMERA_KIND),
            layout=layout,
            regions={
                name: fractions_of(patch.region, layout)
                for name, patch in decay.patches.items()
                if patch.region is not None
            },
            switches=tuple((at_s - began_s, is_on) for at_s, is_on in _switches(run)),
            off_s={unit: at_s - began_s for unit, at_s in off_s.items()},
            is_lux_read=lux is not None,
            _fade=_calibration(provided, rig, FADE_KIND),
            _run=run,
            _began_s=began_s,
        )

    def programme(self, materials: Sequence[Material]) -> list[tuple[float, float]]:
        """Return time and level of the lamp, whose warm-up and fade are steps.

        A scene's lamp fades at all wavelengths alike: the level is that of the light that excites
        these materials.
        """
        steps: list[tuple[float, float]] = []
        fade, warmth, before_s = self._fade_steps(materials), 0.0, self.switches[0][0]
        ends = [at_s for at_s, _ in self.switches[1:]] + [np.inf]
        for (at_s, is_on), end_s in zip(self.switches, ends, strict=True):
            warmth = self._warmth_after(warmth, at_s - before_s, is_on=not is_on)
            changes = self._warming_steps(warmth) if is_on else fade
            steps += [(at_s + late, level) for late, level in changes if at_s + late < end_s]
            before_s = at_s
        return steps

    def _warmth_after(self, warmth: float, elapsed_s: float, *, is_on: bool) -> float:
        """Return the warmth of the lamp's housing, 0 to 1, which follows its switches."""
        if self._fade is None or self._fade.warming is None:
            return 1.0
        kept = np.exp(-elapsed_s / self._fade.warming.time_constant_s)
        return float(is_on + (warmth - is_on) * kept)

    def _warming_steps(self, warmth: float) -> list[tuple[float, float]]:
        """Return times after lamp on and levels from then on, the last one 1."""
        if self._fade is None or self._fade.warming is None:
            return [(0.0, 1.0)]
        warming = self._fade.warming
        deficit, edges = warming.deficit * (1 - warmth), np.array(WARMING_STEPS)
        means = -np.diff(np.exp(-edges)) / np.diff(edges)
        times_s = edges * warming.time_constant_s
        return [
            *zip(times_s[:-1].tolist(), (1 - deficit * means).tolist(), strict=True),
            (float(times_s[-1]), 1.0),
        ]

    def _fade_steps(self, materials: Sequence[Material]) -> list[tuple[float, float]]:
        """Return times after lamp off and levels from then on, the last one 0."""
        rated = [
            material
            for material in materials
            if material.bands_nm is not None
            and any(state.k_e_per_s is not None for state in material.states)
        ]
        if self._fade is None or not rated:
            return [(0.0, 0.0)]
        levels = []
        for material in rated:
            t_s, fraction = self._fade.in_bands(self._fade.fade, material.bands_nm or ())
            rates = [state.k_e_per_s for state in material.states if state.k_e_per_s is not None]
            weight = np.sum(rates, axis=0)
            levels.append(fraction @ (weight / max(weight.sum(), 1e-30)))
        level = np.mean(levels, axis=0)
        lit = np.flatnonzero(level > DARK)
        end_s = float(t_s[min(lit[-1] + 1, len(t_s) - 1)]) if len(lit) else 0.0
        if not end_s > 0:
            return [(0.0, 0.0)]
        edges = np.linspace(0.0, end_s, FADE_STEPS + 1)
        knots = np.union1d(edges, t_s[t_s < end_s])
        at_knots = np.interp(knots, t_s, level)
        whole = np.r_[0.0, np.cumsum(np.diff(knots) * (at_knots[1:] + at_knots[:-1]) / 2)]
        means = np.diff(np.interp(edges, knots, whole)) / np.diff(edges)
        return [*zip(edges[:-1].tolist(), means.tolist(), strict=True), (end_s, 0.0)]

    def card_reflected(self, series: Series) -> ReflectedLight | None:
        """Return the light of the card at the settings of a series; None if it is not known."""
        light = self.card_light
        if self.card is None or light is None or light.channels != series.channels:
            return None
        gain, sigma = relative_sensitivity(
            self.camera, _settings(series), (light.iso, light.f_number)
        )
        values = np.array(light.dn_per_s)
        noise = float(np.max(np.array(light.sigma_dn_per_s) / values))
        return ReflectedLight(CARD, values * gain, float(np.hypot(noise, sigma)), None)

    def sample_reflected(self, patch: str) -> ReflectedLight | None:
        """Return the light of a patch under the lamp; None if it was not photographed.

        It is that of the longest exposure in which the patch does not clip.
        """
        frames = _untimed(self._run, FrameRole.DAYLIGHT)
        if not frames:
            return None
        darks = _untimed(self._run, FrameRole.DARK)
        region = {patch: self.regions[patch]}
        lit = reduce_patches(frames, region, darks, camera=self.camera)[patch]
        usable = np.flatnonzero(lit.usable)
        if not len(usable):
            return None
        best = int(usable[np.argmax(lit.exposure_s[usable])])
        record = next(
            frame
            for frame in self._run.frames(FrameRole.DAYLIGHT)
            if frame.path.name == lit.frame[best]
        )
        noise = float(np.max(np.nan_to_num(lit.sigma[best]) / lit.values[best]))
        flicker = flicker_of(self.camera)
        return ReflectedLight(
            SAMPLE,
            lit.values[best],
            float(
                np.hypot(np.hypot(noise, flicker), shutter_sigma(self.camera, record.exposure_s))
            ),
            (record.start_time + record.end_time) / 2 - self._began_s,
        )

    def burning_s(self) -> float:
        """Return a time in s at which the lamp burns, before the first decay."""
        for (on_s, is_on), (off_s, _) in pairwise(self.switches):
            if is_on and off_s <= 1e-6:
                burning_s = max((on_s + off_s) / 2, off_s - 1.0)
        return burning_s


def _decay(folder: Path, result: RunResult) -> tuple[RunRecord, ResultWithDecays]:
    """Return the run, or the part of a chain, that photographed a decay, and its result."""
    run = read_run(folder)
    if isinstance(result, ResultWithDecays):
        return run, result
    if isinstance(result, ChainResult):
        decays = {
            name: part for name, part in result.parts.items() if isinstance(part, ResultWithDecays)
        }
        samples = sorted({name.rpartition("/")[0] for name in decays})
        if len(samples) > 1:
            raise DataError(
                f"{folder}: expected a run of one sample, got {', '.join(samples)}; the glow of "
                "several samples in turn is not rendered"
            )
        for name, part in decays.items():
            return run.part(name), part
    raise DataError(
        f"{folder}: expected a run with a decay, got none; the glow of other runs is not rendered"
    )


def _switches(run: RunRecord) -> Iterator[tuple[float, bool]]:
    """Yield time in seconds since 1970 and state of the lamp's switches."""
    for attempt in run.completed().values():
        for action in attempt.actions:
            if action.device == "lamp" and action.action in ("on", "off"):
                yield action.middle_time, action.action == "on"


def _lamps_off(run: RunRecord) -> Iterator[tuple[str, float]]:
    """Yield units with a decay and the time of the lamp off before it, in seconds since 1970."""
    for unit, attempt in run.completed().items():
        glow = [frame.start_time for frame in attempt.frames if frame.role == FrameRole.DECAY]
        off = [
            action.middle_time
            for action in attempt.actions
            if action.device == "lamp" and action.action == "off"
            if action.start_time <= min(glow, default=-np.inf)
        ]
        if off:
            yield unit, off[-1]


def _untimed(run: RunRecord, role: str) -> list[SeriesFrame]:
    return [
        SeriesFrame(
            frame.path, 0.0, frame.exposure_s, frame.iso, frame.f_number, frame.unit,
            sha256=frame.sha256,
        )
        for frame in run.frames(role)
    ]  # fmt: skip


def _calibration(
    provided: Mapping[str, object], rig: RigFile, kind: CalibrationKind[FileT]
) -> FileT | None:
    """Return a calibration that the run made, else the one that its rig file names."""
    found = provided.get(kind.name)
    return found if isinstance(found, kind.model) else calibration(rig, kind)


def _lux(rig: RigFile, irradiance: IrradianceFile | None) -> float | None:
    """Return the reading of a luxmeter at the sample; None without one."""
    if irradiance is not None and irradiance.illuminance_lux is not None:
        return irradiance.illuminance_lux
    return None if rig.optics.luminance is None else illuminance_lx(rig)


def _settings(series: Series) -> tuple[float, float | None]:
    f_number = float(series.f_number[0])
    return float(series.iso[0]), None if np.isnan(f_number) else f_number
