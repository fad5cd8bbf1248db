"""Saturation: decays after short and long charges, under the lamp and under a weaker light.

Nalbach et al. take r(0) = 1 after a long charge (sec. 4.4). Saturation in time is not saturation in
level: two irradiances distinguish them. And the rates should not depend on the charge.
"""

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import CameraCapabilities, ManualStep, ProtocolModel, Unit
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, Fraction, WordOrDuration, duration_text
from labrig.foundation.region import CENTRE
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    WithConfiguration,
    WithManualStep,
)
from labrig.protocols.steps.camera_settings import CameraSettings, FramePeriod
from labrig.protocols.steps.decays import DecaySettings, DecayUnit
from labrig.protocols.steps.glow import DarkUnit, MeterUnit
from labrig.protocols.steps.patch_names import Patches
from labrig.protocols.steps.random_spacing import Spacing


class Light(StrEnum):
    """Light that charged the sample: the lamp at full or weaker irradiance."""

    FULL = "full"
    WEAKER = "weaker"

    def numbered(self, number: int) -> str:
        """Return the name of the unit of a charge under this light."""
        return f"{self}-{number}"

    @classmethod
    def of(cls, unit: str) -> Self:
        """Return the light of such a unit."""
        return cls(unit.rpartition("-")[0])


Charge = Annotated[DurationS, Field(gt=0)]

#: Reason for the manual steps.
WHY = "saturation in level shows only between two irradiances"


class WeakerLight(FrozenModel):
    """Weakening of the light by hand: by a neutral filter or by a distance.

    Attributes
    ----------
    filter
        Name of the neutral filter to put before the lamp, for example `neutral-50`. Either this or
        `distance` is given.
    distance
        Distance from the sample to which the lamp is moved, for example `1.41 m`. Either this or
        `filter` is given.
    fraction
        Fraction of the irradiance that is left, for example `50 %`.
    fraction_sigma
        Standard uncertainty of `fraction`, relative to it, for example `2 %`.
    """

    filter: str | None = Field(None, min_length=1)
    distance: str | None = Field(None, min_length=1)
    fraction: Fraction = Field(gt=0, lt=1)
    fraction_sigma: Fraction = Field(0.02, ge=0, lt=1)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.filter is None) == (self.distance is None):
            raise ValueError("expected either 'filter: NAME' or 'distance: 1.4 m'")
        return self

    def begun(self, unit: Unit) -> Unit:
        """Return `unit` with the light weakened before it."""
        if self.filter is not None:
            return WithConfiguration(
                unit, BenchConfiguration(filter=self.filter), BenchConfiguration(), WHY
            )
        instruction = f"move the lamp to a distance of {self.distance} from the sample"
        return WithManualStep(unit, ManualStep(instruction, WHY, f"lamp at {self.distance}"))

    def ended(self, unit: Unit) -> Unit:
        """Return `unit` with the light restored before it."""
        if self.filter is not None:
            return WithConfiguration(
                unit, BenchConfiguration(), BenchConfiguration(filter=self.filter), WHY
            )
        return WithManualStep(unit, ManualStep("move the lamp back", WHY, "lamp back"))


class Saturation(ProtocolModel):
    """Settings of a saturation test; `saturation.yaml` is the commented example.

    Attributes
    ----------
    charges
        Durations of the charges, rising, for example `[5 min, 45 min, 90 min]`. The last two show
        saturation in time; the first one, much shorter, shows rates that depend on the level.
    weaker
        Second, weaker irradiance, which saturation in level takes. Default: none, and r(0) remains
        unknown.
    every
        Time between the begins of two photographs, in the mean, for example `5 s`.
    spacing
        Spacing of the photographs' begins: `random`, so that no periodic flicker of light or camera
        beats with them, or `even`.
    duration
        Time after lamp off until which photographs begin, for example `180 s`.
    first
        Time from lamp off to the first photograph, for example `800 ms`. A trap door must be open
        by then.
    camera
        Sensitivity and aperture of the camera.
    exposure
        Shutter time of all photographs, for example `1 s`. `auto` meters a short charge first, so
        that nothing clips.
    patches
        Regions of interest by name: `[x, y, width, height]` in pixels, or all four as fractions of
        the frame.
    states
        Number of excited states to fit: 1, 2 or 3; `auto` chooses it from the data.
    """

    protocol: Literal["saturation"] = "saturation"
    charges: tuple[Charge, ...] = Field((300.0, 2700.0, 5400.0), min_length=2)
    weaker: WeakerLight | None = None
    every: FramePeriod = 5.0
    spacing: Spacing = "random"
    duration: DurationS = Field(180.0, gt=0, alias="for")
    first: DurationS = Field(0.8, ge=0)
    camera: CameraSettings = CameraSettings()
    exposure: Annotated[float | Literal["auto"], WordOrDuration("auto")] = "auto"
    patches: Patches = Field({"sample": CENTRE}, min_length=1)
    states: Literal["auto", 1, 2, 3] = "auto"

    @model_validator(mode="after")
    def _longer_and_longer(self) -> Self:
        for shorter, longer in pairwise(self.charges):
            if longer <= shorter:
                raise ValueError(
                    f"expected rising charges, got {duration_text(longer)} after "
                    f"{duration_text(shorter)}"
                )
        self._decay(self.charges[0])
        return self

    def units(self) -> Sequence[Unit]:
        """Return darks, then metering and decays, weaker light first: each leaves less glow."""
        dark, full = DarkUnit(self._decay(self.charges[0])), self._decays(Light.FULL)
        if self.weaker is None:
            return [dark, *full]
        weaker = self._decays(Light.WEAKER)
        return [
            dark,
            self.weaker.begun(weaker[0]),
            *weaker[1:],
            self.weaker.ended(full[0]),
            *full[1:],
        ]

    def frame_spacing(self, capabilities: CameraCapabilities) -> Sequence[str]:
        """Return how the frames of the decays are spaced, in two lines for a plan."""
        return self._decay(self.charges[0]).frame_spacing(capabilities)

    def _decays(self, light: Light) -> list[Unit]:
        metering = f"meter-{light}"
        decays: list[Unit] = [
            DecayUnit(self._decay(charge_s), light.numbered(number), metering)
            for number, charge_s in enumerate(self.charges, start=1)
        ]
        if isinstance(self.exposure, str):
            shortest_s = self.charges[0]
            decays.insert(0, MeterUnit(self._decay(shortest_s), shortest_s, metering))
        return decays

    def _decay(self, charge_s: float) -> DecaySettings:
        """Return one of the decays as a protocol of its own."""
        exposure = self.exposure if isinstance(self.exposure, str) else f"{self.exposure!r} s"
        return DecaySettings.model_validate(
            {
                "sample": self.sample,
                "charge": f"{charge_s!r} s",
                "every": f"{self.every!r} s",
                "spacing": self.spacing,
                "for": f"{self.duration!r} s",
                "first": f"{self.first!r} s",
                "camera": self.camera,
                "exposure": exposure,
                "patches": self.patches,
            }
        )
