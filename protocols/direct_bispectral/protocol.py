"""A re-radiation matrix column by column: narrow-band lights, and a spectrometer at 45°/0°.

After the direct set-up of the thesis of which chapters 3 and 4 describe fluorescence in fabrics
(fig. 4.11 compares with it): what comes back of one light, over what a white reference gives back.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    LAMP,
    LAMP_OFF,
    LEDS,
    LEDS_OFF,
    SPECTROMETER,
    LedSwitch,
    ManualStep,
    ProtocolModel,
    ReadSpectrum,
    Session,
    Unit,
)
from labrig.foundation.quantity import Count, DurationS
from labrig.optics import read_spectrometer_reading
from labrig.protocols.steps.bench_configuration import light
from labrig.protocols.steps.led_scenes import LED_NAMES, AllLeds, LedNames, shuffled
from labrig.protocols.steps.patch_names import SampleNames
from labrig.record import PERSON, SpectrumRecord

#: Integration times, as fractions of the longest.
LADDER = tuple(2.0**-step for step in range(10))
#: Every so many steps of the ladder are tried by metering, with so many repetitions each.
METERING_STEPS, METERING_REPETITIONS = 3, 2
#: Repetitions of what is read to see that an LED has gone off, and that no other light is on.
OFF_REPETITIONS = 2
#: Part of the range that the brightest pixels may fill; the rest is room for drift.
TARGET = 0.75
#: Part of the range that ends metering: noise does not matter there.
ENOUGH = 0.05

#: The stage of the white reference; those of the samples have the samples' names.
WHITE = "white"

Nanometres = Annotated[float, Field(ge=250, le=1100)]


class DirectSpectra(StrEnum):
    """Roles of spectra: of the dark, of metering, of what is lit, and just after it."""

    DARK = "direct-dark"
    LOOK = "direct-look"
    LIT = "direct-lit"
    OFF = "direct-off"


class DirectBispectral(ProtocolModel):
    """Settings of a directly measured matrix; `direct_bispectral.yaml` is the commented example.

    Attributes
    ----------
    leds
        Names of the LEDs in the rig file, for example `[455 nm, 530 nm]`.
    filters
        Band-pass filters that are put before the lamp one after another, which is then lit instead
        of the LEDs, for example `[bandpass-450, bandpass-500]`. Null: the LEDs are lit.
    samples
        Names of the samples, in the order in which they come before the spectrometer.
    settle
        Time for which an LED burns before it is read, for example `2 min`, at least as long as the
        rig file says: an LED that still warms is not the same on white and on sample. A lamp takes
        the warm-up time of the rig file instead.
    longest
        Longest integration time of the spectrometer, for example `2 s`; metering chooses this or a
        half, a fourth … of it.
    repetitions
        Number of spectra of each reading; their scatter tells σ.
    first_band, last_band, band_width
        Centres of the first and the last band of the light that comes back, and distance of two
        bands, in nm.
    order_seed
        Seed of the order of the lights, which is shuffled so that drift does not look like a
        spectrum.
    """

    curves = ("grey_card",)

    protocol: Literal["direct_bispectral"] = "direct_bispectral"
    leds: Annotated[LedNames, AllLeds()] = LED_NAMES
    filters: LedNames | None = None
    samples: SampleNames = ("sample",)
    settle: DurationS = Field(120.0, ge=0)
    longest: DurationS = Field(2.0, gt=0, le=10)
    repetitions: Count = Field(10, ge=4, le=1000)
    first_band: Nanometres = 380.0
    last_band: Nanometres = 780.0
    band_width: Annotated[float, Field(ge=2, le=50)] = 10.0
    order_seed: Count = Field(1, ge=0)

    @model_validator(mode="after")
    def _bands_and_names(self) -> Self:
        if self.last_band < self.first_band + self.band_width:
            raise ValueError("expected 'last_band' above 'first_band' by a 'band_width' or more")
        if WHITE in self.samples:
            raise ValueError(f"expected samples with names other than '{WHITE}'")
        return self

    @property
    def lights(self) -> tuple[str, ...]:
        """Names of the LEDs or filters."""
        return self.filters or self.leds

    @property
    def stages(self) -> tuple[str, ...]:
        """Stages before the spectrometer, in order: the white reference, then the samples."""
        return (WHITE, *self.samples)

    def shuffled(self) -> Sequence[str]:
        """Return the lights in the order in which they are lit."""
        return shuffled(self.lights, self.order_seed)

    def unit_name(self, stage: str, light: str, again: bool = False) -> str:
        """Return the name of the unit of a stage under a light, the first or its repetition."""
        return f"{'again ' if again else ''}{stage}: {light}"

    def integration_times_s(self, limits_s: tuple[float, float]) -> list[float]:
        """Return the rising integration times that an instrument with these limits offers."""
        low_s, high_s = limits_s
        longest_s = min(self.longest, high_s)
        return sorted(longest_s * part for part in LADDER if longest_s * part >= low_s)

    def units(self) -> Sequence[Unit]:
        """Return, for white and every sample, darks, all lights, and the first light once more."""
        return [*self._lit_units(), RestoreBench(self)]

    def _lit_units(self) -> Iterator[Unit]:
        order = self.shuffled()
        for stage in self.stages:
            yield DarkUnit(self, stage, f"{stage}: dark")
            for name in order:
                yield LitUnit(self, stage, self.unit_name(stage, name), name)
            yield LitUnit(self, stage, self.unit_name(stage, order[0], again=True), order[0])


@dataclass(frozen=True)
class DarkUnit:
    """Readings of the spectrometer with all lights off, at all integration times."""

    protocol: DirectBispectral
    stage: str
    name: str

    def run(self, session: Session) -> None:
        """Have the stage put in place and read it in the dark."""
        session.wait_until_warm("spectrometer")
        session.ask(_step(self.protocol, self.stage))
        _lights_off(session, self.protocol)
        limits_s = session.rig[SPECTROMETER].integration_limits_s()
        for integration_s in self.protocol.integration_times_s(limits_s):
            session.perform(
                ReadSpectrum(DirectSpectra.DARK, integration_s, self.protocol.repetitions)
            )


@dataclass(frozen=True)
class LitUnit:
    """White reference or sample under one light."""

    protocol: DirectBispectral
    stage: str
    name: str
    light: str

    def run(self, session: Session) -> None:
        """Light it, let the light settle, meter and read; then read what is left without an LED."""
        session.wait_until_warm("spectrometer")
        step = _step(self.protocol, self.stage)
        if not session.decide("in place", lambda: _is_in_place(session, step), when_planned=True):
            session.ask(step)
        self._light(session)
        integration_s = self._metered_s(session)
        session.perform(ReadSpectrum(DirectSpectra.LIT, integration_s, self.protocol.repetitions))
        if self.protocol.filters is None:
            session.perform(LEDS_OFF)
            session.perform(ReadSpectrum(DirectSpectra.OFF, integration_s, OFF_REPETITIONS))

    def _light(self, session: Session) -> None:
        if self.protocol.filters is not None:
            what = f"put the filter {self.light} before the lamp"
            session.ask(ManualStep(what, "its band is the light", f"filter {self.light}"))
            light(session, session.rig.warm_up_s(LAMP.key))
            return
        session.perform(LedSwitch(self.light))
        settle_s = max(self.protocol.settle, session.rig[LEDS].settling_s(self.light))
        session.wait(settle_s, f"the {self.light} LED settles")

    def _metered_s(self, session: Session) -> float:
        """Return the longest integration time at which no pixel is saturated."""
        limits_s = session.rig[SPECTROMETER].integration_limits_s()
        times_s = self.protocol.integration_times_s(limits_s)
        looks_s = sorted(times_s[::-METERING_STEPS])
        for integration_s in looks_s:
            look = ReadSpectrum(DirectSpectra.LOOK, integration_s, METERING_REPETITIONS)
            session.perform(look)
            if session.decide(
                "bright enough", lambda: self._fraction(session) > ENOUGH, when_planned=False
            ):
                break
        return session.decide("integration", lambda: self._chosen_s(session, times_s), times_s[-1])

    def _chosen_s(self, session: Session, times_s: Sequence[float]) -> float:
        look, fraction = self._looks(session)[-1], self._fraction(session)
        target_s = look.integration_s * TARGET / max(fraction, 1e-6)
        if fits_s := [time_s for time_s in times_s if time_s <= target_s]:
            return fits_s[-1]
        session.warn(
            f"{self.name}: even the shortest integration is too bright; dim the light or move the "
            "spectrometer away"
        )
        return times_s[0]

    def _fraction(self, session: Session) -> float:
        """Return the fraction of its range that the brightest pixel of the last look fills."""
        reading = read_spectrometer_reading(self._looks(session)[-1].path)
        return float(reading.corrected().counts.max() / reading.saturation_counts)

    def _looks(self, session: Session) -> Sequence[SpectrumRecord]:
        return [look for look in session.spectra(DirectSpectra.LOOK) if look.unit == self.name]


@dataclass(frozen=True)
class RestoreBench:
    """The bench put back; a unit of its own, so that nothing is measured again for it."""

    protocol: DirectBispectral
    name: str = "put-back"

    def run(self, session: Session) -> None:
        """Switch the lights off, have the samples laid back and the filter taken out."""
        _lights_off(session, self.protocol)
        why = "the next measurement finds the bench as usual"
        session.ask(ManualStep("take the last sample out", why, "sample"))
        if self.protocol.filters is not None:
            session.ask(ManualStep("take the filter out", why, "no filter"))


def _lights_off(session: Session, protocol: DirectBispectral) -> None:
    session.perform(LEDS_OFF if protocol.filters is None else LAMP_OFF)


def _step(protocol: DirectBispectral, stage: str) -> ManualStep:
    """Return the step that puts a stage before the spectrometer, where the lights shine at 45°."""
    if stage == WHITE:
        what = "put the white reference (the rig's grey card) before the spectrometer"
        return ManualStep(what, "it measures the light's spectrum and power", "grey card")
    number = protocol.samples.index(stage) + 1
    what = f"put the sample {stage} before the spectrometer, exactly where the white was"
    return ManualStep(what, "it is read under every light", f"sample {number}")


def _is_in_place(session: Session, step: ManualStep) -> bool:
    """Whether that was the last stage put in place since the devices were connected.

    The bench may have been put to another use before a run is resumed.
    """
    since = session.clock.wall(session.rig.connected_s)
    tasks = [action.task for action in session.actions(PERSON) if action.start_time >= since]
    stages = [task for task in tasks if not task.startswith(("filter ", "no filter"))]
    return stages[-1:] == [step.task]
