"""A linear variable filter: mercury lines, then colour filters over a grey card.

After Nalbach et al., Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.2.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import Optics, ProtocolModel, RigFile, Unit
from labrig.quantity import Count, DurationS, WordOrDuration

from .lvf_units import (
    NO_FILTER,
    FilterUnit,
    LinesUnit,
    LvfFrames,
    StripesUnit,
    StripUnit,
    filter_unit,
)
from .steps.arrangement import Arrangement
from .steps.camera_settings import CameraSettings
from .steps.prepared import PutBackUnit
from .steps.scene_units import SceneUnit, StillDarkUnit
from .steps.still_life import StillLife

FilterName = Annotated[str, Field(min_length=1, pattern=r"^[^/\\]+$")]

_CARD = Arrangement("grey card")
_ON_SAMPLE = Arrangement("grey card", "on sample")
_BEFORE_CAMERA = Arrangement("grey card", "before camera")

#: Why a scene is arranged, by the purpose of its frames.
_WHY: dict[str, str] = {
    LvfFrames.CARD: "how bright the card is at every place by itself",
    LvfFrames.STRIP_ON_SAMPLE: "where the filter's strip falls on the sample",
    LvfFrames.FILTER: "what the variable filter passes follows from what colour filters take away",
    LvfFrames.LINES: "mercury lines tell the wavelength of every place",
    LvfFrames.LINES_ON_SAMPLE: "mercury lines tell the wavelength of every place on the sample",
    LvfFrames.STRIPES: "the stripes glow where the camera will see the sample",
}
#: Kind and name of a unit, purpose of its frames, what lies where, and the kind's own keys.
_Scene = tuple[type[SceneUnit], str, str, Arrangement, dict[str, Any]]


class LvfCalibration(ProtocolModel):
    """The calibration of an LVF; see `lvf_calibration.yaml` for what each key means."""

    protocol: Literal["lvf_calibration"] = "lvf_calibration"
    rising: bool | None = None
    rising_on_sample: bool | None = None
    filters: Literal["all"] | tuple[FilterName, ...] = "all"
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(2, ge=1)
    mercury_warm_up: DurationS = Field(300.0, ge=0)
    stripes: Annotated[float | Literal["none"], WordOrDuration("none")] = 600.0

    @model_validator(mode="after")
    def _each_filter_once(self) -> Self:
        names = self.filter_names()
        if twice := [name for name in names if names.count(name) > 1 or name == NO_FILTER]:
            raise ValueError(
                f"'{twice[0]}' in 'filters' stands twice; no filter at all comes first"
            )
        return self

    @property
    def still_life(self) -> StillLife:
        """How everything but the stripes is photographed."""
        return StillLife(self.camera, self.longest, self.repeats)

    def filter_names(self) -> tuple[str, ...]:
        """The colour filters, one after the other; `suited_to` no rig, all are the shipped ones."""
        return tuple(Optics().filter_files()) if self.filters == "all" else self.filters

    def suited_to(self, rig: RigFile) -> Self:
        """With the names of all filters that the rig file has curves of."""
        if self.filters != "all":
            return self
        return self.model_copy(update={"filters": tuple(rig.optics.filter_files())})

    def units(self) -> Sequence[Unit]:
        """All that can go wrong first: the strip and its lines; then filter by filter."""
        units: list[SceneUnit] = []
        for kind, name, purpose, wanted, more in self._scenes():
            before = units[-1].wanted if units else Arrangement()
            why, mercury_s = _WHY[purpose], self.mercury_warm_up
            units.append(
                kind(self.still_life, name, purpose, wanted, before, why, mercury_s, **more)
            )
        return [StillDarkUnit(self.still_life), *units, PutBackUnit(units[-1].wanted)]

    def _scenes(self) -> Iterator[_Scene]:
        none, strip = filter_unit(None), LvfFrames.STRIP_ON_SAMPLE
        yield SceneUnit, "card", LvfFrames.CARD, _CARD, {}
        yield StripUnit, "strip-on-sample", strip, _ON_SAMPLE, {}
        yield StripUnit, none, LvfFrames.FILTER, _BEFORE_CAMERA, {}
        lit = replace(_BEFORE_CAMERA, lamp="mercury")
        more = {"strip": (LvfFrames.FILTER, none), "rising": self.rising}
        yield LinesUnit, "lines", LvfFrames.LINES, lit, more
        lit = replace(_ON_SAMPLE, lamp="mercury")
        more = {"strip": (strip, "strip-on-sample"), "rising": self.rising_on_sample}
        yield LinesUnit, "lines-on-sample", LvfFrames.LINES_ON_SAMPLE, lit, more
        if isinstance(self.stripes, float):
            lit = replace(lit, stage="sample")
            yield StripesUnit, "stripes", LvfFrames.STRIPES, lit, {"charge_s": self.stripes}
        for name in self.filter_names():
            yield (
                FilterUnit,
                filter_unit(name),
                LvfFrames.FILTER,
                replace(_BEFORE_CAMERA, filter=name),
                {},
            )
