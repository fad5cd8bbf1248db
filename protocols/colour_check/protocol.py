"""A bench's colours: a ColorChecker photographed plainly, and its patches through the LVF.

Nalbach et al. validate their spectra by patches of a colour checker with known reflectances
(Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.3).
"""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import RigFile
from labrig.calibration import LVF_KIND
from labrig.foundation.quantity import Count, DurationS
from labrig.optics import CHART_PATCHES
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.bracketing import Bracketing, SceneUnit, StillDarkUnit
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.protocols.steps.chart_scenes import (
    CARD_UNIT,
    CHART_UNIT,
    THROUGH_UNIT,
    WHY_CARD,
    WHY_CHART,
    WHY_THROUGH,
    ChartUnit,
)
from labrig.protocols.steps.strip_scenes import StripUnit


class CheckFrames(StrEnum):
    """Roles of frames of card and chart by themselves, and of card and patches through the LVF."""

    CARD = "check-card"
    CHART = "check-chart"
    CARD_THROUGH = "check-card-through"
    PATCH = "check-patch"


PatchNumber = Annotated[int, Field(ge=1, le=len(CHART_PATCHES))]
_CARD, _CHART = BenchConfiguration("grey card"), BenchConfiguration("colorchecker")
_CARD_THROUGH = BenchConfiguration("grey card", "before camera")
WHY_PATCH = "its spectrum is known, and the filter is to show the same"


def patch_unit(number: int) -> str:
    """Return the name of the unit of a patch through the filter, numbered from 1."""
    return f"patch-{number:02d}"


class ColourCheck(ConfiguredProtocol):
    """Settings of a check of colours; `colour_check.yaml` is the commented example.

    Attributes
    ----------
    chart
        Reflectances of the ColorChecker's 24 patches: the shipped means over 30 charts,
        `colorchecker`, or the path of a table of one's own chart, a column for each patch.
    through
        Patches that are seen through the linear variable filter, one by one, by their numbers from
        the brown one, for example `[3, 9, 14, 20]`; `all`, or `none` for a plain chart only.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs at each of two exposures of a scene.
    """

    curves = ("lamp", "grey_card")

    protocol: Literal["colour_check"] = "colour_check"
    chart: str = "colorchecker"
    through: Literal["all", "none"] | tuple[PatchNumber, ...] = "all"
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(2, ge=1)

    @model_validator(mode="after")
    def _every_patch_once(self) -> Self:
        if len(set(self.numbers)) < len(self.numbers):
            raise ValueError("expected every patch once in 'through', or none of them")
        return self

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the patches that are seen through the filter, from 1 on."""
        if self.through == "all":
            return tuple(range(1, len(CHART_PATCHES) + 1))
        return () if self.through == "none" else self.through

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing of every scene."""
        return Bracketing(self.camera, self.longest, self.repeats)

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols whose results this one needs and the rig file does not name."""
        missing = bool(self.numbers) and rig.optics.named(LVF_KIND) is None
        return [LVF_KIND.protocol] if missing else []

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, card and chart plainly, card and patches through the LVF."""
        taken = self.bracketing
        scenes = [
            ConfiguredUnit(StillDarkUnit(taken), BenchConfiguration(), "", is_dark=True),
            ConfiguredUnit(SceneUnit(taken, CARD_UNIT, CheckFrames.CARD), _CARD, WHY_CARD),
            ConfiguredUnit(ChartUnit(taken, CHART_UNIT, CheckFrames.CHART), _CHART, WHY_CHART),
        ]
        if self.numbers:
            card = StripUnit(taken, THROUGH_UNIT, CheckFrames.CARD_THROUGH)
            scenes.append(ConfiguredUnit(card, _CARD_THROUGH, WHY_THROUGH))
        for number in self.numbers:
            patch = SceneUnit(taken, patch_unit(number), CheckFrames.PATCH)
            configuration = replace(_CARD_THROUGH, stage="colorchecker", chart_patch=number)
            scenes.append(ConfiguredUnit(patch, configuration, WHY_PATCH))
        return scenes
