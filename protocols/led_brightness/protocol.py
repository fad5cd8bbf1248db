"""Spectrum and brightness of every LED from a white reference, by camera and spectrometer.

The factors b_m by which a fluorescent surface's values are divided (chapter 4 of the thesis that
`led_fluorescence` follows). A camera sees no ultraviolet: below 400 nm a spectrometer is needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from pydantic import Field

from labrig.acquire import SPECTROMETER, Session, Unit
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.region import CENTRE, Region
from labrig.protocols.steps.bench_configuration import RestoreBench, WithConfiguration
from labrig.protocols.steps.bracketing import StillDarkUnit
from labrig.protocols.steps.led_scenes import (
    AGAIN,
    CARD,
    CARD_REASON,
    ON_CARD,
    ON_SAMPLE,
    LedSettings,
    LedUnit,
)
from labrig.protocols.steps.led_spectra import SpectrumReadings


class BrightnessFrames(StrEnum):
    """Roles of frames of the white reference under an LED and after it, and of spectra."""

    CARD = "led-card"
    CARD_OFF = "led-card-off"
    SPECTRUM = "led-spectrum"
    SPECTRUM_OFF = "led-spectrum-off"


class LedBrightness(LedSettings):
    """Settings of a calibration of LEDs; `led_brightness.yaml` is the commented example.

    Attributes
    ----------
    card
        Region of the white reference in the frame: `[x, y, width, height]` in pixels, or all four
        as fractions of the frame.
    integration
        Longest integration time of the spectrometer, if there is one, for example `1 s`.
    repetitions
        Number of spectra in a reading.
    """

    curves = ("grey_card",)

    protocol: Literal["led_brightness"] = "led_brightness"
    card: Region = CENTRE
    integration: DurationS = Field(1.0, gt=0)
    repetitions: Count = Field(10, ge=2, le=1000)

    def units(self) -> Sequence[Unit]:
        """Return darks, the white reference under every LED, and under the first once more."""
        order = self.shuffled()
        first, *others = [*(self._unit(led, CARD) for led in order), self._unit(order[0], AGAIN)]
        return [
            StillDarkUnit(self.bracketing),
            WithConfiguration(first, ON_CARD, ON_SAMPLE, CARD_REASON),
            *others,
            RestoreBench(ON_CARD),
        ]

    def _unit(self, led: str, begin: str) -> "BrightnessUnit":
        return BrightnessUnit(
            self.bracketing,
            led,
            f"{begin}{led}",
            BrightnessFrames.CARD,
            BrightnessFrames.CARD_OFF,
            SpectrumReadings(self.integration, self.repetitions),
        )


@dataclass(frozen=True)
class BrightnessUnit(LedUnit):
    """The white reference under one LED; the spectrometer reads before and after the camera.

    Attributes
    ----------
    readings
        Settings of the spectrometer's readings.
    """

    readings: SpectrumReadings

    def measure_lit(self, session: Session) -> None:
        """Read spectrum and photographs; the second reading shows how the LED droops."""
        if SPECTROMETER not in session.rig:
            super().measure_lit(session)
            return
        self.readings.meter(session, self.name)
        self.readings.read(session, BrightnessFrames.SPECTRUM, self.name)
        super().measure_lit(session)
        self.readings.read(session, BrightnessFrames.SPECTRUM, self.name)

    def measure_dark(self, session: Session) -> None:
        """Read and photograph what is there without the LED."""
        if SPECTROMETER in session.rig:
            self.readings.read(session, BrightnessFrames.SPECTRUM_OFF, self.name)
        super().measure_dark(session)
