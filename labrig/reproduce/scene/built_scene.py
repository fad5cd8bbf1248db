"""A scene ready to be rendered: materials, meshes and lamps of its file, in bands and in place."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import beside
from labrig.foundation.result_warning import ResultWarning
from labrig.foundation.yaml_file import did_you_mean, validate
from labrig.material import Albedo, Material, read_any_material, read_mixture
from labrig.optics import (
    Spectrum,
    Transmittance,
    absolute_irradiance,
    read_colour_chart,
    read_light,
    read_transmittance,
)
from labrig.reproduce.scene.entries import STRENGTHS, LampEntry
from labrig.reproduce.scene.placed_objects import surface_over_time
from labrig.reproduce.scene.scene_file import (
    AlbedoCurve,
    DisplayEntry,
    MaterialEntry,
    ProgrammeEntry,
    SceneFile,
    read_scene,
)
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.parameter_texture import read_parameter_texture
from labrig.reproduce.surface.surface_material import (
    BenchLight,
    SurfaceMaterial,
    of_albedo,
    of_matrix,
    of_mixture,
    of_phosphor,
)
from labrig.reproduce.transport.geometry import Geometry, Surface
from labrig.reproduce.transport.lamp import Lamp
from labrig.reproduce.transport.tracing import PathLength, Pinhole

#: Part of a lamp's brightest band by which noise may make another negative.
NOISE_OF_LAMP = 0.01


def bench_light(file: SceneFile, folder: Path) -> BenchLight:
    """Return the light by which phosphors of a scene were measured."""
    light = file.bench_light
    spectrum = read_light(beside(light.spectrum, folder))
    return BenchLight(absolute_irradiance(light.illuminance_lux, spectrum))


def placed_lamp(name: str, entry: LampEntry, bands: Bands, folder: Path, t_s: float) -> Lamp:
    """Return a lamp at a time in s, at its full strength."""
    of_eye, of_watt = STRENGTHS[entry.kind]
    strength = getattr(entry, of_eye)
    is_to_eye = strength is not None
    unit = _unit_light(beside(entry.spectrum, folder), bands, is_to_eye)
    if unit.min() < -NOISE_OF_LAMP * unit.max():
        worst = bands.centre_nm[int(np.argmin(unit))]
        raise UsageError(
            f"lamp {name}: expected a spectrum ≥ 0, got a negative one at {worst:g} nm in "
            f"'{entry.spectrum}'"
        )
    unit = np.maximum(unit, 0.0)
    light = unit * (strength if is_to_eye else getattr(entry, of_watt))
    if not light.any() and strength != 0:
        raise UsageError(
            f"lamp {name}: expected light between {bands.edges_nm[0]:g} and "
            f"{bands.edges_nm[-1]:g} nm, got none in '{entry.spectrum}'"
        )
    vector = entry.position_m or (0.0, 0.0, 1.0)
    if entry.path is not None:
        times = [point.at_s for point in entry.path]
        places = np.array([point.position_m for point in entry.path])
        x, y, z = (float(np.interp(t_s, times, column)) for column in places.T)
        vector = x, y, z
    if entry.towards is not None:
        x, y, z = (np.array(entry.towards) / np.linalg.norm(entry.towards)).tolist()
        vector = x, y, z
    return Lamp(name, entry.kind, light, vector)


@lru_cache(maxsize=64)
def _unit_light(named: str, bands: Bands, is_to_eye: bool) -> FloatArray:
    """Return a spectrum in the bands of one scene, of 1 lm or of 1 W; read once for all times."""
    spectrum = read_light(named)
    if is_to_eye:
        return absolute_irradiance(1.0, spectrum).in_bands(bands.edges_nm)
    whole = float(np.trapezoid(spectrum.value, spectrum.wavelength_nm))
    if not whole > 0:
        raise UsageError(f"{named}: expected the spectrum of a lamp, got one without light")
    return np.asarray(bands.means(spectrum) / whole)


@dataclass(frozen=True)
class Assumptions:
    """Assumptions that replace a measurement that is missing.

    Attributes
    ----------
    albedo
        Albedo of phosphors whose file has none.
    scale
        Factor from Λ to s sr⁻¹ of phosphors whose file has none.
    """

    albedo: float | None = None
    scale: float | None = None


NOTHING_ASSUMED = Assumptions()


def replaced_entries(
    entries: Mapping[str, MaterialEntry], replaced: Mapping[str, str], folder: Path
) -> dict[str, tuple[MaterialEntry, Path]]:
    """Return entries with the folders of their files, those replaced by the user's."""
    if unknown := set(replaced) - set(entries):
        raise UsageError(
            f"expected a material of the scene ({', '.join(entries)}), got '{min(unknown)}'"
        )
    return {
        name: (
            (
                entry.model_copy(
                    update={
                        "file": replaced[name],
                        "albedo": None,
                        "chart_patch": None,
                        "mixture": None,
                        "texture": None,
                    }
                ),
                Path(),
            )
            if name in replaced
            else (entry, folder)
        )
        for name, entry in entries.items()
    }


def scene_material(
    name: str,
    entry: MaterialEntry,
    folder: Path,
    bands: Bands,
    bench: BenchLight,
    assumptions: Assumptions,
) -> SurfaceMaterial:
    stored = None if entry.mixture is None else read_mixture(folder / entry.mixture)
    albedo = _reflectance(entry, folder)
    if albedo is not None:
        if stored is None or not entry.is_fluorescent:
            return of_albedo(name, albedo, bands)
        return of_mixture(name, stored, albedo, bands)
    assert entry.file is not None
    material = read_any_material(beside(entry.file, folder))
    if stored is not None:
        if isinstance(material, Material):
            raise UsageError(
                f"{name}: expected 'file' to be a measured matrix, whose reflectance the 'mixture' "
                f"needs, got the phosphor {material.name}"
            )
        if entry.is_fluorescent:
            return _named(name, of_mixture(material.name, stored, material, bands))
    if not isinstance(material, Material):
        if entry.texture is not None:
            raise UsageError(
                f"{name}: expected a phosphor for 'texture', got the matrix {material.name}"
            )
        if not entry.is_fluorescent:
            material = replace(material, reradiation=np.zeros_like(material.reradiation))
        return _named(name, of_matrix(material, bands))
    assumed, scale = entry.assume_albedo, entry.assume_scale
    phosphor = of_phosphor(
        material,
        bands,
        bench,
        assumed if assumptions.albedo is None else assumptions.albedo,
        scale if assumptions.scale is None else assumptions.scale,
        entry.prompt,
        None if entry.texture is None else read_parameter_texture(folder / entry.texture),
    )
    return _named(name, phosphor)


def _reflectance(entry: MaterialEntry, folder: Path) -> Albedo | Transmittance | float | None:
    """Return the reflectance that a scene gives a material, None of one that its file has."""
    if entry.chart_patch is not None:
        return read_colour_chart("colorchecker")[entry.chart_patch - 1]
    if isinstance(entry.albedo, str):
        return read_transmittance(beside(entry.albedo, folder))
    if isinstance(entry.albedo, AlbedoCurve):
        return Albedo(**entry.albedo.model_dump())
    return entry.albedo


def _named(name: str, material: SurfaceMaterial) -> SurfaceMaterial:
    """Return a material with its name in the scene before its own."""
    if name == material.name:
        return material
    return replace(material, name=f"{name} ({material.name})")


#: White of a screen in sRGB.
SCREEN_WHITE = "D65"


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene.

    Attributes
    ----------
    file
        Content of the scene file.
    bands
        Bands of the rendering.
    materials
        Materials by the numbers that surfaces name.
    """

    file: SceneFile
    bands: Bands
    materials: tuple[SurfaceMaterial, ...]
    _surfaces: tuple[Callable[[float], Surface], ...] = field(repr=False)
    _folder: Path = field(repr=False)

    @property
    def notes(self) -> tuple[ResultWarning, ...]:
        """Warnings about values that were assumed or are missing, about the named materials."""
        of: dict[ResultWarning, list[str]] = {}
        for material in self.materials:
            for note in material.notes:
                of.setdefault(note, []).append(material.name)
        return tuple(note.about(", ".join(names)) for note, names in of.items())

    @property
    def is_moving(self) -> bool:
        """Whether an object or a lamp moves."""
        return self.file.is_moving

    @property
    def camera(self) -> Pinhole:
        """The camera."""
        return Pinhole(**self.file.camera.model_dump())

    @property
    def bench_light(self) -> BenchLight:
        """Light by which measured phosphors were charged."""
        return bench_light(self.file, self._folder)

    @property
    def white(self) -> Spectrum | None:
        """Light in which a white surface looks white on the screen; None for D65, the screen's."""
        named = self.file.display.white
        return None if named == SCREEN_WHITE else read_light(beside(named, self._folder))

    @property
    def path_length(self) -> PathLength:
        """How paths end."""
        return PathLength(self.file.paths.vertices, self.file.paths.survival)

    def resized(
        self, width_px: int | None = None, height_px: int | None = None, paths: int | None = None
    ) -> Self:
        """Return the scene with a picture of another size, or another number of paths.

        Parameters
        ----------
        width_px, height_px
            Size of the picture; None keeps it.
        paths
            Paths for each pixel and for each place of a phosphor; None keeps them.
        """
        size = {"width_px": width_px, "height_px": height_px}
        fineness = {"per_pixel": paths, "per_place": paths}
        changed = {
            name: getattr(self.file, name).model_copy(
                update={key: value for key, value in new.items() if value is not None}
            )
            for name, new in (("camera", size), ("paths", fineness))
        }
        return replace(self, file=self.file.model_copy(update=changed))

    def displayed(self, white: str | None = None, exposure: str | float | None = None) -> Self:
        """Return the scene with pictures that are shown in another way.

        Parameters
        ----------
        white, exposure
            As the `display` of a scene has them, `white` relative to the current folder if it is a
            file; None keeps them.

        Raises
        ------
        UsageError
            There is no such light or exposure.
        """
        content = self.file.display.model_dump()
        if white is not None:
            content["white"] = beside(white, Path.cwd())
        if exposure is not None:
            content["exposure"] = exposure
        display = validate(content, DisplayEntry, "--white" if exposure is None else "--exposure")
        shown = replace(self, file=self.file.model_copy(update={"display": display}))
        _ = shown.white
        return shown

    def at_times(self, frames_s: Sequence[float]) -> Self:
        """Return the scene with pictures at other times in s, which rise.

        Raises
        ------
        UsageError
            They do not rise, or the first is before the programme.
        """
        content = self.file.model_dump(exclude_unset=True)
        content["frames_s"] = tuple(frames_s)
        return replace(self, file=validate(content, SceneFile, "--times"))

    def with_material(self, name: str, material: SurfaceMaterial) -> Self:
        """Return the scene with another material in place of one, on the same surfaces.

        Raises
        ------
        UsageError
            There is no such material, or one of both glows and the other does not.
        """
        names = list(self.file.materials)
        if name not in names:
            raise UsageError(f"there is no material '{name}'; {did_you_mean(name, names)}")
        number = names.index(name)
        if (material.parameters is None) != (self.materials[number].parameters is None):
            raise UsageError(f"{name}: expected a material with states like the one that it is for")
        changed = (*self.materials[:number], material, *self.materials[number + 1 :])
        return replace(self, materials=changed)

    def with_programme(self, programme: Sequence[ProgrammeEntry]) -> Self:
        """Return the scene with other light over time, and one picture when it begins.

        Raises
        ------
        UsageError
            There is none, its times do not rise, or it names a lamp that is not there.
        """
        content = self.file.model_dump(exclude_unset=True)
        content["programme"] = [part.model_dump() for part in programme]
        content["frames_s"] = [part.at_s for part in programme][:1]
        return replace(self, file=validate(content, SceneFile, self.file.name))

    def surfaces(self, t_s: float) -> tuple[Surface, ...]:
        """Return the objects at a time in s, in the order of the scene."""
        return tuple(surface(t_s) for surface in self._surfaces)

    def geometry(self, t_s: float) -> Geometry:
        """Return all triangles at a time in s."""
        return Geometry.of(self.surfaces(t_s))

    def lamps(self, t_s: float) -> tuple[Lamp, ...]:
        """Return the lamps at a time in s, at their full strength."""
        return tuple(
            placed_lamp(name, entry, self.bands, self._folder, t_s)
            for name, entry in self.file.lamps.items()
        )

    def levels(self, t_s: float) -> FloatArray:
        """Return the level of each lamp from a time in s on, shape (lamps,)."""
        levels = dict.fromkeys(self.file.lamps, 0.0)
        for part in self.file.programme:
            if part.at_s <= t_s:
                levels.update(part.lamps)
        return np.array(list(levels.values()))


def load_scene(
    name_or_path: str | Path,
    replaced: Mapping[str, str] | None = None,
    assumptions: Assumptions = NOTHING_ASSUMED,
) -> Scene:
    """Read a scene and all that it names.

    Parameters
    ----------
    name_or_path
        Scene file, or the name of a shipped scene.
    replaced
        Files of materials that take the place of the scene's, by the names of the materials;
        relative to the current folder.
    assumptions
        What is taken for true where a measurement is missing, instead of what the scene says.

    Returns
    -------
    Scene
        The scene, ready for a `Renderer`.

    Raises
    ------
    UsageError, DataError
        A file is missing or malformed, or does not fit.

    Examples
    --------
    >>> from labrig.reproduce import Assumptions, load_scene
    >>> scene = load_scene("cornell-box", assumptions=Assumptions(albedo=0.8, scale=0.2))
    >>> len(scene.bands), scene.is_moving
    (24, False)
    """
    file, folder = read_scene(name_or_path)
    return build_scene(file, folder, replaced, assumptions)


def build_scene(
    file: SceneFile,
    folder: Path,
    replaced: Mapping[str, str] | None = None,
    assumptions: Assumptions = NOTHING_ASSUMED,
    made: Mapping[str, SurfaceMaterial] | None = None,
) -> Scene:
    """Return the scene of a file's content; see `load_scene`.

    Parameters
    ----------
    file
        Content of the scene file.
    folder
        Folder to which its paths are relative.
    replaced, assumptions
        As of `load_scene`.
    made
        Materials in the bands of the scene that take the place of the scene's, by their names.

    Returns
    -------
    Scene
        The scene, ready for a `Renderer`.

    Raises
    ------
    UsageError, DataError
        A file that it names is missing or malformed, or does not fit.

    Examples
    --------
    >>> from labrig.reproduce import build_scene, read_scene
    >>> file, folder = read_scene("cornell-box")
    >>> wide = file.model_copy(update={"frames_s": (0.0, 1.0, 2.0)})
    >>> build_scene(wide, folder).file.frames_s
    (0.0, 1.0, 2.0)
    """
    bands = Bands.even(file.bands.first_nm, file.bands.last_nm, file.bands.count)
    bench = bench_light(file, folder)
    entries = replaced_entries(file.materials, replaced or {}, folder)
    given = made or {}
    materials = tuple(
        given[name]
        if name in given
        else scene_material(name, entry, place, bands, bench, assumptions)
        for name, (entry, place) in entries.items()
    )
    numbers = {name: number for number, name in enumerate(entries)}
    lamps = {name: number for number, name in enumerate(file.lamps)}
    surfaces = tuple(
        surface_over_time(name, entry, folder, numbers, lamps, materials)
        for name, entry in file.objects.items()
    )
    scene = Scene(file, bands, materials, surfaces, folder)
    # What a camera or a lamp cannot be is refused before a folder is made for the pictures.
    _ = scene.camera, scene.white, scene.lamps(file.programme[0].at_s)
    return scene
