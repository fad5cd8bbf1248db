"""Protocols that charge a sample and photograph its glow: keys, rest before, darks, metering."""

from abc import abstractmethod
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from labrig.acquire import (
    CAMERA,
    CameraCapabilities,
    ExposureSettings,
    ProtocolModel,
    Session,
    TakeFrame,
    at,
)
from labrig.foundation.quantity import DurationS, duration_text
from labrig.foundation.region import Region
from labrig.record import FrameRole

from .afterglow import glow
from .camera_settings import MARGIN_S, CameraSettings, dark_exposures_s, longest_exposure_s
from .darkness import levels, range_dn
from .exposure_metering import LADDER, DecayMeter, MeteringFrame, Schedule, measure_frame
from .sample_pose import charge, check_visible, face_camera, face_lamp, has_door, lights_out
from .sanity_checks import SanityChecks

#: Shutter times of the further frames, along the decay, as fractions of the longest.
LATER = (1 / 16, 1)


#: Duration of the charge before metering; None leaves it to the protocol.
MeterCharge = Annotated[DurationS, Field(gt=0)] | None


class MeteredSettings(ProtocolModel):
    """Settings of a protocol that takes dark frames, then meters a glow.

    Attributes
    ----------
    camera
        Sensitivity and aperture of the camera.
    """

    camera: CameraSettings = CameraSettings()

    @abstractmethod
    def meter_ladder(self, capabilities: CameraCapabilities) -> list[tuple[float, float]]:
        """Return begin after lamp off and shutter time of each metering frame."""

    @abstractmethod
    def dark_exposures_s(self, capabilities: CameraCapabilities) -> list[float]:
        """Return the shutter time of each dark frame in seconds."""

    @abstractmethod
    def checks(self, session: Session, unit: str, metering: str = "meter") -> SanityChecks:
        """Return the sanity checks of a unit's frames, compared with those of `metering`."""

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Return the camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def short_settings(self, session: Session) -> list[ExposureSettings]:
        """Return the settings of the shortest metering frames, for a check of clipped frames."""
        ladder = self.meter_ladder(session.rig[CAMERA].capabilities())[:3]
        return [self.settings(exposure_s) for _, exposure_s in ladder]

    def charge_sample(self, session: Session, duration_s: float) -> None:
        """Charge for that long, and at least for the lamp's warm-up time."""
        charge(session, max(duration_s, session.rig.warm_up_s("lamp")))


def ladder(
    first_s: float,
    longest_s: float,
    capabilities: CameraCapabilities,
    until_s: float = 0.0,
) -> list[tuple[float, float]]:
    """Return begin and shutter time of metering frames, as early one after another as they can be.

    Parameters
    ----------
    first_s
        Start of the first frame after lamp off in seconds.
    longest_s
        Longest shutter time in seconds.
    capabilities
        Exposure settings that the camera offers.
    until_s
        Time after lamp off in seconds until which further frames begin, each group of them half as
        late again as the end of the one before; 0 for the first frames alone.
    """
    frames: list[tuple[float, float]] = []
    at_s, fractions = first_s, LADDER
    while not frames or at_s < until_s:
        for fraction in fractions:
            exposure_s = capabilities.exposure_at_most(longest_s * fraction)
            frames.append((at_s, exposure_s))
            at_s += exposure_s + capabilities.overhead_s + MARGIN_S
        at_s, fractions = at_s * 1.5, LATER
    return frames


class MeteredChargeSettings(MeteredSettings):
    """Settings of a protocol that meters the glow after a charge of its own.

    Attributes
    ----------
    meter
        Time for which the lamp shines on the sample before the photographs by which exposures are
        chosen, for example `5 min`. A longer charge must not glow more than twice as bright.
        Default: as long as `charge`, at most 10 minutes.
    """

    meter: MeterCharge = None


class GlowSettings(MeteredChargeSettings):
    """Settings of a protocol that photographs a glow, and the exposures that follow from them.

    Attributes
    ----------
    charge
        Time for which the lamp shines on the sample before each series of photographs, for example
        `10 min`. A strong glow is enough; it need not be saturated.
    longest
        Longest exposure, for example `30 s`.
    """

    charge: DurationS = Field(600.0, gt=0)
    longest: DurationS = Field(30.0, gt=0)

    @property
    @abstractmethod
    def role(self) -> str:
        """Role of the frames of the glow."""

    @property
    def picture_frames(self) -> Collection[str]:
        """Role of the frames that show the sample: its glow."""
        return (self.role,)

    @abstractmethod
    def times_s(self) -> Sequence[float]:
        """Return the start of each frame in seconds after lamp off, rising."""

    @abstractmethod
    def regions(self) -> Sequence[Region]:
        """Return the regions of the glow; the brightest decides."""

    def longest_exposures_s(self, capabilities: CameraCapabilities) -> list[float]:
        """Return the longest shutter time of each frame, which ends before the next begins."""
        longest_s = capabilities.exposure_at_most(self.longest)
        between_s = [
            longest_exposure_s(later - earlier, capabilities)
            for earlier, later in pairwise(self.times_s())
        ]
        return [min(limit_s, longest_s) for limit_s in (*between_s, longest_s)]

    def dark_exposures_s(self, capabilities: CameraCapabilities) -> list[float]:
        """Return the shutter time of each dark frame in seconds."""
        return dark_exposures_s(max(self.longest_exposures_s(capabilities)), capabilities)

    def meter_ladder(self, capabilities: CameraCapabilities) -> list[tuple[float, float]]:
        """Return begin and shutter time of each metering frame, to the last frame of the glow."""
        longest_s, times_s = max(self.longest_exposures_s(capabilities)), self.times_s()
        return ladder(times_s[0], longest_s, capabilities, until_s=times_s[-1])

    def schedule(
        self,
        capabilities: CameraCapabilities,
        measured: Sequence[MeteringFrame],
        warn: Callable[[str], None],
    ) -> Schedule:
        """Return frames of the glow, as bright as the metering frames allow."""
        limits_s = self.longest_exposures_s(capabilities)
        times_s = self.times_s()
        wished = DecayMeter(measured).schedule(
            times_s, capabilities, max(limits_s), float("inf"), warn
        )
        exposures_s = map(min, wished.exposures_s, limits_s)
        return Schedule(tuple(times_s), tuple(exposures_s))

    def brightest_schedule(self, capabilities: CameraCapabilities) -> Schedule:
        """Return the schedule with the longest exposures that `schedule` can return."""
        return Schedule(tuple(self.times_s()), tuple(self.longest_exposures_s(capabilities)))

    def checks(self, session: Session, unit: str, metering: str = "meter") -> SanityChecks:
        """Return the sanity checks of a unit's frames, compared with those of `metering`."""
        return SanityChecks(session, unit, self.regions(), None, self.role, metering)


def metered_schedule(session: Session, protocol: GlowSettings, metering: str) -> Schedule:
    """Return the schedule of the glow, from the frames of the unit `metering`."""
    capabilities = session.rig[CAMERA].capabilities()

    def decide() -> Schedule:
        frames = [frame for frame in session.frames(FrameRole.METER) if frame.unit == metering]
        measured = [measure_frame(frame, protocol.regions()) for frame in frames]
        return protocol.schedule(capabilities, measured, session.warn)

    return session.decide("exposure", decide, protocol.brightest_schedule(capabilities))


#: Interval of checks of the sample, and longest rest.
CHECK_EVERY_S = 180.0
AT_MOST_S = 3 * 3600.0
#: Least fading between two checks of a light that fades.
FADES = 0.05
#: Fraction of the range below which there is no light.
LEAST = 5e-4


def dark_frames(
    session: Session, unit: str, regions: Sequence[Region], exposures: Sequence[ExposureSettings]
) -> None:
    """Take dark frames in the later pose; behind a door the sample rests before until it is dark.

    Without a door only the dark frames show whether it is dark. A plan assumes a dark sample.

    Parameters
    ----------
    session
        Session of the run.
    unit
        Name of the unit that takes the frames.
    regions
        Regions of the sample.
    exposures
        Camera settings of the dark frames.
    """
    if has_door(session):
        longest = max(exposures, key=lambda settings: settings.exposure_s)
        _rest_until_dark(session, unit, regions, longest)
    for settings in exposures:
        session.perform(TakeFrame(FrameRole.DARK, settings))


def _rest_until_dark(
    session: Session, unit: str, regions: Sequence[Region], longest: ExposureSettings
) -> None:
    """Rest until the sample is as dark as the closed door; the door is open afterwards."""
    face_lamp(session)
    session.perform(TakeFrame(FrameRole.REST, longest))
    face_camera(session)
    previous, rested_s = np.inf, 0.0
    while True:
        light = _look(session, unit, regions, longest)
        fades = light < (1 - FADES) * previous
        if not light or not fades or rested_s >= AT_MOST_S:
            break
        previous = light
        session.wait(CHECK_EVERY_S, "the sample still glows, resting in the dark")
        rested_s += CHECK_EVERY_S
    if light:
        advice = (
            "a light is on in the room, or leaks in; it is subtracted as long as it stays the same"
            if not fades
            else "the sample glows from earlier; longer in the dark before a run is better"
        )
        session.warn(
            f"after {duration_text(rested_s)} in the dark the sample's place is not dark: "
            f"{100 * light:.2g} % of the camera's range in {longest.exposure_s:.2g} s; {advice}"
        )


def _look(
    session: Session, unit: str, regions: Sequence[Region], longest: ExposureSettings
) -> float:
    """Photograph the sample, for shorter where it clips: whether that fades could not be seen.

    Returns the fraction of the range by which the longest exposure exceeds the closed door, or 0;
    more than 1 if it clips.
    """
    capabilities, least = session.rig[CAMERA].capabilities(), 0.0
    for fraction in LADDER[::-1]:
        exposure_s = capabilities.exposure_at_most(longest.exposure_s * fraction)
        session.perform(TakeFrame(FrameRole.REST, replace(longest, exposure_s=exposure_s)))
        light = session.decide(
            "light before", lambda: _light(session, unit, regions), when_planned=0.0
        )
        if np.isfinite(light):
            return light
        least = longest.exposure_s / exposure_s
    return least


def _light(session: Session, unit: str, regions: Sequence[Region]) -> float:
    """Return the light of the last frame in the longest exposure, infinity if the frame clips.

    It is a fraction of the range beyond the closed door, 0 if there is none.
    """
    closed, *_, last = (frame for frame in session.frames(FrameRole.REST) if frame.unit == unit)
    dark = measure_frame(closed, regions)
    signal = glow(measure_frame(last, regions), levels(dark), last.start_time)
    fraction = signal.brightest * closed.exposure_s / range_dn(dark)
    if signal.clips:
        return np.inf
    return fraction if signal.seen and fraction > LEAST else 0.0


#: Charge before metering; a longer one glows brighter, which the metering's headroom allows for.
METER_CHARGE_S = 600.0


@dataclass(frozen=True)
class DarkUnit:
    """Dark frames at the later exposures, before anything glows."""

    protocol: MeteredSettings
    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph in the dark."""
        session.wait_until_warm("camera")
        exposures_s = self.protocol.dark_exposures_s(session.rig[CAMERA].capabilities())
        exposures = [self.protocol.settings(exposure_s) for exposure_s in exposures_s]
        checks = self.protocol.checks(session, self.name)
        dark_frames(session, self.name, checks.patches, exposures)
        checks.require_darkness(self.protocol.short_settings(session))


@dataclass(frozen=True)
class MeterUnit:
    """A shorter charge whose glow determines the exposures."""

    protocol: MeteredChargeSettings
    charge_s: float
    name: str = "meter"

    def run(self, session: Session) -> None:
        """Charge, switch the lamp off, take a ladder of exposures; for `grow`, along the decay."""
        session.wait_until_warm("camera")
        if self.protocol.meter is None:
            self.protocol.charge_sample(session, min(self.charge_s, METER_CHARGE_S))
        else:
            charge(session, self.protocol.meter)
        ladder = self.protocol.meter_ladder(session.rig[CAMERA].capabilities())
        check_visible(session, ladder[0][0])
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, TakeFrame(FrameRole.METER, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in ladder
                ),
            ]
        )
        self.protocol.checks(session, self.name).require_glow(self.protocol.short_settings(session))
