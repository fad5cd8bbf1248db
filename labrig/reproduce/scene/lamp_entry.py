"""Lamps in a scene file."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.foundation.models import NotNegative
from labrig.reproduce.scene.scene_part import Name, ScenePart, Time, Vector


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
