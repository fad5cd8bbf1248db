"""A fluorescent material under narrow-band LEDs, one after another, seen by one camera.

After the thesis of which chapters 3 and 4 describe the set-up (nine LEDs at 45°, the camera at 0°):
the part of the light that comes back at other wavelengths than those of the LED is re-radiated.
"""

from collections.abc import Collection, Sequence
from enum import StrEnum
from typing import Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import Unit
from labrig.protocols.steps.bench_configuration import RestoreBench, WithConfiguration
from labrig.protocols.steps.bracketing import StillDarkUnit
from labrig.protocols.steps.led_scenes import (
    AGAIN,
    CARD,
    CARD_REASON,
    ON_CARD,
    ON_SAMPLE,
    LampNames,
    LampUnit,
    LedSettings,
    LedUnit,
    LitUnit,
)
from labrig.protocols.steps.patch_names import Patches


class LedFrames(StrEnum):
    """Roles of frames of card and samples under an LED, and after it."""

    CARD = "led-card"
    SAMPLE = "led-sample"
    CARD_OFF = "led-card-off"
    SAMPLE_OFF = "led-sample-off"


#: Start of the names of the samples' units.
SAMPLE = "sample "


class LedFluorescence(LedSettings):
    """Settings of a fluorescence measurement; `led_fluorescence.yaml` is the commented example.

    Attributes
    ----------
    lamps
        Names of broadband lamps of the rig's bank, for example `[halogen]`, under which card and
        samples are photographed after the LEDs; their values join the estimate. Default: none.
    patches
        Regions of the samples by name: `[x, y, width, height]` in pixels, or all four as fractions
        of the frame.
    method
        Method of estimating the re-radiation: `joint`, all LEDs together, or `per-led`, each LED by
        itself, as in the thesis. The other one stands beside it in the result.
    """

    curves = ("grey_card",)

    protocol: Literal["led_fluorescence"] = "led_fluorescence"
    lamps: LampNames = ()
    patches: Patches = Field({"sample": (0.4, 0.4, 0.2, 0.2)}, min_length=1)
    method: Literal["joint", "per-led"] = "joint"

    @model_validator(mode="after")
    def _different_names(self) -> Self:
        if shared := set(self.leds) & set(self.lamps):
            raise ValueError(
                f"expected LEDs and lamps of different names, got '{min(shared)}' twice"
            )
        return self

    @property
    def picture_frames(self) -> Collection[str]:
        """Role of the frames that show the sample under an LED."""
        return (LedFrames.SAMPLE,)

    def units(self) -> Sequence[Unit]:
        """Return darks, card and samples under every LED and lamp, the first LED once more."""
        order = self.shuffled()
        cards: list[LitUnit] = [self._card(led) for led in order]
        cards += [self._lamp(lamp, CARD) for lamp in self.lamps]
        samples: list[LitUnit] = [self._sample(led, SAMPLE) for led in order]
        samples += [self._lamp(lamp, SAMPLE) for lamp in self.lamps]
        again = [self._sample(order[0], AGAIN)]
        sample = "it is photographed under every LED"
        return [
            StillDarkUnit(self.bracketing),
            WithConfiguration(cards[0], ON_CARD, ON_SAMPLE, CARD_REASON),
            *cards[1:],
            WithConfiguration(samples[0], ON_SAMPLE, ON_CARD, sample),
            *samples[1:],
            *again,
            RestoreBench(ON_SAMPLE),
        ]

    def _card(self, led: str) -> LedUnit:
        roles = LedFrames.CARD, LedFrames.CARD_OFF
        return LedUnit(self.bracketing, led, f"{CARD}{led}", *roles)

    def _lamp(self, lamp: str, begin: str) -> LampUnit:
        card = LedFrames.CARD, LedFrames.CARD_OFF
        sample = LedFrames.SAMPLE, LedFrames.SAMPLE_OFF
        roles = card if begin == CARD else sample
        return LampUnit(self.bracketing, lamp, f"{begin}{lamp}", *roles)

    def _sample(self, led: str, begin: str) -> LedUnit:
        roles = LedFrames.SAMPLE, LedFrames.SAMPLE_OFF
        return LedUnit(self.bracketing, led, f"{begin}{led}", *roles)
