"""The keys of a decay protocol, and the times, exposures and camera settings that follow."""

from collections.abc import Callable, Sequence
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig.acquire import CAMERA, CameraOffers, ExposureSettings, ProtocolModel, Session
from labrig.quantity import Count, DurationS, Fraction, WordOrDuration, duration_text
from labrig.reduce import FrameMeasurement
from labrig.region import CENTRE, Region

from .steps.camera_settings import DARKS_PER_EXPOSURE, MARGIN_S, CameraSettings, dark_exposures_s
from .steps.frame_times import frame_times_s
from .steps.metering import DecayMeter, Look, Schedule
from .steps.patch_names import Patches
from .steps.posing import charge
from .steps.watching import Watcher


class Plateau(BaseModel):
    """When `charge: plateau` ends: the glow grew by less than `growth` since the last look."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    growth: Fraction = Field(0.01, gt=0, lt=1)
    check_every: DurationS = Field(300.0, gt=0)
    at_most: DurationS = Field(7200.0, gt=0)


class DecaySettings(ProtocolModel):
    """The keys; see `decay.yaml` for what each means."""

    protocol: Literal["decay"] = "decay"
    charge: Annotated[float | Literal["plateau"], WordOrDuration("plateau")] = 5400.0
    plateau: Plateau = Plateau()
    every: DurationS = Field(5.0, gt=0)
    duration: DurationS = Field(180.0, gt=0, alias="for")
    first: DurationS = Field(0.5, ge=0)
    repeats: Count = Field(1, ge=1)
    camera: CameraSettings = CameraSettings()
    exposure: Annotated[float | Literal["auto", "grow"], WordOrDuration("auto", "grow")] = "auto"
    grow_at_most: float = Field(16.0, ge=1)
    dark: Literal["frames", "background"] = "frames"
    background: Region | None = None
    patches: Patches = Field({"sample": CENTRE}, min_length=1)
    daylight: bool = False
    states: Literal["auto", 1, 2, 3] = "auto"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.dark == "background" and self.background is None:
            raise ValueError(
                "dark: background needs the key 'background: [x, y, width, height]', a region of "
                "the frame that never glows"
            )
        if self.first + self.every > self.duration:
            raise ValueError(
                f"for: {duration_text(self.duration)} leaves no two frames "
                f"{duration_text(self.every)} apart; make it longer"
            )
        if isinstance(self.exposure, float) and self.exposure >= self.every:
            raise ValueError(
                f"an exposure of {duration_text(self.exposure)} does not fit between frames every "
                f"{duration_text(self.every)}; expose for less or leave more time"
            )
        return self

    def frame_times_s(self) -> list[float]:
        """Planned begin of each frame, seconds after lamp off."""
        return frame_times_s(self.first, self.every, self.duration)

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def longest_exposure_s(self, offers: CameraOffers) -> float:
        """Longest offered shutter time that fits between two frames."""
        return offers.exposure_at_most(self.every - offers.overhead_s - MARGIN_S)

    def dark_exposures_s(self, offers: CameraOffers) -> list[float]:
        """Shutter time of each dark frame."""
        if isinstance(self.exposure, float):
            return [offers.exposure_near(self.exposure)] * DARKS_PER_EXPOSURE
        return dark_exposures_s(self.longest_exposure_s(offers), offers)

    def meter_ladder(self, offers: CameraOffers) -> list[tuple[float, float]]:
        """Begin after lamp off and shutter time of each metering frame; for `grow`, to the end."""
        longest_s = self.longest_exposure_s(offers)
        pause_s = offers.overhead_s + MARGIN_S
        ladder, at_s = [], self.first
        for share in (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1):
            exposure_s = offers.exposure_at_most(longest_s * share)
            ladder.append((at_s, exposure_s))
            at_s += exposure_s + pause_s
        if self.exposure == "grow":
            while at_s < self.duration:
                for share in (1 / 16, 1):
                    exposure_s = offers.exposure_at_most(longest_s * share)
                    ladder.append((at_s, exposure_s))
                    at_s += exposure_s + pause_s
                at_s *= 1.5
        return ladder

    def schedule(
        self,
        offers: CameraOffers,
        looks: Sequence[Look],
        warn: Callable[[str], None],
    ) -> Schedule:
        """Frames of a decay; their shutter times rest on the metering's, unless they are given."""
        times_s = self.frame_times_s()
        if isinstance(self.exposure, float):
            return Schedule.constant(times_s, offers.exposure_near(self.exposure))
        growth = self.grow_at_most if self.exposure == "grow" else 1.0
        longest_s = self.longest_exposure_s(offers)
        return DecayMeter(looks).schedule(times_s, offers, longest_s, growth, warn)

    def expected_schedule(
        self,
        offers: CameraOffers,
        expected: Callable[[float, float], Sequence[FrameMeasurement]],
        warn: Callable[[str], None],
    ) -> Schedule:
        """What `schedule` will come to, before anything is measured.

        Parameters
        ----------
        expected
            What a frame of the glow will show in each patch, from its begin after lamp off and its
            shutter time in seconds.
        """
        looks = [Look(*at, expected(*at)) for at in self.meter_ladder(offers)]
        return self.schedule(offers, looks, warn)

    def short_settings(self, session: Session) -> list[ExposureSettings]:
        """For a closer look at what clips."""
        ladder = self.meter_ladder(session.rig[CAMERA].offers())[:3]
        return [self.settings(exposure_s) for _, exposure_s in ladder]

    def watcher(self, session: Session, unit: str, metering: str = "meter") -> Watcher:
        """Holds a unit's frames against what should have happened, and what `metering` saw."""
        background = self.background if self.dark == "background" else None
        regions = list(self.patches.values())
        return Watcher(session, unit, regions, background, metering=metering)

    def charge_sample(self, session: Session, duration_s: float) -> None:
        """Lamp on for that long, for its own warm-up at the least."""
        charge(session, max(duration_s, session.rig.warm_up_s("lamp")))
