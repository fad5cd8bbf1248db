"""The keys of an excitation protocol, and the times and exposures that follow."""

from enum import StrEnum
from itertools import pairwise
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig.acquire import CameraOffers, ExposureSettings, ProtocolModel
from labrig.calibration import IRRADIANCE_KIND
from labrig.quantity import Count, DurationS, Fraction, duration_text
from labrig.region import Region

from .steps.camera_settings import MARGIN_S, CameraSettings, dark_exposures_s
from .steps.patch_names import FilterPatches


class ExcitationFrames(StrEnum):
    """The glow after a charge through the filter, and after one by the lamp itself."""

    STRIP = "strip"
    BARE = "bare"


class UnitKind(StrEnum):
    """Charges through the filter, each twice as long; those that tell most; those without it."""

    STRIP = "strip"
    REFINE = "refine"
    BARE = "bare"

    def numbered(self, number: int) -> str:
        """The name of a unit of this kind."""
        return f"{self}-{number}"

    def has(self, unit: str) -> bool:
        """Whether a unit is of this kind."""
        return unit.rpartition("-")[0] == self


#: Each pause between two frames is longer than the one before by this factor.
PAUSES_GROW = 1.25
#: Places along each patch, for metering and for choosing charge times.
PLACES = 12


class Rest(BaseModel):
    """Darkness between two charges: at least and at most so long, until the glow is that low."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    below: Fraction = Field(0.02, gt=0, lt=1)
    at_least: DurationS = Field(60.0, ge=0)
    check_every: DurationS = Field(180.0, gt=0)
    at_most: DurationS = Field(900.0, ge=0)

    @model_validator(mode="after")
    def _floor_below_ceiling(self) -> Self:
        if self.at_least > self.at_most:
            raise ValueError("expected 'at_least' of no more than 'at_most'")
        return self


class ExcitationSettings(ProtocolModel):
    """The keys; see `excitation.yaml` for what each means."""

    rate_frames = tuple(ExcitationFrames)
    rests_on = (IRRADIANCE_KIND,)

    protocol: Literal["excitation"] = "excitation"
    first_charge: DurationS = Field(8.0, gt=0)
    growth: Fraction = Field(0.03, gt=0, lt=1)
    at_most: Count = Field(9, ge=2)
    refine: Count = Field(3, ge=0)
    bare: tuple[DurationS, ...] = Field((3.0, 10.0, 60.0, 900.0), min_length=1)
    first: DurationS = Field(1.0, ge=0)
    every: DurationS = Field(4.0, gt=0)
    duration: DurationS = Field(90.0, gt=0, alias="for")
    last_decay: DurationS = Field(180.0, gt=0)
    rest: Rest = Rest()
    samples: Count = Field(1, ge=1)
    camera: CameraSettings = CameraSettings()
    sites: Region = Field((0.1, 0.4, 0.8, 0.2))
    patches: FilterPatches = Field(default_factory=dict)
    states: Literal["auto", 1, 2, 3] = "auto"
    saturated: bool = False

    @model_validator(mode="after")
    def _rising_charges(self) -> Self:
        if any(later <= earlier for earlier, later in pairwise(self.bare)):
            raise ValueError("expected charges in 'bare' that become longer and longer")
        if self.first + self.every > self.duration:
            raise ValueError(
                f"for: {duration_text(self.duration)} leaves no two frames "
                f"{duration_text(self.every)} apart; make it longer"
            )
        return self

    def doubled_s(self, number: int) -> float:
        """The charge of that number, from 1, while they double."""
        return self.first_charge * 2.0 ** (number - 1)

    def frame_times_s(self, lasting_s: float) -> list[float]:
        """Planned begin of each frame after lamp off."""
        times_s, pause_s = [self.first], self.every
        while times_s[-1] + pause_s <= lasting_s:
            times_s.append(times_s[-1] + pause_s)
            pause_s *= PAUSES_GROW
        return times_s

    def longest_exposures_s(self, offers: CameraOffers, lasting_s: float) -> list[float]:
        """Longest offered shutter time of each frame; the last one has the time of the one before.

        A camera must be ready again before the next.
        """
        times_s = self.frame_times_s(lasting_s)
        pauses_s = [later - earlier for earlier, later in pairwise(times_s)]
        spare_s = offers.overhead_s + MARGIN_S
        return [offers.exposure_at_most(pause_s - spare_s) for pause_s in (*pauses_s, pauses_s[-1])]

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def dark_exposures_s(self, offers: CameraOffers) -> list[float]:
        """Shutter time of each dark frame."""
        return dark_exposures_s(max(self.longest_exposures_s(offers, self.last_decay)), offers)

    def ladder(self, offers: CameraOffers) -> list[tuple[float, float]]:
        """Begin after lamp off and shutter time of each metering frame."""
        longest_s = max(self.longest_exposures_s(offers, self.duration))
        at_s, ladder = self.first, []
        for share in (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1):
            exposure_s = offers.exposure_at_most(longest_s * share)
            ladder.append((at_s, exposure_s))
            at_s += exposure_s + offers.overhead_s + MARGIN_S
        return ladder

    def regions(self) -> list[Region]:
        """Where a glow is to be seen: every patch, or the strip on the sample."""
        return list(self.patches.values()) or [self.sites]

    def strip(self) -> list[Region]:
        """Places along each of the regions, those of one after those of another."""
        return [
            (x + width * k / PLACES, y, width / PLACES, height)
            for x, y, width, height in self.regions()
            for k in range(PLACES)
        ]
