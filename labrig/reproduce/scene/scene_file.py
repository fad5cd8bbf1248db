"""The scene file: what stands where, of which materials, and which light shines when."""

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig import resources
from labrig.finite import Finite, NotNegative, Positive
from labrig.yaml_file import did_you_mean, read_model

#: Lengths in m and times in s that single precision and a person can still tell apart.
Length = Annotated[float, Field(gt=0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Time = Annotated[float, Field(ge=-1e9, le=1e9)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
FileName = Annotated[str, Field(pattern=r"^\w[\w .-]*$")]
Name = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=1, le=8192)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class BandsEntry(_Part):
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


class BenchLightEntry(_Part):
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


class AlbedoCurve(_Part):
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


class MaterialEntry(_Part):
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


class Waypoint(_Part):
    """Where something is at some time; in between it moves straight and evenly.

    Attributes
    ----------
    at_s
        Time in s.
    position_m
        Position in m.
    """

    at_s: Time
    position_m: Vector


class LampEntry(_Part):
    """A lamp.

    Attributes
    ----------
    kind
        Kind of the lamp: `point`, `area` (objects name it as their `lamp`), `distant` or `sky`.
    spectrum
        Spectrum: a CIE illuminant, a wavelength such as `450nm`, or a file.
    intensity_cd, luminance_cd_per_m2, illuminance_lux
        Strength of a point, of an area or the sky, of a distant lamp.
    intensity_w_per_sr, radiance_w_per_m2_sr, irradiance_w_per_m2
        The same, for a lamp that the eye does not see, over all its wavelengths.
    position_m, path
        Position of a point in m, or its way over time.
    towards
        Direction from the scene towards a distant lamp.
    """

    kind: Literal["point", "area", "distant", "sky"]
    spectrum: Name = "D65"
    intensity_cd: NotNegative | None = None
    luminance_cd_per_m2: NotNegative | None = None
    illuminance_lux: NotNegative | None = None
    intensity_w_per_sr: NotNegative | None = None
    radiance_w_per_m2_sr: NotNegative | None = None
    irradiance_w_per_m2: NotNegative | None = None
    position_m: Vector | None = None
    path: Annotated[tuple[Waypoint, ...], Field(min_length=2)] | None = None
    towards: Vector | None = None

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Self:
        names = STRENGTHS[self.kind]
        given = [name for name in _ALL_STRENGTHS if getattr(self, name) is not None]
        if len(given) != 1 or given[0] not in names:
            got = " and ".join(f"'{name}'" for name in given) or "none"
            raise ValueError(
                f"expected one of '{names[0]}' and '{names[1]}' for a lamp of kind {self.kind}, "
                f"got {got}"
            )
        if self.kind == "point" and (self.position_m is None) == (self.path is None):
            raise ValueError("expected either 'position_m' or 'path' for a lamp of kind point")
        if self.path is not None and any(b.at_s <= a.at_s for a, b in pairwise(self.path)):
            raise ValueError("expected times 'at_s' that rise along 'path'")
        if self.kind == "distant" and (self.towards is None or not any(self.towards)):
            raise ValueError("expected 'towards', a direction, for a lamp of kind distant")
        for name, kind in (("position_m", "point"), ("path", "point"), ("towards", "distant")):
            if getattr(self, name) is not None and self.kind != kind:
                raise ValueError(f"expected '{name}' for a lamp of kind {kind}, got {self.kind}")
        return self


#: Strength of each kind of lamp, to the eye and in W.
STRENGTHS = {
    "point": ("intensity_cd", "intensity_w_per_sr"),
    "area": ("luminance_cd_per_m2", "radiance_w_per_m2_sr"),
    "distant": ("illuminance_lux", "irradiance_w_per_m2"),
    "sky": ("luminance_cd_per_m2", "radiance_w_per_m2_sr"),
}
_ALL_STRENGTHS = tuple(sorted({name for names in STRENGTHS.values() for name in names}))


class RectangleEntry(_Part):
    """A parallelogram, whose front is where edge_u × edge_v points to.

    Attributes
    ----------
    corner_m, edge_u_m, edge_v_m
        A corner, and the two edges from it, in m.
    parts
        Parts along each edge, for one that waves.
    """

    corner_m: Vector
    edge_u_m: Vector
    edge_v_m: Vector
    parts: Annotated[int, Field(ge=1, le=1000)] = 1


class DiskEntry(_Part):
    """A disk.

    Attributes
    ----------
    centre_m, normal, radius_m
        Centre in m, direction of its front, radius in m.
    """

    centre_m: Vector
    normal: Vector
    radius_m: Length

    @model_validator(mode="after")
    def _has_a_front(self) -> Self:
        if not any(self.normal):
            raise ValueError("expected a direction as 'normal', got [0, 0, 0]")
        return self


class BoxEntry(_Part):
    """A box.

    Attributes
    ----------
    centre_m, size_m
        Centre, and lengths of the edges, in m.
    turned_deg
        Turn about the vertical (z) in degrees.
    inward
        Whether its front is inside, as of a room.
    """

    centre_m: Vector
    size_m: tuple[Length, Length, Length]
    turned_deg: Finite = 0.0
    inward: bool = False


class SphereEntry(_Part):
    """A sphere.

    Attributes
    ----------
    centre_m, radius_m
        Centre and radius in m.
    inward
        Whether its front is inside.
    """

    centre_m: Vector
    radius_m: Length
    inward: bool = False


class MeshEntry(_Part):
    """A mesh from a file.

    Attributes
    ----------
    file
        OBJ, PLY, glTF or STL file, relative to the scene's.
    size_m
        Factor from the file's unit to m.
    turned_deg
        Turns about x, y and z, in this order, in degrees.
    position_m
        Where its origin is, in m.
    inward
        Whether its front is inside.
    """

    file: Name
    size_m: Length = 1.0
    turned_deg: Vector = (0.0, 0.0, 0.0)
    position_m: Vector = (0.0, 0.0, 0.0)
    inward: bool = False


class ParticlesEntry(_Part):
    """Particles on their ways, each with states of its own; they are small octahedra.

    Attributes
    ----------
    file
        File (.npz) with the times `t_s` and `position_m` (times, particles, 3), between which they
        move straight; relative to the scene's.
    radius_m
        Radius of a particle in m.
    """

    file: Name
    radius_m: Length


class Wave(_Part):
    """A wave that runs over a surface and moves it along its own front's direction.

    Attributes
    ----------
    amplitude_m
        Amplitude in m.
    wavelength
        Length of the wave as a part of the surface's first edge.
    period_s
        Period in s.
    """

    amplitude_m: Length
    wavelength: Positive = 1.0
    period_s: Positive


class MaterialMap(_Part):
    """A picture whose colours say which material is where.

    Attributes
    ----------
    file
        Picture, relative to the scene's file; its upper left is where u is 0 and v is 1.
    materials
        Material of each colour, written as `#rrggbb`; every pixel has the nearest of them.
    """

    file: Name
    materials: Annotated[dict[str, Name], Field(min_length=1)]


class ObjectEntry(_Part):
    """An object: one shape, of a material, or a lamp.

    Attributes
    ----------
    rectangle, disk, box, sphere, mesh, particles
        Its shape, one of them.
    material
        Name of its material.
    material_map
        Picture that says where which material is, instead of `material`; needs texels.
    lamp
        Name of the lamp of kind area that it is, instead of a material.
    samples
        Where a phosphor has states of its own: texels, `[columns, rows]`, or `vertices`. Default:
        64 × 64 texels where there are texture coordinates, else vertices.
    two_sided
        Whether its back has the same material; else the back is black. A phosphor is then a thin
        sheet: light on either side charges the same states.
    wave
        How the surface moves.
    vertices_over_time
        File (.npz) with `t_s` and `vertices_m` (times, vertices, 3), between which vertices move
        straight.
    """

    rectangle: RectangleEntry | None = None
    disk: DiskEntry | None = None
    box: BoxEntry | None = None
    sphere: SphereEntry | None = None
    mesh: MeshEntry | None = None
    particles: ParticlesEntry | None = None
    material: Name | None = None
    material_map: MaterialMap | None = None
    lamp: Name | None = None
    samples: tuple[Count, Count] | Literal["vertices"] | None = None
    two_sided: bool = False
    wave: Wave | None = None
    vertices_over_time: Name | None = None

    @model_validator(mode="after")
    def _is_one_thing(self) -> Self:
        for names in (SHAPES, ("material", "material_map", "lamp")):
            given = [name for name in names if getattr(self, name) is not None]
            if len(given) != 1:
                got = " and ".join(f"'{name}'" for name in given) or "none of them"
                raise ValueError(f"expected one of {', '.join(names)}, got {got}")
        if self.particles is not None and (self.samples or self.material is None):
            raise ValueError("expected 'particles' of one 'material' and without 'samples'")
        if self.wave is not None and (self.rectangle is None or self.rectangle.parts < LEAST_PARTS):
            raise ValueError(f"expected 'wave' with a rectangle of {LEAST_PARTS} 'parts' or more")
        if self.lamp is not None and self.two_sided:
            raise ValueError("expected a lamp without 'two_sided': it shines from its front")
        if self.wave is not None and self.vertices_over_time is not None:
            raise ValueError("expected either 'wave' or 'vertices_over_time', got both")
        return self


#: Parts of a rectangle of which a wave can be seen.
LEAST_PARTS = 8
SHAPES = ("rectangle", "disk", "box", "sphere", "mesh", "particles")


class CameraEntry(_Part):
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


class DisplayEntry(_Part):
    """How pictures are shown on a screen.

    Attributes
    ----------
    white
        Light in which a white surface looks white: a CIE illuminant, or a file with a spectrum.
        Colours under another one than D65, the screen's, are adapted by Bradford's transform.
    exposure
        `each`, so that each picture is bright; `common`, one for all; or the luminance in cd/m²
        that is white.
    """

    white: Name = "D65"
    exposure: Literal["each", "common"] | Positive = "each"


class ProgrammeEntry(_Part):
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


class PathsEntry(_Part):
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


class SceneFile(_Part):
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
    lamps: dict[str, LampEntry] = {}
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
