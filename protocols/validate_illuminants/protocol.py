"""Fluorescent samples under lamps as in daily life, beside what their matrices say of them.

After chapter 5 of the thesis that `led_fluorescence` follows: its figure 5.3 has photographs and
predictions side by side, white balanced by a colour checker under one of the lamps.
"""

from collections.abc import Collection, Sequence
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import ProtocolModel, Unit
from labrig.foundation.named_files import FilePath, ShippedOrFile
from labrig.foundation.quantity import Count, DurationS
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    RestoreBench,
    WithConfiguration,
)
from labrig.protocols.steps.bracketing import Bracketing, StillDarkUnit
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.protocols.steps.led_scenes import CARD, ON_CARD, ON_SAMPLE, LampNames, LampUnit
from labrig.protocols.steps.patch_names import Patches


class IlluminantFrames(StrEnum):
    """Roles of frames of card, samples and colour chart under a lamp, and after it."""

    CARD = "lamp-card"
    SAMPLE = "lamp-sample"
    CHART = "lamp-chart"
    CARD_OFF = "lamp-card-off"
    SAMPLE_OFF = "lamp-sample-off"
    CHART_OFF = "lamp-chart-off"


#: Lamps of the shipped rig.
LAMP_NAMES = ("daylight", "halogen", "xenon", "ultraviolet")
#: Start of the names of the units of samples and chart, which end with the lamp.
SAMPLE, CHART = "sample ", "chart "
ON_CHART = BenchConfiguration("colorchecker")


class ValidateIlluminants(ProtocolModel):
    """Settings of photographs under lamps; `validate_illuminants.yaml` is the commented example.

    Attributes
    ----------
    lamps
        Names of lamps of the bank in the rig file, for example `[daylight, halogen]`.
    patches
        Regions of the samples by name, as they were in the fluorescence measurement:
        `[x, y, width, height]` in pixels, or all four as fractions of the frame.
    fluorescence
        What is compared with the photographs: the folder of a run of `led_fluorescence` with
        patches of the same names, or a material (file or shipped name) for each patch. It may be
        given later, by changing `protocol.yaml` in the run.
    balance
        Lamp under which a white is white in the pictures. Default: the first one.
    chart
        Whether a ColorChecker is photographed, too, under the lamp `balance`, for the colours; it
        is found in the frame. Without one they follow from the camera's curves.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    exposures
        Number of exposures in a bracket, each eight times the one before.
    repeats
        Number of photographs at each exposure.
    """

    curves = ("grey_card",)

    protocol: Literal["validate_illuminants"] = "validate_illuminants"
    lamps: Annotated[LampNames, Field(min_length=1)] = LAMP_NAMES
    patches: Patches = Field({"sample": (0.4, 0.4, 0.2, 0.2)}, min_length=1)
    fluorescence: FilePath | dict[str, ShippedOrFile] | None = None
    balance: str | None = None
    chart: bool = False
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    exposures: Annotated[Count, Field(ge=1, le=5)] = 2
    repeats: Count = Field(2, ge=1)

    @model_validator(mode="after")
    def _names_that_are_there(self) -> Self:
        if self.balance is not None and self.balance not in self.lamps:
            raise ValueError(
                f"expected 'balance' to be one of 'lamps' ({', '.join(self.lamps)}), got "
                f"'{self.balance}'"
            )
        if isinstance(self.fluorescence, dict) and (
            missing := [name for name in self.patches if name not in self.fluorescence]
        ):
            raise ValueError(f"expected a material for each patch, got none for '{missing[0]}'")
        return self

    @property
    def balanced(self) -> str:
        """Lamp under which a white is white."""
        return self.balance or self.lamps[0]

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing of every scene."""
        return Bracketing(self.camera, self.longest, self.repeats, self.exposures)

    @property
    def picture_frames(self) -> Collection[str]:
        """Role of the frames that show the sample under a lamp."""
        return (IlluminantFrames.SAMPLE,)

    def units(self) -> Sequence[Unit]:
        """Return darks, the card under every lamp, the chart under one, the samples under all."""
        cards = [self._card(lamp) for lamp in self.lamps]
        samples = [self._sample(lamp) for lamp in self.lamps]
        card = "its light under every lamp measures the brightness of the lamp"
        chart = "its colours determine the camera's response to colours"
        sample = "it is photographed under every lamp"
        before = ON_CHART if self.chart else ON_CARD
        return [
            StillDarkUnit(self.bracketing),
            WithConfiguration(cards[0], ON_CARD, ON_SAMPLE, card),
            *cards[1:],
            *([WithConfiguration(self._chart(), ON_CHART, ON_CARD, chart)] if self.chart else []),
            WithConfiguration(samples[0], ON_SAMPLE, before, sample),
            *samples[1:],
            RestoreBench(ON_SAMPLE),
        ]

    def _card(self, lamp: str) -> LampUnit:
        roles = IlluminantFrames.CARD, IlluminantFrames.CARD_OFF
        return LampUnit(self.bracketing, lamp, f"{CARD}{lamp}", *roles)

    def _sample(self, lamp: str) -> LampUnit:
        roles = IlluminantFrames.SAMPLE, IlluminantFrames.SAMPLE_OFF
        return LampUnit(self.bracketing, lamp, f"{SAMPLE}{lamp}", *roles)

    def _chart(self) -> LampUnit:
        roles = IlluminantFrames.CHART, IlluminantFrames.CHART_OFF
        return LampUnit(self.bracketing, self.balanced, f"{CHART}{self.balanced}", *roles)
