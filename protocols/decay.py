"""A decay: dark frames, a metered charge, then charge, lamp off and photographs of the glow.

After Nalbach et al., Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.4.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, model_validator

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    ExposureSettings,
    ProtocolModel,
    Session,
    Shoot,
    Timed,
    Unit,
    at,
)
from labrig.quantity import DurationS, Fraction, duration_text, word_or_duration
from labrig.region import CENTRE, Region

from .metering import DecayMeter, Schedule, glow

#: Frames at each exposure of the dark unit: enough for a mean, its scatter and a map of hot pixels.
DARKS_PER_EXPOSURE = 4
#: Charge before metering; a longer one glows brighter, which the metering's headroom allows for.
METER_CHARGE_S = 600.0
#: Shutter times of the daylight photograph: one of them is right whatever the lamp.
DAYLIGHT_EXPOSURES_S = (1 / 4096, 1 / 512, 1 / 64, 1 / 8)
LAMP_SETTLES_S = 5.0
#: Left free between a frame and the next deadline: setting the camera, half-pressing it.
MARGIN_S = 0.5


class CameraSettings(BaseModel):
    """How the camera is set; the shutter time has a key of its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    iso: int = Field(400, gt=0)
    f_number: float | None = Field(4.0, gt=0)


class Plateau(BaseModel):
    """When `charge: plateau` ends: the glow grew by less than `growth` since the last look."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    growth: Fraction = Field(0.01, gt=0, lt=1)
    check_every: DurationS = Field(300.0, gt=0)
    at_most: DurationS = Field(7200.0, gt=0)


Written = PlainSerializer(lambda value: value if isinstance(value, str) else f"{value!r} s")


class Decay(ProtocolModel):
    """The decay protocol; see `decay.yaml` for what each key means."""

    protocol: Literal["decay"] = "decay"
    charge: Annotated[float | Literal["plateau"], word_or_duration("plateau"), Written] = 5400.0
    plateau: Plateau = Plateau()
    every: DurationS = Field(5.0, gt=0)
    duration: DurationS = Field(180.0, gt=0, alias="for")
    first: DurationS = Field(0.5, ge=0)
    repeats: int = Field(1, ge=1)
    camera: CameraSettings = CameraSettings()
    exposure: Annotated[
        float | Literal["auto", "grow"], word_or_duration("auto", "grow"), Written
    ] = "auto"
    grow_at_most: float = Field(16.0, ge=1)
    dark: Literal["frames", "background"] = "frames"
    background: Region | None = None
    patches: dict[str, Region] = Field({"sample": CENTRE}, min_length=1)
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
        count = int((self.duration - self.first) / self.every + 1e-9) + 1
        return [self.first + number * self.every for number in range(count)]

    def units(self) -> Sequence[Unit]:
        """Darks, metering, the decays, daylight; what is not needed is left out."""
        units: list[Unit] = []
        if self.dark == "frames":
            units.append(DarkUnit(self))
        if isinstance(self.exposure, str):
            units.append(MeterUnit(self))
        units += [DecayUnit(self, number) for number in range(1, self.repeats + 1)]
        if self.daylight:
            units.append(DaylightUnit(self))
        return units

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def longest_exposure_s(self, session: Session) -> float:
        """Longest offered shutter time that fits between two frames."""
        offers = session.rig.camera.offers()
        return offers.exposure_at_most(self.every - offers.overhead_s - MARGIN_S)

    def charge_sample(self, session: Session, duration_s: float) -> None:
        """Lamp on for that long, for its own warm-up at the least."""
        session.perform(LAMP_ON)
        session.wait(max(duration_s, session.rig.warm_up_s("lamp")), "charging")


@dataclass(frozen=True)
class DarkUnit:
    """Dark frames at the exposures to come, before anything glows."""

    protocol: Decay
    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph darkness."""
        session.wait_until_warm("camera")
        for exposure_s in self._exposures_s(session):
            for _ in range(DARKS_PER_EXPOSURE):
                session.perform(Shoot("dark", self.protocol.settings(exposure_s)))

    def _exposures_s(self, session: Session) -> list[float]:
        offers = session.rig.camera.offers()
        if isinstance(self.protocol.exposure, float):
            return [offers.exposure_near(self.protocol.exposure)]
        longest_s = self.protocol.longest_exposure_s(session)
        return [offers.exposure_at_most(longest_s * share) for share in (1 / 64, 1 / 4, 1)]


@dataclass(frozen=True)
class MeterUnit:
    """A shorter charge whose glow says how long to expose."""

    protocol: Decay
    name: str = "meter"

    def run(self, session: Session) -> None:
        """Charge, lamp off, a ladder of exposures; for `grow`, then on along the decay."""
        session.wait_until_warm("camera")
        charge = self.protocol.charge
        self.protocol.charge_sample(
            session, min(charge if isinstance(charge, float) else METER_CHARGE_S, METER_CHARGE_S)
        )
        session.run_sequence([at(0.0, LAMP_OFF), *self._ladder(session)])

    def _ladder(self, session: Session) -> list[Timed]:
        offers = session.rig.camera.offers()
        longest_s = self.protocol.longest_exposure_s(session)
        pause_s = offers.overhead_s + MARGIN_S
        ladder, at_s = [], self.protocol.first
        for share in (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1):
            exposure_s = offers.exposure_at_most(longest_s * share)
            ladder.append(at(at_s, Shoot("meter", self.protocol.settings(exposure_s))))
            at_s += exposure_s + pause_s
        if self.protocol.exposure == "grow":
            while at_s < self.protocol.duration:
                for share in (1 / 16, 1):
                    exposure_s = offers.exposure_at_most(longest_s * share)
                    ladder.append(at(at_s, Shoot("meter", self.protocol.settings(exposure_s))))
                    at_s += exposure_s + pause_s
                at_s *= 1.5
        return ladder


@dataclass(frozen=True)
class DecayUnit:
    """One charge and the decay after it."""

    protocol: Decay
    number: int

    @property
    def name(self) -> str:
        """`decay-1`, `decay-2`, …"""
        return f"decay-{self.number}"

    def run(self, session: Session) -> None:
        """Charge, lamp off, one frame every `every` seconds."""
        session.wait_until_warm("camera")
        schedule = self._schedule(session)
        self._charge(session, schedule.exposures_s[0])
        session.run_sequence(
            [
                at(0.0, LAMP_OFF),
                *(
                    at(time_s, Shoot("decay", self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in schedule.frames()
                ),
            ]
        )

    def _schedule(self, session: Session) -> Schedule:
        protocol, offers = self.protocol, session.rig.camera.offers()
        times_s = protocol.frame_times_s()
        if isinstance(protocol.exposure, float):
            return Schedule.constant(times_s, offers.exposure_near(protocol.exposure))
        longest_s = protocol.longest_exposure_s(session)

        def decide() -> Schedule:
            meter = DecayMeter(session.frames("meter"), list(protocol.patches.values()))
            growth = protocol.grow_at_most if protocol.exposure == "grow" else 1.0
            return meter.schedule(times_s, offers, longest_s, growth, session.warn)

        return session.choose("exposure", decide, Schedule.constant(times_s, longest_s))

    def _charge(self, session: Session, exposure_s: float) -> None:
        if isinstance(self.protocol.charge, float):
            self.protocol.charge_sample(session, self.protocol.charge)
            return
        rule = self.protocol.plateau
        self.protocol.charge_sample(session, rule.check_every)
        charged_s = rule.check_every
        while charged_s < rule.at_most:
            look = Shoot("plateau", self.protocol.settings(exposure_s))
            session.run_sequence([at(0.0, LAMP_OFF), at(self.protocol.first, look)])
            session.perform(LAMP_ON)
            if session.choose("plateau reached", lambda: self._level(session), worst=False):
                session.wait(LAMP_SETTLES_S, "lamp settles, charge topped up")
                return
            session.wait(rule.check_every, "charging")
            charged_s += rule.check_every
        session.warn(
            f"the glow still grows after {duration_text(rule.at_most)} of charge; amplitudes are "
            "below saturation (raise plateau.at_most)"
        )

    def _level(self, session: Session) -> bool:
        """Whether every patch grew by less than the rule allows since the last look."""
        looks = [frame for frame in session.frames("plateau") if frame.unit == self.name]
        if len(looks) < 2:
            return False
        before, now = (
            [glow(frame.path, region) for region in self.protocol.patches.values()]
            for frame in looks[-2:]
        )
        limit = 1 + self.protocol.plateau.growth
        return all(new <= old * limit for old, new in zip(before, now, strict=True))


@dataclass(frozen=True)
class DaylightUnit:
    """What the samples look like under the lamp."""

    protocol: Decay
    name: str = "daylight"

    def run(self, session: Session) -> None:
        """Lamp on, a ladder of short exposures, lamp off."""
        offers = session.rig.camera.offers()
        session.perform(LAMP_ON)
        session.wait(LAMP_SETTLES_S, "lamp settles")
        for wanted_s in DAYLIGHT_EXPOSURES_S:
            exposure_s = offers.exposure_at_most(wanted_s)
            session.perform(Shoot("daylight", self.protocol.settings(exposure_s)))
        session.perform(LAMP_OFF)
