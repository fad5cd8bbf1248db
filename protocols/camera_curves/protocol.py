"""Spectral sensitivities of a camera that nobody has measured, from a ColorChecker.

After Jiang et al., What is the space of spectral sensitivity functions for digital color cameras?
(2013): cameras are alike enough for the 24 patches to tell the rest.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from labrig.acquire import RigFile
from labrig.calibration import LVF_KIND
from labrig.foundation.quantity import Count, DurationS
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


class CurvesFrames(StrEnum):
    """Roles of frames of card and chart by themselves, and of the card through the filter."""

    CARD = "curves-card"
    CHART = "curves-chart"
    THROUGH = "curves-through"


CameraName = Annotated[str, Field(min_length=1)]
_CARD, _CHART = BenchConfiguration("grey card"), BenchConfiguration("colorchecker")
_THROUGH = BenchConfiguration("grey card", "before camera")


class CameraCurves(ConfiguredProtocol):
    """Settings of a measurement of camera curves; `camera_curves.yaml` is the commented example.

    Attributes
    ----------
    chart
        Reflectances of the ColorChecker's 24 patches: the shipped means over 30 charts,
        `colorchecker`, or the path of a table of one's own chart, a column for each patch.
    card
        Whether a grey card is photographed in the chart's place, too, so that it does not matter
        how evenly the lamp shines there.
    through
        Whether the grey card is photographed through the linear variable filter, too, which makes
        the errors of the curves less than half as large. It needs a calibrated filter.
    leave_out
        Names of shipped cameras from which nothing is to be concluded, for example
        `[canon_eos_600d]`. The camera's own model is left out anyway.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs at each of two exposures of a scene.
    """

    curves = ("lamp",)

    protocol: Literal["camera_curves"] = "camera_curves"
    chart: str = "colorchecker"
    card: bool = True
    through: bool = False
    leave_out: tuple[CameraName, ...] = ()
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(4, ge=1)

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing of every scene."""
        return Bracketing(self.camera, self.longest, self.repeats)

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols whose results this one needs and the rig file does not name."""
        missing = self.through and rig.optics.named(LVF_KIND) is None
        return [LVF_KIND.protocol] if missing else []

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, card and chart, and the card through the filter."""
        scenes = [
            ConfiguredUnit(StillDarkUnit(self.bracketing), BenchConfiguration(), "", is_dark=True)
        ]
        if self.card:
            card = SceneUnit(self.bracketing, CARD_UNIT, CurvesFrames.CARD)
            scenes.append(ConfiguredUnit(card, _CARD, WHY_CARD))
        chart = ChartUnit(self.bracketing, CHART_UNIT, CurvesFrames.CHART)
        scenes.append(ConfiguredUnit(chart, _CHART, WHY_CHART))
        if self.through:
            through = StripUnit(self.bracketing, THROUGH_UNIT, CurvesFrames.THROUGH)
            scenes.append(ConfiguredUnit(through, _THROUGH, WHY_THROUGH))
        return scenes
