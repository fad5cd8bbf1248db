"""Excitation rates: charges through the variable filter, all bands at once, then without it.

After Nalbach et al., sec. 4.5 and 4.6, where bands are charged one by one with narrow filters; that
can be done, too, by filters, a monochromator or LEDs.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.acquire import (
    CAMERA,
    DARK,
    LAMP,
    LAMP_OFF,
    LAMP_ON,
    LEDS,
    CameraCapabilities,
    LampSwitch,
    LedSwitch,
    ManualStep,
    Session,
    TakeFrame,
    Unit,
    at,
)
from labrig.calibration import IRRADIANCE_KIND
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import Count, DurationS, Fraction, duration_text
from labrig.foundation.region import Region
from labrig.protocols.steps.afterglow import dark_level
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.camera_settings import (
    FramePeriod,
    dark_exposures_s,
    longest_exposure_s,
)
from labrig.protocols.steps.charge_times import fades_below_s, most_informative_s, still_grows
from labrig.protocols.steps.darkness import levels
from labrig.protocols.steps.exciting_lights import ExcitingLights
from labrig.protocols.steps.exposure_metering import (
    SEEN_DN,
    DecayMeter,
    MeteringFrame,
    Schedule,
    measure_frame,
)
from labrig.protocols.steps.glow import DarkUnit, MeteredSettings, ladder
from labrig.protocols.steps.patch_names import FilterPatches
from labrig.protocols.steps.sample_pose import (
    charge,
    check_visible,
    face_camera,
    face_lamp,
    lights_out,
)
from labrig.protocols.steps.sanity_checks import SanityChecks
from labrig.record import FrameRecord, FrameRole


class ExcitationFrames(StrEnum):
    """Roles of frames of the glow after a charge through the variable filter, by a selected light,
    and by the lamp itself.
    """

    STRIP = "strip"
    BAND = "band"
    DIRECT = "direct"


class UnitKind(StrEnum):
    """Kinds of charges: doubling ones through the variable filter, most informative ones, those by
    a selected light, direct ones.
    """

    STRIP = "strip"
    REFINE = "refine"
    BAND = "band"
    DIRECT = "direct"

    def numbered(self, number: int) -> str:
        """Return the name of a unit of this kind."""
        return f"{self}-{number}"

    def has(self, unit: str) -> bool:
        """Return whether a unit is of this kind."""
        return unit.rpartition("-")[0] == self

    @classmethod
    def of_light(cls, light: str, number: int | str) -> str:
        """Return the name of a unit that charges by a selected light."""
        return f"{cls.BAND}-{light}-{number}"

    @classmethod
    def light_of(cls, unit: str) -> str | None:
        """Return the selected light of a unit, None for one of another kind."""
        kind, _, light = unit.rpartition("-")[0].partition("-")
        return light if kind == cls.BAND and light else None


#: Factor by which each pause between two frames is longer than the one before.
PAUSES_GROW = 1.25
#: Places along each patch, for metering and for choosing charge times.
PLACES = 12


class Rest(FrozenModel):
    """Rest in the dark between two charges, until the sample should hardly glow.

    How long that takes follows from how the glow faded after the last charge. What is left of it is
    measured then, and accounted for.

    Attributes
    ----------
    below
        Glow, as a fraction of that just after the last charge, below which the next charge begins,
        for example `2 %`.
    at_least
        Shortest rest, for example `1 min`.
    at_most
        Longest rest, for example `15 min`.
    """

    below: Fraction = Field(0.02, gt=0, lt=1)
    at_least: DurationS = Field(60.0, ge=0)
    at_most: DurationS = Field(900.0, ge=0)

    @model_validator(mode="after")
    def _floor_below_ceiling(self) -> Self:
        if self.at_least > self.at_most:
            raise ValueError("expected 'at_least' of no more than 'at_most'")
        return self


class ExcitationSettings(MeteredSettings):
    """Settings of excitation rates; `excitation.yaml` is the commented example.

    Attributes
    ----------
    first_charge
        Duration of the first charge through the variable filter, for example `8 s`. Each next one
        is twice as long.
    growth
        Growth of the glow from one charge to the next, as a fraction, below which charges are not
        doubled any more, for example `3 %`.
    at_most
        Largest number of charges that double.
    refine
        Number of charges after those, of durations that add most information on the rates.
    select
        Lights that charge the sample one after another, in place of the variable filter: colour
        filters by hand or in a wheel, wavelengths of a monochromator, or LEDs, for example
        `{leds: [450 nm, 525 nm]}`. `irradiance` must have measured them. Default: the variable
        filter.
    charges
        Durations of the charges by each of the lights of `select`, rising, for example
        `[30 s, 5 min]`. They take the place of `first_charge`, `growth`, `at_most` and `refine`.
    direct
        Durations of the charges by the lamp itself, without the filter, rising, for example
        `[3 s, 1 min]`. They determine the level of the charge; the shortest ones, that of states
        that decay within seconds.
    first
        Time from lamp off to the first photograph, for example `1 s`. A trap door must be open by
        then.
    every
        Time between the begins of the first two photographs after a charge, for example `4 s`. Each
        further one is a quarter longer.
    duration
        Time after lamp off until which photographs begin, for example `90 s`.
    last_decay
        Time after lamp off until which photographs begin after the last charge, which has the
        longest decay, for example `180 s`.
    rest
        Rest in the dark between two charges.
    samples
        Number of samples at hand. With more than one, a fresh sample is put in for every charge,
        instead of a rest.
    sites
        Place of the filter on the sample in the frame: `[x, y, width, height]` in pixels, or all
        four as fractions of the frame. Only exposures and charge times depend on it; the fit uses
        the place that `lvf_calibration` measured. With `select` it is the place of the sample, of
        which the fit takes the mean.
    patches
        Rows of several materials below the filter, by name: `[x, y, width, height]`, one above the
        other, each as long as the filter. They take the place of `sites`, and each has a material
        file of its own. Default: one material.
    states
        Number of excited states to fit: 1, 2 or 3; `auto` chooses it from the data.
    saturated
        Whether the longest charge is taken for a full one, r(0) = 1, as in the paper. If not, r(0)
        is fitted to the data.
    """

    requires = (IRRADIANCE_KIND,)

    protocol: Literal["excitation"] = "excitation"
    first_charge: DurationS = Field(8.0, gt=0)
    growth: Fraction = Field(0.03, gt=0, lt=1)
    at_most: Count = Field(9, ge=2)
    refine: Count = Field(3, ge=0)
    select: ExcitingLights | None = None
    charges: tuple[DurationS, ...] = Field((30.0, 300.0), min_length=1)
    direct: tuple[DurationS, ...] = Field((3.0, 10.0, 60.0, 900.0), min_length=1)
    first: DurationS = Field(1.0, ge=0)
    every: FramePeriod = 4.0
    duration: DurationS = Field(90.0, gt=0, alias="for")
    last_decay: DurationS = Field(180.0, gt=0)
    rest: Rest = Rest()
    samples: Count = Field(1, ge=1)
    sites: Region = Field((0.1, 0.4, 0.8, 0.2))
    patches: FilterPatches = Field(default_factory=dict)
    states: Literal["auto", 1, 2, 3] = "auto"
    saturated: bool = False

    @model_validator(mode="after")
    def _rising_charges(self) -> Self:
        for name in ("direct", "charges"):
            if any(later <= earlier for earlier, later in pairwise(getattr(self, name))):
                raise ValueError(f"expected charges in '{name}' that become longer and longer")
        if self.first + self.every > self.duration:
            raise ValueError(
                f"for: {duration_text(self.duration)} leaves no two frames "
                f"{duration_text(self.every)} apart; make it longer"
            )
        return self

    def doubled_s(self, number: int) -> float:
        """Return the duration of the doubling charge of that number, from 1, in seconds."""
        return self.first_charge * 2.0 ** (number - 1)

    def frame_times_s(self, lasting_s: float) -> list[float]:
        """Return the planned start of each frame in seconds after lamp off."""
        times_s, pause_s = [self.first], self.every
        while times_s[-1] + pause_s <= lasting_s:
            times_s.append(times_s[-1] + pause_s)
            pause_s *= PAUSES_GROW
        return times_s

    def longest_exposures_s(
        self, capabilities: CameraCapabilities, lasting_s: float
    ) -> list[float]:
        """Return the longest offered shutter time of each frame; the last two are alike.

        A camera must be ready again before the next frame.
        """
        times_s = self.frame_times_s(lasting_s)
        pauses_s = [later - earlier for earlier, later in pairwise(times_s)]
        return [longest_exposure_s(pause_s, capabilities) for pause_s in (*pauses_s, pauses_s[-1])]

    def dark_exposures_s(self, capabilities: CameraCapabilities) -> list[float]:
        """Return the shutter time of each dark frame in seconds."""
        return dark_exposures_s(
            max(self.longest_exposures_s(capabilities, self.last_decay)), capabilities
        )

    def meter_ladder(self, capabilities: CameraCapabilities) -> list[tuple[float, float]]:
        """Return begin after lamp off and shutter time of each metering frame."""
        longest_s = max(self.longest_exposures_s(capabilities, self.duration))
        return ladder(self.first, longest_s, capabilities)

    def checks(self, session: Session, unit: str, metering: str = "meter") -> SanityChecks:
        """Return the sanity checks of a unit's frames."""
        return SanityChecks(session, unit, self.regions(), None, metering=metering)

    def regions(self) -> list[Region]:
        """Return the regions of the glow: every patch, or the strip on the sample."""
        return list(self.patches.values()) or [self.sites]

    def strip(self) -> list[Region]:
        """Return places along each of the regions, region by region."""
        return [
            (x + width * k / PLACES, y, width / PLACES, height)
            for x, y, width, height in self.regions()
            for k in range(PLACES)
        ]


#: Arrangements for the charges through the filter and by the lamp itself, and their reasons.
LVF_ON = BenchConfiguration(lvf="on sample")
LVF_AWAY = BenchConfiguration()
THROUGH_IT = "every place is then charged by light of another wavelength"
BY_ONE = "light of some wavelengths charges the sample"
BY_ITSELF = "the lamp by itself charges the sample now"

FRESH = ManualStep(
    "put in a fresh sample, one that has been in the dark for hours",
    "it takes the place of waiting until the glow is gone",
    "fresh sample",
)


@dataclass(frozen=True)
class ExcitationUnit:
    """Common part of all units."""

    protocol: ExcitationSettings

    @property
    def light_on(self) -> LampSwitch | LedSwitch:
        """Action that switches the light on which charges."""
        return LAMP_ON

    @property
    def light_off(self) -> LampSwitch | LedSwitch:
        """Action that switches that light off."""
        return LAMP_OFF

    def measure(self, frame: FrameRecord) -> MeteringFrame:
        """Measure a frame in every place of the strip."""
        return measure_frame(frame, self.protocol.strip())

    def darks(self, session: Session) -> list[MeteringFrame]:
        """Return one measured dark frame of each shutter time."""
        frames = {frame.exposure_s: frame for frame in session.frames(FrameRole.DARK)}
        return [self.measure(frame) for frame in frames.values()]

    def rates(self, frame: FrameRecord, darks: Sequence[MeteringFrame]) -> FloatArray:
        """Return the brightest channel's rate along the strip in DN/s, shape (patches, places)."""
        measured = self.measure(frame)
        above_dark_dn = levels(measured) - dark_level(darks, frame.exposure_s)
        return np.asarray(above_dark_dn.max(axis=1) / frame.exposure_s).reshape(-1, PLACES)

    def rest(self, session: Session) -> None:
        """Wait in the dark until the sample hardly glows, or have another sample put in."""
        rule = self.protocol.rest
        if self.protocol.samples > 1:
            session.ask(FRESH)
            return
        rest_s = session.decide("rest", lambda: self._rest_s(session), when_planned=rule.at_most)
        session.rest(rest_s)
        exposure_s = max(
            self.protocol.longest_exposures_s(
                session.rig[CAMERA].capabilities(), self.protocol.duration
            )
        )
        face_camera(session)
        session.perform(TakeFrame(FrameRole.REST, self.protocol.settings(exposure_s)))
        face_lamp(session)

    def _rest_s(self, session: Session) -> float:
        """Return the time until the glow of every patch is low against that after the last charge.

        It goes on fading as it did between the last two photographs.
        """
        roles = (*ExcitationFrames, FrameRole.METER)
        frames = [frame for role in roles for frame in session.frames(role)]
        last_unit = max(frames, key=lambda frame: frame.start_time).unit
        last_frames = sorted(
            (frame for frame in frames if frame.unit == last_unit),
            key=lambda frame: frame.start_time,
        )
        darks, rule = self.darks(session), self.protocol.rest
        if not any(map(self._is_seen, last_frames)):
            return rule.at_least
        glows = np.array([self.rates(frame, darks).max(axis=1) for frame in last_frames])
        pause_s = last_frames[-1].start_time - last_frames[-2].start_time
        until_s = fades_below_s(glows, pause_s, rule.below)
        return min(max(until_s, rule.at_least), rule.at_most)

    def _is_seen(self, frame: FrameRecord) -> bool:
        channels = [
            channel for place in self.measure(frame).patches for channel in place.channels.values()
        ]
        return any(
            channel.mean > max(DETECTION_SIGMA * channel.sigma, SEEN_DN) for channel in channels
        )


@dataclass(frozen=True)
class _MeterUnit(ExcitationUnit):
    """A charge whose glow determines the exposures."""

    def _meter(self, session: Session, charge_s: float) -> None:
        session.wait_until_warm("camera")
        ladder = self.protocol.meter_ladder(session.rig[CAMERA].capabilities())
        check_visible(session, ladder[0][0])
        charge(session, charge_s, self.light_on)
        session.run_sequence(
            [
                *lights_out(session, self.light_off),
                *(
                    at(time_s, TakeFrame(FrameRole.METER, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in ladder
                ),
            ]
        )

    def _require_glow(self, session: Session, unit: str) -> None:
        checks = self.protocol.checks(session, unit)
        checks.require_glow(self.protocol.short_settings(session))


@dataclass(frozen=True)
class StripMeter(_MeterUnit):
    """Metering charge through the variable filter."""

    name: str = "strip-meter"

    def run(self, session: Session) -> None:
        """Charge, take a ladder of exposures."""
        self._meter(session, self.protocol.first_charge)
        self._require_glow(session, self.name)


@dataclass(frozen=True)
class BandMeter(_MeterUnit):
    """Metering charge by a selected light, after which the sample need not glow.

    Attributes
    ----------
    light
        Name of the light.
    is_first
        Whether nothing has charged the sample before.
    """

    light: str
    is_first: bool

    @property
    def name(self) -> str:
        """Name of the unit: `band-450 nm-meter`."""
        return UnitKind.of_light(self.light, "meter")

    @property
    def light_on(self) -> LampSwitch | LedSwitch:
        """Action that switches the light on."""
        return _selected(self.protocol).on(self.light)

    @property
    def light_off(self) -> LampSwitch | LedSwitch:
        """Action that switches it off."""
        return _selected(self.protocol).off

    def run(self, session: Session) -> None:
        """Charge, take a ladder of exposures."""
        if not self.is_first:
            self.rest(session)
        self._meter(session, self.protocol.charges[0])


@dataclass(frozen=True)
class DirectMeter(_MeterUnit):
    """Metering charge without the filter."""

    name: str = "direct-meter"

    def run(self, session: Session) -> None:
        """Charge, take a ladder of exposures."""
        self.rest(session)
        self._meter(session, self.protocol.direct[0])
        self._require_glow(session, self.name)


#: Largest expected ratio of the glow to that of the reference charge, for exposures.
HEADROOM = 2.0
#: Largest ratio of a shutter time to the first one, which keeps counts late in a decay.
EXPOSURES_GROW = 16.0


@dataclass(frozen=True)
class _ChargeUnit(ExcitationUnit):
    """One charge and the decay after it."""

    def _charge(self, session: Session, role: str, charge_s: float, lasting_s: float) -> None:
        self.rest(session)
        capabilities = session.rig[CAMERA].capabilities()
        schedule = self._schedule(session, role, charge_s, lasting_s)
        longest_s = self.protocol.longest_exposures_s(capabilities, lasting_s)
        check_visible(session, self.protocol.first)
        charge(session, charge_s, self.light_on)
        session.run_sequence(
            [
                *lights_out(session, self.light_off),
                *(
                    at(time_s, TakeFrame(role, self.protocol.settings(min(exposure_s, most_s))))
                    for (time_s, exposure_s), most_s in zip(
                        schedule.frames(), longest_s, strict=True
                    )
                ),
            ]
        )

    def _schedule(self, session: Session, role: str, charge_s: float, lasting_s: float) -> Schedule:
        """Return exposures that follow from the longest similar charge, else from the metering."""
        protocol, capabilities = self.protocol, session.rig[CAMERA].capabilities()
        times_s = protocol.frame_times_s(lasting_s)
        longest_s = max(protocol.longest_exposures_s(capabilities, lasting_s))

        def decide() -> Schedule:
            reference_s, frames = self._reference_charge(session, role)
            schedule = DecayMeter([self.measure(frame) for frame in frames]).schedule(
                times_s, capabilities, longest_s, EXPOSURES_GROW, self._warner(session)
            )
            shorter = max(charge_s / reference_s / HEADROOM, 1.0)
            exposures_s = [
                capabilities.exposure_at_most(exposure_s / shorter)
                for exposure_s in schedule.exposures_s
            ]
            return Schedule(schedule.times_s, tuple(exposures_s))

        return session.decide("exposure", decide, Schedule.constant(times_s, longest_s))

    def _reference_charge(self, session: Session, role: str) -> tuple[float, list[FrameRecord]]:
        """Return charge time and frames of the longest charge of the kind."""
        charges = self._charges_so_far(session, role)
        if charges:
            return max(charges, key=lambda charge: charge[0])
        meter = self._meter_name(role)
        return _light_on_s(session, meter), [
            frame for frame in session.frames(FrameRole.METER) if frame.unit == meter
        ]

    def _warner(self, session: Session) -> Callable[[str], None]:
        """Return the function that receives warnings of a glow too bright or too dim."""
        return session.warn

    def _meter_name(self, role: str) -> str:
        """Return the name of the unit that metered the same kind of charge."""
        return f"{role}-meter"

    def _is_alike(self, frame: FrameRecord) -> bool:
        """Whether a frame of the same role is after the same kind of charge."""
        return True

    def _charges_so_far(self, session: Session, role: str) -> list[tuple[float, list[FrameRecord]]]:
        """Return charge time and frames of every charge of the kind so far."""
        units: dict[str, list[FrameRecord]] = {}
        for frame in filter(self._is_alike, session.frames(role)):
            units.setdefault(frame.unit, []).append(frame)
        return [(_light_on_s(session, unit), frames) for unit, frames in units.items()]

    def _glow_by_charge(
        self, session: Session, charges: Sequence[tuple[float, list[FrameRecord]]]
    ) -> tuple[list[float], FloatArray]:
        """Return the charge times, and the glow of every place in the first frame after each."""
        darks = self.darks(session)
        return [charge_s for charge_s, _ in charges], np.array(
            [self.rates(frames[0], darks) for _, frames in charges]
        )


def _light_on_s(session: Session, unit: str) -> float:
    """Return the time for which the lamp, or an LED, shone in a unit, in seconds."""
    actions = [*session.actions(LAMP.key), *session.actions(LEDS.key)]
    switched = [action for action in actions if action.unit == unit]
    on_s = next(action.start_time for action in switched if action.action != DARK)
    off_s = (action.start_time for action in switched if action.action == DARK)
    return next(time_s for time_s in off_s if time_s > on_s) - on_s


def _selected(protocol: ExcitationSettings) -> ExcitingLights:
    """Return the lights that are selected one after another."""
    assert protocol.select is not None, "a protocol without them has no units that use them"
    return protocol.select


@dataclass(frozen=True)
class DoublingUnit(_ChargeUnit):
    """Charge through the filter, twice as long as the last, unless the glow has stopped growing."""

    number: int

    @property
    def name(self) -> str:
        """Name of the unit: `strip-1`, `strip-2`, …"""
        return UnitKind.STRIP.numbered(self.number)

    def run(self, session: Session) -> None:
        """Charge and photograph, unless the glow has stopped growing."""

        def grows() -> bool:
            charges = self._charges_so_far(session, ExcitationFrames.STRIP)
            return len(charges) == self.number - 1 and still_grows(
                self._glow_by_charge(session, charges)[1], self.protocol.growth
            )

        if self.number > 2 and not session.decide("the glow still grows", grows, when_planned=True):
            return
        session.wait_until_warm("camera")
        charge_s = self.protocol.doubled_s(self.number)
        self._charge(session, ExcitationFrames.STRIP, charge_s, self.protocol.duration)


@dataclass(frozen=True)
class RefiningUnit(_ChargeUnit):
    """Charge through the filter, of the most informative duration."""

    number: int

    @property
    def name(self) -> str:
        """Name of the unit: `refine-1`, `refine-2`, …"""
        return UnitKind.REFINE.numbered(self.number)

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")

        def decide() -> float:
            return most_informative_s(
                *self._glow_by_charge(
                    session, self._charges_so_far(session, ExcitationFrames.STRIP)
                )
            )

        worst_s = self.protocol.doubled_s(self.protocol.at_most)
        charge_s = session.decide("charge for so many seconds", decide, worst_s)
        self._charge(session, ExcitationFrames.STRIP, charge_s, self.protocol.duration)


@dataclass(frozen=True)
class BandUnit(_ChargeUnit):
    """Charge by a selected light, which need not excite the sample."""

    light: str
    number: int

    @property
    def name(self) -> str:
        """Name of the unit: `band-450 nm-1`, `band-450 nm-2`, …"""
        return UnitKind.of_light(self.light, self.number)

    @property
    def light_on(self) -> LampSwitch | LedSwitch:
        """Action that switches the light on."""
        return _selected(self.protocol).on(self.light)

    @property
    def light_off(self) -> LampSwitch | LedSwitch:
        """Action that switches it off."""
        return _selected(self.protocol).off

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")
        charge_s = self.protocol.charges[self.number - 1]
        self._charge(session, ExcitationFrames.BAND, charge_s, self.protocol.duration)

    def _warner(self, session: Session) -> Callable[[str], None]:
        return lambda text: None  # hardly any glow says that this light hardly excites

    def _meter_name(self, role: str) -> str:
        return UnitKind.of_light(self.light, "meter")

    def _is_alike(self, frame: FrameRecord) -> bool:
        return UnitKind.light_of(frame.unit) == self.light


@dataclass(frozen=True)
class DirectUnit(_ChargeUnit):
    """Charge by the lamp itself; after the last one, a longer decay."""

    number: int

    @property
    def name(self) -> str:
        """Name of the unit: `direct-1`, `direct-2`, …"""
        return UnitKind.DIRECT.numbered(self.number)

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")
        protocol = self.protocol
        last = self.number == len(protocol.direct)
        lasting_s = protocol.last_decay if last else protocol.duration
        self._charge(session, ExcitationFrames.DIRECT, protocol.direct[self.number - 1], lasting_s)


class Excitation(ExcitationSettings, ConfiguredProtocol):
    """Excitation protocol; `excitation.yaml` is the commented example."""

    @property
    def rate_frames(self) -> Collection[str]:
        """Roles of the frames to which rates are fitted."""
        return tuple(ExcitationFrames)

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, then metering and charges by bands, then the same by the lamp itself."""
        direct: list[Unit] = [
            DirectMeter(self),
            *(DirectUnit(self, number) for number in range(1, len(self.direct) + 1)),
        ]
        rests = self.samples == 1
        by_itself = [ConfiguredUnit(unit, LVF_AWAY, BY_ITSELF, rests=rests) for unit in direct]
        if self.select is not None:
            return [
                ConfiguredUnit(DarkUnit(self), LVF_AWAY, BY_ITSELF, is_dark=True),
                *self._by_lights(self.select),
                *by_itself,
            ]
        through: list[Unit] = [
            StripMeter(self),
            *(DoublingUnit(self, number) for number in range(1, self.at_most + 1)),
            *(RefiningUnit(self, number) for number in range(1, self.refine + 1)),
        ]
        return [
            ConfiguredUnit(DarkUnit(self), LVF_ON, THROUGH_IT, is_dark=True),
            *(ConfiguredUnit(unit, LVF_ON, THROUGH_IT, rests=rests) for unit in through),
            *by_itself,
        ]

    def _by_lights(self, lights: ExcitingLights) -> Iterator[ConfiguredUnit]:
        """Yield metering and charges by one light after another."""
        rests = self.samples == 1
        for place, light in enumerate(lights.names()):
            configuration = lights.configuration(light)
            yield ConfiguredUnit(
                BandMeter(self, light, place == 0), configuration, BY_ONE, rests=rests
            )
            for number in range(1, len(self.charges) + 1):
                unit = BandUnit(self, light, number)
                yield ConfiguredUnit(unit, configuration, BY_ONE, rests=rests)
