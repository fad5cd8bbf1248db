"""A fluorescent material under narrow-band LEDs, one after another, seen by one camera.

After the thesis of which chapters 3 and 4 describe the set-up (nine LEDs at 45°, the camera at 0°):
the part of the light that comes back at other wavelengths than those of the LED is re-radiated.
"""

import random
from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from labrig.acquire import ProtocolModel, Unit
from labrig.quantity import Count, DurationS

from .steps.camera_settings import CameraSettings
from .steps.led_scenes import LedNames, LedUnit
from .steps.patch_names import Patches
from .steps.scenes import Arranged, Arrangement, Bracketing, PutBackUnit, StillDarkUnit


class LedFrames(StrEnum):
    """Roles of frames of card and samples under an LED, and after it."""

    CARD = "led-card"
    SAMPLE = "led-sample"
    CARD_OFF = "led-card-off"
    SAMPLE_OFF = "led-sample-off"


#: Begin of the units' names, which end with the LED, and the unit that shows bleaching.
CARD, SAMPLE, AGAIN = "card ", "sample ", "again "
_SAMPLE, _CARD = Arrangement(), Arrangement("grey card")

#: LEDs of the shipped rig, after the thesis's nine and its ultraviolet lamp.
LED_NAMES = (
    "365 nm", "405 nm", "430 nm", "455 nm", "490 nm", "530 nm", "565 nm", "590 nm", "625 nm",
)  # fmt: skip


class LedFluorescence(ProtocolModel):
    """Settings of a fluorescence measurement; `led_fluorescence.yaml` is the commented example.

    Attributes
    ----------
    leds
        Names of the LEDs in the rig file, for example `[455 nm, 530 nm]`.
    patches
        Regions of the samples by name: `[x, y, width, height]` in pixels, or all four as fractions
        of the frame.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    exposures
        Number of exposures in a bracket, each eight times the one before; the longest ones are for
        channels that see little of what comes back.
    repeats
        Number of photographs at each exposure.
    order_seed
        Seed of the order of the LEDs, which is shuffled so that drift does not look like a
        spectrum.
    """

    protocol: Literal["led_fluorescence"] = "led_fluorescence"
    leds: LedNames = LED_NAMES
    patches: Patches = Field({"sample": (0.4, 0.4, 0.2, 0.2)}, min_length=1)
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    exposures: Annotated[Count, Field(ge=1, le=5)] = 3
    repeats: Count = Field(2, ge=1)
    order_seed: Count = Field(1, ge=0)

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing with which card and samples are photographed."""
        return Bracketing(self.camera, self.longest, self.repeats, self.exposures)

    def shuffled(self) -> Sequence[str]:
        """Return the LEDs in the order in which they light the samples."""
        order = list(self.leds)
        random.Random(self.order_seed).shuffle(order)
        return order

    def units(self) -> Sequence[Unit]:
        """Return darks, card and samples under every LED, the first LED once more."""
        order = self.shuffled()
        cards = [self._card(led) for led in order]
        samples = [self._sample(led, SAMPLE) for led in order]
        again = [self._sample(order[0], AGAIN)]
        card = "its light under every LED tells how bright the LED is"
        sample = "it is photographed under every LED"
        return [
            StillDarkUnit(self.bracketing),
            Arranged(cards[0], _CARD, _SAMPLE, card),
            *cards[1:],
            Arranged(samples[0], _SAMPLE, _CARD, sample),
            *samples[1:],
            *again,
            PutBackUnit(_SAMPLE),
        ]

    def _card(self, led: str) -> LedUnit:
        roles = LedFrames.CARD, LedFrames.CARD_OFF
        return LedUnit(self.bracketing, led, f"{CARD}{led}", *roles)

    def _sample(self, led: str, begin: str) -> LedUnit:
        roles = LedFrames.SAMPLE, LedFrames.SAMPLE_OFF
        return LedUnit(self.bracketing, led, f"{begin}{led}", *roles)
