"""Spectrum and brightness of every LED from a white reference, by camera and spectrometer.

The factors b_m by which a fluorescent surface's values are divided (chapter 4 of the thesis that
`led_fluorescence` follows). A camera sees no ultraviolet: below 400 nm a spectrometer is needed.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from labrig.acquire import SPECTROMETER, ProtocolModel, Session, Unit
from labrig.quantity import Count, DurationS
from labrig.region import CENTRE, Region

from .led_fluorescence import LED_NAMES
from .steps.camera_settings import CameraSettings
from .steps.led_scenes import LedNames, LedUnit
from .steps.led_spectra import SpectrumReadings
from .steps.scenes import Arranged, Arrangement, Bracketing, PutBackUnit, StillDarkUnit


class BrightnessFrames(StrEnum):
    """Roles of frames of the white reference under an LED and after it, and of spectra."""

    CARD = "led-card"
    CARD_OFF = "led-card-off"
    SPECTRUM = "led-spectrum"
    SPECTRUM_OFF = "led-spectrum-off"


#: Begin of the units' names, which end with the LED, and of the unit that shows drift.
CARD, AGAIN = "card ", "again "
_SAMPLE, _CARD = Arrangement(), Arrangement("grey card")


class LedBrightness(ProtocolModel):
    """Settings of a calibration of LEDs; `led_brightness.yaml` is the commented example.

    Attributes
    ----------
    leds
        Names of the LEDs in the rig file, for example `[455 nm, 530 nm]`.
    card
        Region of the white reference in the frame: `[x, y, width, height]` in pixels, or all four
        as fractions of the frame.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    exposures
        Number of exposures in a bracket, each eight times the one before; the longest ones show
        the tails of an LED's light in channels that should see nothing of it.
    repeats
        Number of photographs at each exposure.
    integration
        Longest integration time of the spectrometer, if there is one, for example `1 s`.
    repetitions
        Number of spectra in a reading.
    order_seed
        Seed of the order of the LEDs, which is shuffled so that drift does not look like a
        spectrum.
    """

    protocol: Literal["led_brightness"] = "led_brightness"
    leds: LedNames = LED_NAMES
    card: Region = CENTRE
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    exposures: Annotated[Count, Field(ge=1, le=5)] = 3
    repeats: Count = Field(2, ge=1)
    integration: DurationS = Field(1.0, gt=0)
    repetitions: Count = Field(10, ge=2, le=1000)
    order_seed: Count = Field(1, ge=0)

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing with which the white reference is photographed."""
        return Bracketing(self.camera, self.longest, self.repeats, self.exposures)

    def shuffled(self) -> Sequence[str]:
        """Return the LEDs in the order in which they light the white reference."""
        order = list(self.leds)
        random.Random(self.order_seed).shuffle(order)
        return order

    def units(self) -> Sequence[Unit]:
        """Return darks, the white reference under every LED, and under the first once more."""
        order = self.shuffled()
        first, *others = [*(self._unit(led, CARD) for led in order), self._unit(order[0], AGAIN)]
        reason = "its light under every LED tells how bright the LED is"
        return [
            StillDarkUnit(self.bracketing),
            Arranged(first, _CARD, _SAMPLE, reason),
            *others,
            PutBackUnit(_CARD),
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
