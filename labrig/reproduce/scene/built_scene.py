"""A scene ready to be rendered: its file with materials, meshes and lamps in place."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import beside
from labrig.foundation.yaml_file import did_you_mean, validate
from labrig.optics import Spectrum, read_light
from labrig.reproduce.scene.placed_objects import surface_over_time
from labrig.reproduce.scene.scene_file import (
    DisplayEntry,
    ProgrammeEntry,
    SceneFile,
    read_scene,
)
from labrig.reproduce.scene.scene_lamps import bench_light, placed_lamp
from labrig.reproduce.scene.scene_materials import (
    NOTHING_ASSUMED,
    Assumptions,
    replaced_entries,
    scene_material,
)
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.surface_material import BenchLight, SurfaceMaterial
from labrig.reproduce.transport.geometry import Geometry, Surface
from labrig.reproduce.transport.lamp import Lamp
from labrig.reproduce.transport.tracing import PathLength, Pinhole

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
    def notes(self) -> tuple[str, ...]:
        """What was assumed or is missing, one sentence each, after the names of the materials."""
        of: dict[str, list[str]] = {}
        for material in self.materials:
            for note in material.notes:
                of.setdefault(note, []).append(material.name)
        return tuple(f"{', '.join(names)}: {note}" for note, names in of.items())

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
