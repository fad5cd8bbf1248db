"""A linear variable filter: mercury lines, then colour filters over a grey card.

After Nalbach et al., Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.2.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    CAMERA,
    Optics,
    RigFile,
    Session,
    TakeFrame,
    TimedAction,
    at,
)
from labrig.foundation.quantity import Count, DurationS, WordOrDuration
from labrig.optics import read_transmittance
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
    light,
)
from labrig.protocols.steps.bracketing import Bracketing, SceneUnit, StillDarkUnit, frames_of
from labrig.protocols.steps.camera_settings import MARGIN_S, CameraSettings
from labrig.protocols.steps.sample_pose import charge, face_lamp, lights_out, visible_after_s
from labrig.protocols.steps.strip_scenes import NO_FILTER, LvfFrames, StripUnit, filter_unit

#: Shutter times of the stripes' photographs, as fractions of the longest.
STRIPES_LADDER = (1 / 512, 1 / 64, 1 / 8, 1)


@dataclass(frozen=True)
class LinesUnit(SceneUnit):
    """The strip under a mercury lamp.

    Attributes
    ----------
    strip
        Role and unit of the frames of the strip under a halogen lamp.
    rising
        Whether wavelengths should rise from left to right; None: either way.
    """

    strip: tuple[str, str] = ("", "")
    rising: bool | None = None

    def check(self, session: Session) -> None:
        """Check that the mercury lines are visible, the right way round."""
        session.decide("mercury", lambda: self._lines(session), when_planned="lines found")

    def _lines(self, session: Session) -> str:
        from labrig.protocols.steps.strip_scenes import lines_found

        return lines_found(self.own(session), frames_of(session, *self.strip), self.rising)


@dataclass(frozen=True)
class FilterUnit(SceneUnit):
    """A colour filter, seen through the strip.

    Attributes
    ----------
    filter, previous
        Names of the colour filter and of the one before it; None for none.
    """

    filter: str | None = None
    previous: str | None = None

    def check(self, session: Session) -> None:
        """Warn of a filter that seems not to be in its place."""
        if session.decide(
            "like the picture before", lambda: self._is_like_previous(session), when_planned=False
        ):
            session.warn(
                f"the picture with the colour filter {self.filter} is like the one before "
                f"it ({self._unit_before}): take the last step back if the filter is not in its "
                "place; if it was not, the calibration does without it"
            )

    @property
    def _unit_before(self) -> str:
        return filter_unit(self.previous)

    def _is_like_previous(self, session: Session) -> bool:
        from labrig.protocols.steps.strip_scenes import look_alike

        previous = frames_of(session, self.role, self._unit_before)
        strip = frames_of(session, self.role, filter_unit(None))
        return look_alike(self.own(session), previous, strip)


@dataclass(frozen=True)
class StripesUnit(SceneUnit):
    """The sample charged by mercury lines through the strip, whose glow fixes the map.

    Without a trap door the sample is seen where it lies.

    Attributes
    ----------
    charge_s
        Duration of the charge in seconds.
    """

    charge_s: float = 600.0

    def run(self, session: Session) -> None:
        """Charge, turn the sample to the camera, photograph with rising shutter times."""
        light(session, self.warm_up_s(session))
        charge(session, self.charge_s)
        capabilities, scene = session.rig[CAMERA].capabilities(), self.bracketing
        at_s, steps = visible_after_s(session.rig) + MARGIN_S, list[TimedAction]()
        for fraction in STRIPES_LADDER:
            exposure_s = capabilities.exposure_at_most(scene.longest_s * fraction)
            steps.append(at(at_s, TakeFrame(self.role, scene.settings(exposure_s))))
            at_s += exposure_s + capabilities.overhead_s + MARGIN_S
        session.run_sequence([*lights_out(session), *steps])
        face_lamp(session)


FilterCount = Annotated[int, Field(ge=6, strict=True)]
FilterName = Annotated[str, Field(min_length=1, pattern=r"^[^/\\]+$")]

_CARD = BenchConfiguration("grey card")
_ON_SAMPLE = BenchConfiguration("grey card", "on sample")
_BEFORE_CAMERA = BenchConfiguration("grey card", "before camera")

#: Reason for a scene's configuration, by the role of its frames.
_WHY: dict[str, str] = {
    LvfFrames.CARD: "how bright the card is at every place by itself",
    LvfFrames.STRIP_ON_SAMPLE: "where the filter's strip falls on the sample",
    LvfFrames.FILTER: "colour filters of known transmission calibrate the variable filter",
    LvfFrames.LINES: "mercury lines determine the wavelength of every place",
    LvfFrames.LINES_ON_SAMPLE: "mercury lines determine the wavelengths on the sample",
    LvfFrames.STRIPES: "the stripes glow where the camera will see the sample",
}


class LvfCalibration(ConfiguredProtocol):
    """Settings of the calibration of an LVF; `lvf_calibration.yaml` is the commented example.

    Attributes
    ----------
    rising
        Whether the wavelength rises from left to right when the camera looks through the filter. A
        filter the other way round is then refused. Default: either way is accepted.
    rising_on_sample
        Whether the wavelength rises from left to right when the filter lies on the sample. A filter
        the other way round is then refused. Default: either way is accepted.
    filters
        Colour filters by the names of their files, for example `[longpass-440, shortpass-620]`: six
        or more, with edges all over the spectrum. `all` takes those in the rig file's folder of
        filters, or without one those that labrig ships; a number, as many of them, those that tell
        most of the strip's bands.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs at each of two exposures of a scene; the longer exposure is for the
        dim ends of the strip.
    mercury_warm_up
        Time until the mercury lamp is steady, for example `5 min`. That of the usual lamp stands in
        the rig file.
    stripes
        Time for which the mercury lamp charges the sample through the filter, so that its lines
        glow as stripes where the camera sees the sample, for example `10 min`. `none` leaves this
        out.
    """

    curves = ("lamp", "grey_card", "filters")

    protocol: Literal["lvf_calibration"] = "lvf_calibration"
    rising: bool | None = None
    rising_on_sample: bool | None = None
    filters: Literal["all"] | FilterCount | tuple[FilterName, ...] = "all"
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
    def bracketing(self) -> Bracketing:
        """Bracketing of all scenes but the stripes."""
        return Bracketing(self.camera, self.longest, self.repeats)

    def filter_names(self) -> tuple[str, ...]:
        """Return the names of the colour filters; before `resolved_for`, of the shipped ones."""
        return self.filters if isinstance(self.filters, tuple) else self._chosen(Optics())

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the protocol with the names of the filters, of those in the rig file's folder."""
        if isinstance(self.filters, tuple):
            return self
        return self.model_copy(update={"filters": self._chosen(rig.optics)})

    def _chosen(self, optics: Optics) -> tuple[str, ...]:
        """Return the names of all filters, or of as many as are asked for."""
        files = optics.filter_files()
        if not isinstance(self.filters, int):
            return tuple(files)
        # Takes a while to load, and most protocols do without.
        from labrig.fit.lvf import most_informative_filters

        curves = [read_transmittance(path) for path in files.values()]
        return most_informative_filters(
            [replace(curve, name=name) for name, curve in zip(files, curves, strict=True)],
            self.filters,
        )

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return first what can go wrong, the strip and its lines, then filter by filter."""
        return [
            ConfiguredUnit(StillDarkUnit(self.bracketing), BenchConfiguration(), "", is_dark=True),
            *self._lit_scenes(),
        ]

    def _lit_scenes(self) -> Iterator[ConfiguredUnit]:
        none, strip = filter_unit(None), LvfFrames.STRIP_ON_SAMPLE
        yield self._scene(SceneUnit, "card", LvfFrames.CARD, _CARD)
        yield self._scene(StripUnit, strip_unit := "strip-on-sample", strip, _ON_SAMPLE)
        yield self._scene(StripUnit, none, LvfFrames.FILTER, _BEFORE_CAMERA)
        configuration = replace(_BEFORE_CAMERA, lamp="mercury")
        keys: dict[str, Any] = {"strip": (LvfFrames.FILTER, none), "rising": self.rising}
        yield self._scene(LinesUnit, "lines", LvfFrames.LINES, configuration, **keys)
        configuration = replace(_ON_SAMPLE, lamp="mercury")
        keys = {"strip": (strip, strip_unit), "rising": self.rising_on_sample}
        yield self._scene(
            LinesUnit, "lines-on-sample", LvfFrames.LINES_ON_SAMPLE, configuration, **keys
        )
        if isinstance(self.stripes, float):
            configuration = replace(configuration, stage="sample")
            yield self._scene(
                StripesUnit, "stripes", LvfFrames.STRIPES, configuration, charge_s=self.stripes
            )
        previous = None
        for name in self.filter_names():
            configuration = replace(_BEFORE_CAMERA, filter=name)
            keys = {"filter": name, "previous": previous}
            yield self._scene(
                FilterUnit, filter_unit(name), LvfFrames.FILTER, configuration, **keys
            )
            previous = name

    def _scene(
        self,
        kind: type[SceneUnit],
        name: str,
        role: str,
        configuration: BenchConfiguration,
        **keys: Any,
    ) -> ConfiguredUnit:
        mercury_s = self.mercury_warm_up
        unit = kind(self.bracketing, name, role, configuration.lamp, mercury_s, **keys)
        return ConfiguredUnit(unit, configuration, _WHY[role])
