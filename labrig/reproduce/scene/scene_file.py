"""The scene file: what stands where, of which materials, and which light shines when."""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.foundation import resources
from labrig.foundation.models import NotNegative, Positive
from labrig.foundation.yaml_file import did_you_mean, read_model
from labrig.reproduce.scene.entries import (
    Count,
    LampEntry,
    Name,
    ObjectEntry,
    ScenePart,
    Time,
    Vector,
)

FileName = Annotated[str, Field(pattern=r"^\w[\w .-]*$")]


class BandsEntry(ScenePart):
    """Wavelength bands of the rendering.

    Attributes
    ----------
    first_nm, last_nm
        First and last edge in nm.
    count
        Number of bands.
    """

    first_nm: Positive = 300.0
    last_nm: Positive = 780.0
    count: Annotated[int, Field(ge=2, le=500)] = 24


class BenchLightEntry(ScenePart):
    """Light of the bench by which phosphors were charged: their rates and Λ are relative to it.

    Attributes
    ----------
    spectrum
        Its spectrum: a CIE illuminant, a wavelength such as `450nm`, or a file.
    illuminance_lux
        Its illuminance at the sample in lux.
    """

    spectrum: Name = "A"
    illuminance_lux: Positive = 1000.0


class AlbedoCurve(ScenePart):
    """Albedo over wavelength.

    Attributes
    ----------
    wavelength_nm
        Rising wavelengths in nm.
    value
        Albedo at each of them.
    """

    wavelength_nm: Annotated[tuple[Positive, ...], Field(min_length=2)]
    value: tuple[Annotated[float, Field(ge=0, le=1)], ...]

    @model_validator(mode="after")
    def _same_lengths(self) -> Self:
        if len(self.value) != len(self.wavelength_nm):
            raise ValueError(
                f"expected {len(self.wavelength_nm)} values as there are wavelengths, got "
                f"{len(self.value)}"
            )
        if any(right <= left for left, right in pairwise(self.wavelength_nm)):
            raise ValueError("expected wavelengths that rise")
        return self


class MaterialEntry(ScenePart):
    """A material: a measured one by its file, or an albedo.

    Attributes
    ----------
    file
        Material file, its path relative to the scene's, or the name of a shipped material.
    albedo
        Albedo of a surface that only reflects: a number, a curve, or the name of a file with a
        reflectance.
    mixture
        File with a mixture that stands for the re-radiation (`fit.json` of `labrig fit mixture`),
        beside what has the reflectance: `albedo`, `chart_patch`, or `file`, a measured matrix.
    chart_patch
        Number of a patch of the ColorChecker, 1 to 24, whose reflectance the surface has.
    assume_albedo
        Albedo to assume for a phosphor whose file has none.
    assume_scale
        Factor from Λ to s sr⁻¹ to assume for a phosphor whose file has no scale.
    is_fluorescent
        Whether a measured re-radiation matrix is used whole; else its reflectance only, to see what
        re-radiation contributes.
    texture
        File (.npz) with parameters of a phosphor that differ from place to place, which take the
        place of those in `file`: any of `k_r_per_s`, `k_e_per_s`, `reradiation` and
        `albedo_factor`.
    prompt
        Part of the captures that find their trap filled and emit at once, 0 to 1.
    levels
        Levels of the states at the beginning: a number for all, or `charged` for those which the
        light of the first programme entry reaches after a long time.
    """

    file: str | None = None
    albedo: Annotated[float, Field(ge=0, lt=1)] | AlbedoCurve | str | None = None
    mixture: Name | None = None
    chart_patch: Annotated[int, Field(ge=1, le=24)] | None = None
    assume_albedo: Annotated[float, Field(ge=0, lt=1)] | None = None
    assume_scale: Positive | None = None
    is_fluorescent: bool = True
    texture: Name | None = None
    prompt: Annotated[float, Field(ge=0, le=1)] = 0.0
    levels: Annotated[float, Field(ge=0, le=1)] | Literal["charged"] = 0.0

    @model_validator(mode="after")
    def _is_one_thing(self) -> Self:
        given = [
            name for name in ("file", "albedo", "chart_patch") if getattr(self, name) is not None
        ]
        if len(given) != 1:
            got = " and ".join(f"'{name}'" for name in given) or "none of them"
            raise ValueError(f"expected one of 'file', 'albedo' and 'chart_patch', got {got}")
        if self.texture is not None and (self.file is None or self.mixture is not None):
            raise ValueError("expected 'texture' beside the 'file' of a phosphor")
        return self


class CameraEntry(ScenePart):
    """A pinhole camera.

    Attributes
    ----------
    position_m, look_at_m
        Where it is, and a point in the middle of its picture, in m.
    up
        Direction that is upwards in the picture.
    vertical_fov_deg
        Angle from the lower to the upper edge of the picture, in degrees.
    width_px, height_px
        Size of the picture.
    """

    position_m: Vector
    look_at_m: Vector
    up: Vector = (0.0, 0.0, 1.0)
    vertical_fov_deg: Annotated[float, Field(gt=0, lt=170)] = 40.0
    width_px: Count = 256
    height_px: Count = 256


class DisplayEntry(ScenePart):
    """Display of pictures on a screen.

    Attributes
    ----------
    white
        Light in which a white surface looks white: a CIE illuminant, or a file with a spectrum.
        Colours under another one than D65, the screen's, are adapted by Bradford's transform.
    exposure
        Exposure: `each`, so that each picture is bright; `common`, one for all; or the luminance
        in cd/m² that is white.
    """

    white: Name = "D65"
    exposure: Literal["each", "common"] | Positive = "each"


class ProgrammeEntry(ScenePart):
    """From when on which lamps shine how strongly.

    Attributes
    ----------
    at_s
        Time in s.
    lamps
        Level of each lamp, as a factor of its strength; lamps that are not named keep theirs.
        Before the first entry all are off.
    """

    at_s: Time
    lamps: dict[str, NotNegative]


class PathsEntry(ScenePart):
    """How finely light is traced.

    Attributes
    ----------
    per_pixel
        Paths for each pixel.
    per_place
        Paths for each texel or vertex of a phosphor.
    vertices
        Vertices that every path has; roulette decides from there on.
    survival
        Probability of a path to go on; 0 ends all after `vertices`.
    seed
        Seed of the random numbers.
    """

    per_pixel: Annotated[int, Field(ge=1, le=65536)] = 64
    per_place: Annotated[int, Field(ge=1, le=65536)] = 64
    vertices: Annotated[int, Field(ge=1, le=64)] = 4
    survival: Annotated[float, Field(ge=0, lt=1)] = 0.75
    seed: Annotated[int, Field(ge=0)] = 1


class SceneFile(ScenePart):
    """A scene.

    Attributes
    ----------
    name
        Name of the scene, also that of the folder of its pictures.
    kind
        Kind of the file: `scene`.
    bands
        Wavelength bands.
    bench_light
        Light by which phosphors were measured.
    materials, lamps, objects
        Materials, lamps and objects by their names.
    camera
        The camera.
    programme
        Which lamps shine when, in order of time.
    frames_s
        Times of the pictures in s, rising.
    step_s
        Longest step in s; needed where an object or a lamp moves.
    paths
        How finely light is traced.
    display
        How pictures are shown.
    """

    name: FileName
    kind: Literal["scene"]
    bands: BandsEntry = BandsEntry()
    bench_light: BenchLightEntry = BenchLightEntry()
    materials: Annotated[dict[str, MaterialEntry], Field(min_length=1)]
    lamps: dict[str, LampEntry] = Field(default_factory=dict)
    objects: Annotated[dict[str, ObjectEntry], Field(min_length=1)]
    camera: CameraEntry
    programme: Annotated[tuple[ProgrammeEntry, ...], Field(min_length=1)]
    frames_s: Annotated[tuple[Time, ...], Field(min_length=1)]
    step_s: Positive | None = None
    paths: PathsEntry = PathsEntry()
    display: DisplayEntry = DisplayEntry()

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        for name, entry in self.objects.items():
            used = [entry.material] if entry.material else []
            if entry.material_map is not None:
                used += list(entry.material_map.materials.values())
            for material in used:
                _must_be_known(f"objects.{name}", "material", material, list(self.materials))
            if entry.lamp is None:
                continue
            areas = [each for each, lamp in self.lamps.items() if lamp.kind == "area"]
            _must_be_known(f"objects.{name}", "lamp of kind area", entry.lamp, areas)
        used_lamps = {entry.lamp for entry in self.objects.values()}
        for name, lamp_entry in self.lamps.items():
            if lamp_entry.kind == "area" and name not in used_lamps:
                raise ValueError(f"lamps.{name}: expected an object that is this lamp, got none")
        if sum(entry.kind == "sky" for entry in self.lamps.values()) > 1:
            raise ValueError("expected at most one lamp of kind sky")
        for number, part in enumerate(self.programme):
            for lamp in part.lamps:
                _must_be_known(f"programme.{number}", "lamp", lamp, list(self.lamps))
        return self

    @property
    def is_moving(self) -> bool:
        """Whether an object or a lamp moves."""
        return any(
            entry.wave is not None
            or entry.vertices_over_time is not None
            or entry.particles is not None
            for entry in self.objects.values()
        ) or any(lamp.path is not None for lamp in self.lamps.values())

    @model_validator(mode="after")
    def _steps_follow_what_moves(self) -> Self:
        if self.is_moving and self.step_s is None:
            raise ValueError("expected 'step_s', the longest step in s, since something moves")
        return self

    @model_validator(mode="after")
    def _times_rise(self) -> Self:
        for name, times in (
            ("programme", [part.at_s for part in self.programme]),
            ("frames_s", list(self.frames_s)),
        ):
            if any(right <= left for left, right in pairwise(times)):
                raise ValueError(f"expected times that rise in '{name}', got {times}")
        if self.frames_s[0] < self.programme[0].at_s:
            raise ValueError(
                f"expected the first frame at or after the programme begins "
                f"({self.programme[0].at_s:g} s), got {self.frames_s[0]:g} s"
            )
        return self


def read_scene(name_or_path: str | Path) -> tuple[SceneFile, Path]:
    """Read a scene file, or a shipped one by its name.

    Parameters
    ----------
    name_or_path
        Path of a scene file, or the name of a shipped scene such as `cornell-box`.

    Returns
    -------
    tuple
        The file's content, and the folder to which its paths are relative.

    Raises
    ------
    UsageError
        There is no such scene, or its file is malformed.

    Examples
    --------
    >>> from labrig.reproduce import read_scene
    >>> scene, folder = read_scene("cornell-box")
    >>> len(scene.objects) > 5
    True
    """
    path = resources.find("config/scenes", "scene", name_or_path)
    return read_model(path, SceneFile), path.parent


def _must_be_known(where: str, what: str, name: str, known: list[str]) -> None:
    if name not in known:
        raise ValueError(f"{where}: there is no {what} '{name}'; {did_you_mean(name, known)}")
