"""Entries of a scene file: lamps; objects with their shapes, movements and materials."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive

#: Lengths in m and times in s that single precision and a person can still tell apart.
Length = Annotated[float, Field(gt=0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Time = Annotated[float, Field(ge=-1e9, le=1e9)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
Name = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=1, le=8192)]


class ScenePart(FrozenModel):
    """A part of a scene file, which has no other keys than those it names."""


class Waypoint(ScenePart):
    """Position of something at some time; in between it moves straight and evenly.

    Attributes
    ----------
    at_s
        Time in s.
    position_m
        Position in m.
    """

    at_s: Time
    position_m: Vector


class LampEntry(ScenePart):
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


class RectangleEntry(ScenePart):
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


class DiskEntry(ScenePart):
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


class BoxEntry(ScenePart):
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


class SphereEntry(ScenePart):
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


class MeshEntry(ScenePart):
    """A mesh from a file.

    Attributes
    ----------
    file
        OBJ, PLY, glTF or STL file, relative to the scene's. Its materials, normals, lines and
        points are left out.
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


class ParticlesEntry(ScenePart):
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


class Wave(ScenePart):
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


class MaterialMap(ScenePart):
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


class ObjectEntry(ScenePart):
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
        if self.wave is not None and (self.rectangle is None or self.rectangle.parts < MIN_PARTS):
            raise ValueError(f"expected 'wave' with a rectangle of {MIN_PARTS} 'parts' or more")
        if self.lamp is not None and self.two_sided:
            raise ValueError("expected a lamp without 'two_sided': it shines from its front")
        if self.wave is not None and self.vertices_over_time is not None:
            raise ValueError("expected either 'wave' or 'vertices_over_time', got both")
        return self


#: Parts of a rectangle of which a wave can be seen.
MIN_PARTS = 8
SHAPES = ("rectangle", "disk", "box", "sphere", "mesh", "particles")
