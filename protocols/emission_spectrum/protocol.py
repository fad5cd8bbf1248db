"""The emission spectrum: the glow through the LVF, or colour filters, at times after lamp off.

After Nalbach et al., sec. 4.3, the spectrum is the same at all times, and for every lamp.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import CAMERA, RigFile, Session, TakeFrame, at
from labrig.calibration import LVF_KIND
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, duration_text
from labrig.foundation.region import Region
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
    LampKind,
)
from labrig.protocols.steps.camera_settings import CameraSettings, LongEnoughForCamera
from labrig.protocols.steps.glow import DarkUnit, GlowSettings, MeterUnit, metered_schedule
from labrig.protocols.steps.grey_card import light_card
from labrig.protocols.steps.patch_names import FilterPatches
from labrig.protocols.steps.sample_pose import charge, check_visible, lights_out

#: Start of the units' names, which end with the lamp.
_AFTER = "spectrum-"


#: Names of the scenes without a filter, before those with one and after them.
BEFORE, AFTERWARDS = "open", "open-again"


def lamp_of(unit: str) -> str:
    """Return the lamp that charged the sample in such a unit."""
    return unit.removeprefix(_AFTER).partition("-")[0]


def glow_unit(lamp: str, scene: str = "") -> str:
    """Return the name of the unit after a charge: through the LVF, or in a scene of filters."""
    return f"{_AFTER}{lamp}-{scene}" if scene else f"{_AFTER}{lamp}"


def white_unit(scene: str = "") -> str:
    """Return the name of the unit that photographs the card in the same scene."""
    return f"white-{scene}" if scene else "white"


class SpectrumFrames(StrEnum):
    """Roles of frames of the glow through the filter, and of the lit card."""

    GLOW = "spectrum"
    WHITE = "white"


Time = Annotated[DurationS, Field(gt=0)]

#: Shutter times for a grey card under the lamp: whatever the place, one of them is right.
WHITE_EXPOSURES_S = (1 / 1024, 1 / 256, 1 / 64, 1 / 16, 1 / 4)
WHITES_PER_EXPOSURE = 2

#: Fewest colour filters that tell a spectrum.
MIN_FILTERS = 4

#: Reasons for the configurations.
THROUGH_IT = "the glow is photographed through it"
THROUGH_FILTERS = "the glow is photographed through one filter after another"
OTHER_LAMP = "the glow is to have the same colour whatever lamp charged it"
WHITE = "it measures the error of the camera's curves"


class CameraFilters(FrozenModel):
    """Colour filters before the camera, through which the glow is seen one after another.

    Attributes
    ----------
    filters
        Names of the filters in the rig's folder of filters, for example `[bandpass-450,
        bandpass-500]`. A wheel before the camera turns to those that it has, a person puts all
        others in.
    """

    filters: tuple[str, ...] = Field(min_length=MIN_FILTERS)

    @model_validator(mode="after")
    def _every_one_once(self) -> Self:
        if len(set(self.filters)) < len(self.filters):
            raise ValueError(f"expected every filter once, got {', '.join(self.filters)}")
        return self

    def scenes(self) -> tuple[str, ...]:
        """Return the names of the scenes in order: without a filter, with each, and without."""
        return (BEFORE, *self.filters, AFTERWARDS)


class EmissionSpectrum(GlowSettings, ConfiguredProtocol):
    """Settings of an emission spectrum; `emission_spectrum.yaml` is the commented example.

    Attributes
    ----------
    select
        Colour filters before the camera, one after another in place of the linear variable filter:
        `{filters: [bandpass-450, bandpass-500]}`. The sample is charged for each of them.
    camera
        Sensitivity and aperture of the camera.
    times
        Start of each photograph after lamp off, rising, for example `[2 s, 10 s]`. The spectrum is
        to be the same at all of them (Nalbach et al., fig. 6), which is tested.
    lamps
        Lamps to charge with, one after the other: `halogen`, `mercury` or both. Whether the
        spectrum depends on them is tested.
    white
        Whether a grey card under the halogen lamp is photographed through the same filter, which
        corrects most of the error of camera curves from another laboratory.
    region
        Region of the frame in which the linear variable filter is to be seen, for metering only:
        `[x, y, width, height]` in pixels, or all four as fractions of the frame. With `select` it
        is the place of the sample, over which the glow is averaged.
    patches
        Rows of several materials seen through the filter, by name: `[x, y, width, height]`, one
        above the other, each as long as the filter. They take the place of `region`, and each has a
        spectrum of its own. Default: one material.
    """

    protocol: Literal["emission_spectrum"] = "emission_spectrum"
    select: CameraFilters | None = None
    camera: CameraSettings = CameraSettings(iso=1600)
    times: Annotated[tuple[Time, ...], LongEnoughForCamera()] = Field(
        (2.0, 10.0, 30.0, 60.0), min_length=1
    )
    lamps: tuple[LampKind, ...] = Field(("halogen",), min_length=1)
    white: bool = True
    region: Region = (0.0, 0.0, 1.0, 1.0)
    patches: FilterPatches = Field(default_factory=dict)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for earlier, later in pairwise(self.times):
            if later <= earlier:
                raise ValueError(
                    f"expected rising times, got {duration_text(later)} after "
                    f"{duration_text(earlier)}"
                )
        if len(set(self.lamps)) < len(self.lamps):
            raise ValueError(f"expected every lamp once, got {', '.join(self.lamps)}")
        return self

    @property
    def role(self) -> str:
        """Role of the frames of the glow."""
        return SpectrumFrames.GLOW

    def times_s(self) -> Sequence[float]:
        """Return the start of each frame in seconds after lamp off."""
        return self.times

    def regions(self) -> Sequence[Region]:
        """Return the region of the LVF, or every patch; the brightest decides."""
        return list(self.patches.values()) or [self.region]

    def charge_sample(self, session: Session, duration_s: float) -> None:
        """Charge for that long: a spectrum does not depend on whether the lamp is warm."""
        charge(session, duration_s)

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols whose results this one needs and the rig file does not name."""
        needed = (LVF_KIND,) if self.select is None else ()
        return [kind.protocol for kind in needed if rig.optics.named(kind) is None]

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, metering and spectrum for each lamp, then the white card."""
        if self.select is not None:
            return self._through_filters(self.select)
        through = BenchConfiguration(lvf="before camera")
        scenes = [ConfiguredUnit(DarkUnit(self), through, THROUGH_IT, is_dark=True)]
        for lamp in self.lamps:
            configuration = replace(through, lamp=lamp)
            scenes += [
                ConfiguredUnit(
                    MeterUnit(self, self.charge, f"meter-{lamp}"), configuration, OTHER_LAMP
                ),
                ConfiguredUnit(SpectrumUnit(self, lamp), configuration, OTHER_LAMP),
            ]
        if self.white:
            card = BenchConfiguration("grey card", "before camera")
            scenes.append(ConfiguredUnit(WhiteUnit(self), card, WHITE, leaves_lamp_on=True))
        return scenes

    def _through_filters(self, select: CameraFilters) -> Sequence[ConfiguredUnit]:
        """Return the same with the glow after one charge for each filter, and the card in each.

        Exposures are those of the glow without a filter, the same in all scenes: frames of one
        time then are of the same part of the decay.
        """
        scenes = [
            ConfiguredUnit(DarkUnit(self), BenchConfiguration(), THROUGH_FILTERS, is_dark=True)
        ]
        filters = {scene: scene if scene in select.filters else None for scene in select.scenes()}
        for lamp in self.lamps:
            open_scene = BenchConfiguration(lamp=lamp)
            scenes.append(
                ConfiguredUnit(
                    MeterUnit(self, self.charge, f"meter-{lamp}"), open_scene, OTHER_LAMP
                )
            )
            scenes += [
                ConfiguredUnit(
                    SpectrumUnit(self, lamp, scene),
                    replace(open_scene, camera_filter=name),
                    THROUGH_FILTERS,
                )
                for scene, name in filters.items()
            ]
        if self.white:
            scenes += [
                ConfiguredUnit(
                    WhiteUnit(self, white_unit(scene)),
                    BenchConfiguration("grey card", camera_filter=name),
                    WHITE,
                    leaves_lamp_on=True,
                )
                for scene, name in filters.items()
                if scene != AFTERWARDS
            ]
        return scenes


@dataclass(frozen=True)
class SpectrumUnit:
    """One charge and the glow after it, through the LVF or in a scene of filters."""

    protocol: EmissionSpectrum
    lamp: LampKind
    scene: str = ""

    @property
    def name(self) -> str:
        """Name of the unit: `spectrum-halogen`, `spectrum-halogen-bandpass-450`."""
        return glow_unit(self.lamp, self.scene)

    def run(self, session: Session) -> None:
        """Charge, switch the lamp off, take a frame at every time."""
        session.wait_until_warm("camera")
        metering = f"meter-{self.lamp}"
        schedule = metered_schedule(session, self.protocol, metering)
        check_visible(session, schedule.times_s[0])
        self.protocol.charge_sample(session, self.protocol.charge)
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, TakeFrame(self.protocol.role, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in schedule.frames()
                ),
            ]
        )
        checks = self.protocol.checks(session, self.name, metering)
        checks.report_delays(schedule.times_s)
        # Behind a filter there may be no light of this sample.
        if len(schedule.times_s) > 1 and self.scene in ("", BEFORE, AFTERWARDS):
            checks.require_decay(self.protocol.short_settings(session))


@dataclass(frozen=True)
class WhiteUnit:
    """A grey card under the lamp, through the same filter."""

    protocol: EmissionSpectrum
    name: str = "white"

    def run(self, session: Session) -> None:
        """Switch the lamp on, unless it burns, and take a ladder of exposures; it burns on."""
        session.wait_until_warm("camera")
        light_card(session)
        capabilities = session.rig[CAMERA].capabilities()
        for nominal_s in WHITE_EXPOSURES_S:
            shoot = TakeFrame(
                SpectrumFrames.WHITE,
                self.protocol.settings(capabilities.exposure_at_most(nominal_s)),
            )
            for _ in range(WHITES_PER_EXPOSURE):
                session.perform(shoot)
