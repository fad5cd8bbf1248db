"""Decays as several protocols take them: a charge, lamp off, photographs of the glow.

After Nalbach et al., Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.4.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    CAMERA,
    DOOR,
    LAMP_ON,
    SHIELD,
    CameraCapabilities,
    RigFile,
    Session,
    TakeFrame,
    Unit,
    at,
    planned_rig,
)
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import Count, DurationS, Fraction, WordOrDuration, duration_text
from labrig.foundation.region import CENTRE, Region
from labrig.record import FrameRole
from labrig.reduce import FrameMeasurement

from .bench_configuration import BenchConfiguration, ConfiguredProtocol, ConfiguredUnit
from .camera_settings import (
    DARKS_PER_EXPOSURE,
    MARGIN_S,
    FramePeriod,
    dark_exposures_s,
    exposure_lines,
    frame_times_s,
    longest_exposure_s,
)
from .exposure_metering import (
    DecayMeter,
    MeteringFrame,
    Schedule,
    glow,
    measure_frame,
)
from .glow import MeteredChargeSettings, ladder
from .patch_names import Patches
from .random_spacing import PLANNED_SEED, RandomSpacing, Spacing
from .sample_pose import (
    check_visible,
    face_lamp,
    has_door,
    lights_out,
    visible_after_s,
)
from .sanity_checks import SanityChecks

#: Earliest first photograph after lamp off: a halogen lamp has gone dark by then.
EARLIEST_S = 0.5
#: Reason for the sample by itself.
WHY = "its glow is photographed by itself"


class Plateau(FrozenModel):
    """Criterion by which `charge: plateau` ends.

    Attributes
    ----------
    growth
        Growth of the glow since the last check, as a fraction, below which the sample counts as
        charged, for example `1 %`.
    check_every
        Time of charging between two checks, for example `5 min`.
    at_most
        Time of charging after which the decay begins in any case, with a warning, for example
        `2 h`.
    """

    growth: Fraction = Field(0.01, gt=0, lt=1)
    check_every: DurationS = Field(300.0, gt=0)
    at_most: DurationS = Field(7200.0, gt=0)


class DecaySettings(MeteredChargeSettings, ConfiguredProtocol):
    """Settings of a decay; `decay.yaml` is the commented example.

    Attributes
    ----------
    charge
        Time for which the lamp shines on the sample, for example `90 min`; `plateau` charges until
        the glow stops growing.
    plateau
        Criterion by which `charge: plateau` ends.
    every
        Time between the begins of two photographs, in the mean, for example `5 s`.
    spacing
        Spacing of the photographs' begins: `random`, so that no periodic flicker of light or camera
        beats with them, or `even`. The first and the last photograph are the same.
    duration
        Time after lamp off until which photographs begin, for example `180 s`.
    first
        Time from lamp off to the first photograph, for example `500 ms`. `auto` is 500 ms, since a
        halogen lamp needs about 320 ms to go dark, or as soon after that as the trap door is open.
    repeats
        Number of charges, each with a decay after it.
    exposure
        Shutter time of all photographs, for example `1 s`. `auto` meters a short charge first, so
        that nothing clips; `grow` does so and exposes longer along the decay, to keep counts.
    grow_at_most
        Largest ratio of a shutter time to the first one with `exposure: grow`.
    dark
        Source of the level without light: `frames`, dark frames before charging, or `background`, a
        region of every frame.
    background
        Region of every frame that never glows, for `dark: background`: `[x, y, width, height]` in
        pixels, or all four as fractions of the frame.
    patches
        Regions of interest by name: `[x, y, width, height]` in pixels, or all four as fractions of
        the frame. Each gets a fit of its own.
    daylight
        Whether the sample is also photographed under the lamp, for the report.
    states
        Number of excited states to fit: 1, 2 or 3; `auto` chooses it from the data.
    """

    protocol: Literal["decay"] = "decay"
    charge: Annotated[float | Literal["plateau"], WordOrDuration("plateau")] = 5400.0
    plateau: Plateau = Plateau()
    every: FramePeriod = 5.0
    spacing: Spacing = "random"
    duration: DurationS = Field(180.0, gt=0, alias="for")
    first: Annotated[float | Literal["auto"], WordOrDuration("auto")] = "auto"
    repeats: Count = Field(1, ge=1)
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
        if self.first_s + self.every > self.duration:
            raise ValueError(
                f"for: {duration_text(self.duration)} leaves no two frames "
                f"{duration_text(self.every)} apart; make it longer"
            )
        return self

    def decays(self) -> Sequence[Unit]:
        """Return a charge with the decay after it, as often as it is repeated."""
        return [DecayUnit(self, f"decay-{number}") for number in range(1, self.repeats + 1)]

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return the decays alone, without dark frames and metering."""
        return [ConfiguredUnit(unit, BenchConfiguration(), WHY) for unit in self.decays()]

    @property
    def first_s(self) -> float:
        """Time from lamp off to the first photograph in seconds; `resolved_for` knows the door."""
        return EARLIEST_S if self.first == "auto" else self.first

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the protocol with the first photograph after the rig's trap door is open."""
        if self.first != "auto":
            return self
        doors = planned_rig(rig, f"rig '{rig.name}'", (DOOR.key, SHIELD.key))
        visible_s = visible_after_s(doors)
        first_s = max(EARLIEST_S, math.ceil(visible_s * 100) / 100)
        return self.model_copy(update={"first": first_s})

    def frame_times_s(self) -> list[float]:
        """Return the even start of each frame in seconds after lamp off."""
        return frame_times_s(self.first_s, self.every, self.duration)

    def longest_exposure_s(self, capabilities: CameraCapabilities) -> float:
        """Return the longest offered shutter time that fits between two frames, in seconds."""
        if isinstance(self.exposure, str):
            longest_s = longest_exposure_s(self.every, capabilities)
            if self.spacing == "even" or self.exposure == "grow":
                return longest_s
            return min(
                self._random_spacing(capabilities).longest_exposure_s(capabilities), longest_s
            )
        return longest_exposure_s(
            self.every, capabilities, capabilities.exposure_near(self.exposure)
        )

    def dark_exposures_s(self, capabilities: CameraCapabilities) -> list[float]:
        """Return the shutter time of each dark frame in seconds."""
        if isinstance(self.exposure, float):
            return [capabilities.exposure_near(self.exposure)] * DARKS_PER_EXPOSURE
        return dark_exposures_s(self.longest_exposure_s(capabilities), capabilities)

    def meter_ladder(self, capabilities: CameraCapabilities) -> list[tuple[float, float]]:
        """Return begin and shutter time of each metering frame; for `grow`, along the decay."""
        until_s = self.duration if self.exposure == "grow" else 0.0
        return ladder(self.first_s, self.longest_exposure_s(capabilities), capabilities, until_s)

    def schedule(
        self,
        capabilities: CameraCapabilities,
        metering: Sequence[MeteringFrame],
        warn: Callable[[str], None],
        seed: int,
    ) -> Schedule:
        """Return the frames of a decay.

        Their shutter times follow from metering, unless given, and their begins from the seed.
        """
        times_s = self.frame_times_s()
        if isinstance(self.exposure, float):
            exposure_s = capabilities.exposure_near(self.exposure)
            return self._spaced(Schedule.constant(times_s, exposure_s), capabilities, seed)
        growth = self.grow_at_most if self.exposure == "grow" else 1.0
        longest_s = self.longest_exposure_s(capabilities)
        meter = DecayMeter(metering)
        even = meter.schedule(times_s, capabilities, longest_s, growth, warn)
        spaced = self._spaced(even, capabilities, seed)
        # A frame that begins earlier than the even one is brighter.
        own = meter.schedule(spaced.times_s, capabilities, longest_s, growth, lambda text: None)
        exposures_s = map(min, spaced.exposures_s, own.exposures_s)
        return Schedule(spaced.times_s, tuple(exposures_s))

    def _spaced(self, even: Schedule, capabilities: CameraCapabilities, seed: int) -> Schedule:
        """Return the frames of an even schedule at the begins that they have in the end."""
        if self.spacing == "even":
            return even
        spacing = self._random_spacing(capabilities)
        return replace(even, times_s=tuple(spacing.begins_s(even.times_s, even.exposures_s, seed)))

    def _random_spacing(self, capabilities: CameraCapabilities) -> RandomSpacing:
        return RandomSpacing(self.every, capabilities.overhead_s + MARGIN_S)

    def assumed_schedule(self, capabilities: CameraCapabilities, seed: int) -> Schedule:
        """Return the schedule of a plan, which has metered nothing: the longest exposures.

        With `exposure: grow` they are those of a glow that fades evenly, by `grow_at_most`.
        """
        times_s, longest_s = self.frame_times_s(), self.longest_exposure_s(capabilities)
        growth = self.grow_at_most if self.exposure == "grow" else 1.0
        fading_s = times_s[-1] - times_s[0]
        exposures_s = (
            capabilities.exposure_at_most(longest_s * growth ** ((time_s - times_s[-1]) / fading_s))
            for time_s in times_s
        )
        return self._spaced(Schedule(tuple(times_s), tuple(exposures_s)), capabilities, seed)

    def expected_schedule(
        self,
        capabilities: CameraCapabilities,
        expected: Callable[[float, float], Sequence[FrameMeasurement]],
        warn: Callable[[str], None],
    ) -> Schedule:
        """Return the expected result of `schedule`, before anything is measured or drawn.

        Parameters
        ----------
        capabilities
            Exposure settings that the camera offers.
        expected
            Function that predicts a frame of the glow in each patch, from its start after lamp off
            and its shutter time in seconds.
        warn
            Function that receives warnings.
        """
        metering = [MeteringFrame(*at, expected(*at)) for at in self.meter_ladder(capabilities)]
        return self.schedule(capabilities, metering, warn, PLANNED_SEED)

    def checks(self, session: Session, unit: str, metering: str = "meter") -> SanityChecks:
        """Return the sanity checks of a unit's frames, compared with those of `metering`."""
        background = self.background if self.dark == "background" else None
        regions = list(self.patches.values())
        return SanityChecks(session, unit, regions, background, metering=metering)

    def notes(self, rig: RigFile) -> Sequence[str]:
        """Return that the lamp's warm-up, which is a part of the charge, is longer than asked."""
        warm_up_s = rig.devices["lamp"].warm_up if "lamp" in rig.devices else 0.0
        if not isinstance(self.charge, float) or self.charge >= warm_up_s:
            return ()
        return (
            f"the sample is charged for {duration_text(warm_up_s)}, until the lamp is warm, not "
            f"for the {duration_text(self.charge)} of 'charge'; for less, give the lamp of the rig "
            "file a shorter 'warm_up'",
        )

    def frame_spacing(self, capabilities: CameraCapabilities) -> Sequence[str]:
        """Return how the frames of a decay are spaced, in two lines for a plan."""
        spacing = self._random_spacing(capabilities)
        exposure_s = self.longest_exposure_s(capabilities)
        taken: list[str] = []
        if isinstance(self.exposure, float):
            exposure_s = capabilities.exposure_near(self.exposure)
            taken = exposure_lines(self.exposure, exposure_s)
        if self.spacing == "even" or not spacing.free_s(exposure_s):
            return [*taken, *spacing.even_lines(exposure_s)]
        return [*taken, *spacing.lines(exposure_s, len(self.frame_times_s()))]


class DecayFrames(StrEnum):
    """Role of frames of the glow between two charges, which show whether it still grows."""

    PLATEAU = "plateau"


#: Shutter times of the daylight photograph: one of them is right whatever the lamp.
DAYLIGHT_EXPOSURES_S = (1 / 4096, 1 / 512, 1 / 64, 1 / 8)
LAMP_SETTLES_S = 5.0


@dataclass(frozen=True)
class DecayUnit:
    """One charge and the decay after it, with exposures from the unit `metering`."""

    protocol: DecaySettings
    name: str
    metering: str = "meter"

    def run(self, session: Session) -> None:
        """Charge, switch the lamp off, take one frame every `every` seconds."""
        session.wait_until_warm("camera")
        schedule = self._schedule(session)
        check_visible(session, self.protocol.first_s)
        self._charge(session, schedule.exposures_s[0])
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, TakeFrame(FrameRole.DECAY, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in schedule.frames()
                ),
            ]
        )
        checks = self.protocol.checks(session, self.name, self.metering)
        checks.report_delays(schedule.times_s)
        checks.require_decay(self.protocol.short_settings(session))

    def _schedule(self, session: Session) -> Schedule:
        protocol, capabilities = self.protocol, session.rig[CAMERA].capabilities()
        regions = list(protocol.patches.values())
        seed = session.seed("begins of frames") if protocol.spacing == "random" else 0

        def decide() -> Schedule:
            frames = [
                frame for frame in session.frames(FrameRole.METER) if frame.unit == self.metering
            ]
            metering = [measure_frame(frame, regions) for frame in frames]
            return protocol.schedule(capabilities, metering, session.warn, seed)

        if isinstance(protocol.exposure, float):
            return protocol.schedule(capabilities, [], session.warn, seed)
        return session.decide("exposure", decide, protocol.assumed_schedule(capabilities, seed))

    def _charge(self, session: Session, exposure_s: float) -> None:
        if isinstance(self.protocol.charge, float):
            self.protocol.charge_sample(session, self.protocol.charge)
            return
        rule = self.protocol.plateau
        self.protocol.charge_sample(session, rule.check_every)
        charged_s = rule.check_every
        while charged_s < rule.at_most:
            shoot = TakeFrame(DecayFrames.PLATEAU, self.protocol.settings(exposure_s))
            session.run_sequence([*lights_out(session), at(self.protocol.first_s, shoot)])
            face_lamp(session)
            session.perform(LAMP_ON)
            if session.decide(
                "plateau reached", lambda: self._reached_plateau(session), when_planned=False
            ):
                session.wait(LAMP_SETTLES_S, "lamp settles, charge topped up")
                return
            session.wait(rule.check_every, "charging")
            charged_s += rule.check_every
        session.warn(
            f"the glow still grows after {duration_text(rule.at_most)} of charge; amplitudes are "
            "below saturation (raise plateau.at_most)"
        )

    def _reached_plateau(self, session: Session) -> bool:
        """Return whether every patch grew by less than the criterion since the last check."""
        metering = [
            frame for frame in session.frames(DecayFrames.PLATEAU) if frame.unit == self.name
        ]
        if len(metering) < 2:
            return False
        previous_dn, present_dn = (
            [glow(frame.path, region) for region in self.protocol.patches.values()]
            for frame in metering[-2:]
        )
        limit = 1 + self.protocol.plateau.growth
        return all(
            present <= previous * limit
            for previous, present in zip(previous_dn, present_dn, strict=True)
        )


@dataclass(frozen=True)
class DaylightUnit:
    """Photographs of the samples under the lamp."""

    protocol: DecaySettings
    name: str = "daylight"

    def run(self, session: Session) -> None:
        """Switch the lamp on, take a ladder of short exposures, switch the lamp off."""
        if has_door(session):
            session.warn("no daylight photograph: behind a door the lamp lights the sample unseen")
            return
        capabilities = session.rig[CAMERA].capabilities()
        session.perform(LAMP_ON)
        session.wait(LAMP_SETTLES_S, "lamp settles")
        under_lamp = [
            self.protocol.settings(capabilities.exposure_at_most(nominal_s))
            for nominal_s in DAYLIGHT_EXPOSURES_S
        ]
        for settings in under_lamp:
            session.perform(TakeFrame(FrameRole.DAYLIGHT, settings))
        self.protocol.checks(session, self.name).switch_off(under_lamp)
