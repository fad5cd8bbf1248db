"""Albedo and total radiance factor of a sample, through the variable filter beside a grey card.

Light that a lit sample sends back is reflection at its own wavelength, prompt fluorescence, and
glow: L_o = L_e + L_p + R L_i (Nalbach et al., Practical Capture and Reproduction of Phosphorescent
Appearance, eq. 2). Below the filter a place is lit by narrow light, through it all light at one
wavelength is seen; the glow alone is photographed when the lamp is off.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from pydantic import Field

from labrig.acquire import (
    CAMERA,
    LAMP_OFF,
    SHIELD,
    SHIELD_COVER,
    Session,
    TakeFrame,
    TimedAction,
    at,
)
from labrig.calibration import LVF_KIND
from labrig.foundation.quantity import Count, DurationS
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
    LvfPlace,
)
from labrig.protocols.steps.bracketing import LONGER, Bracketing, SceneUnit, StillDarkUnit
from labrig.protocols.steps.camera_settings import MARGIN_S, CameraSettings
from labrig.protocols.steps.patch_names import FilterPatches
from labrig.protocols.steps.strip_scenes import StripUnit


class ReflectanceFrames(StrEnum):
    """Roles of frames of card, lit sample and its glow, by white light and by narrow light."""

    CARD_WHITE = "reflectance-card-white"
    SAMPLE_WHITE = "reflectance-sample-white"
    GLOW_WHITE = "reflectance-glow-white"
    CARD_NARROW = "reflectance-card-narrow"
    SAMPLE_NARROW = "reflectance-sample-narrow"
    GLOW_NARROW = "reflectance-glow-narrow"


#: Time after lamp off at which the last red light of a filament is gone, without a shield, too.
GLOW_FIRST_S = 0.6
#: Number of exposures of the glow, each `LONGER` times the one before.
GLOW_EXPOSURES = 3

#: Reasons for the configurations.
_WHITE = "all light that comes back is seen at one wavelength after the other"
_NARROW = "each place is lit by one wavelength, so that fluorescence shows as another colour"


class Reflectance(ConfiguredProtocol):
    """Settings of a measurement of reflectance; `reflectance.yaml` is the commented example.

    Attributes
    ----------
    camera
        Sensitivity and aperture of the camera.
    charge
        Time for which the lamp lights the sample before it is photographed, so that its glow is
        steady, for example `10 min`.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs at each of two exposures of a scene; the longer exposure is for the
        dim ends of the strip.
    patches
        Rows of several materials below the filter, by name: `[x, y, width, height]` in pixels, or
        all four as fractions of the frame, one above the other, each as long as the filter.
        Default: one material.
    """

    requires = (LVF_KIND,)
    curves = ("lamp", "grey_card")

    protocol: Literal["reflectance"] = "reflectance"
    camera: CameraSettings = CameraSettings(iso=100)
    charge: DurationS = Field(600.0, ge=0)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(2, ge=1)
    patches: FilterPatches = Field(default_factory=dict)

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing with which card and sample are photographed."""
        return Bracketing(self.camera, self.longest, self.repeats)

    @property
    def picture_frames(self) -> Collection[str]:
        """Role of the frames that show the sample in white light."""
        return (ReflectanceFrames.SAMPLE_WHITE,)

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, then the sample between two cards: by white light, by narrow light."""
        dark = ConfiguredUnit(
            StillDarkUnit(self.bracketing), BenchConfiguration(), "", is_dark=True
        )
        white = self._lit(
            "white", "before camera", _WHITE,
            ReflectanceFrames.CARD_WHITE, ReflectanceFrames.SAMPLE_WHITE,
            ReflectanceFrames.GLOW_WHITE,
        )  # fmt: skip
        narrow = self._lit(
            "narrow", "on sample", _NARROW,
            ReflectanceFrames.CARD_NARROW, ReflectanceFrames.SAMPLE_NARROW,
            ReflectanceFrames.GLOW_NARROW,
        )  # fmt: skip
        return [dark, *white, *narrow]

    def _lit(
        self, light: str, lvf: LvfPlace, why: str, card: str, sample: str, glow: str
    ) -> tuple[ConfiguredUnit, ConfiguredUnit, ConfiguredUnit]:
        """Return the sample between two cards in one light."""
        scene, on_card = self.bracketing, BenchConfiguration("grey card", lvf)
        lit = LitSampleUnit(scene, f"sample-{light}", sample, charge_s=self.charge, glow_role=glow)
        return (
            ConfiguredUnit(StripUnit(scene, f"card-{light}-1", card), on_card, why),
            ConfiguredUnit(lit, BenchConfiguration("lit sample", lvf), why),
            ConfiguredUnit(StripUnit(scene, f"card-{light}-2", card), on_card, why),
        )


@dataclass(frozen=True)
class LitSampleUnit(SceneUnit):
    """The sample under the lamp until its glow is steady, and its glow just after lamp off.

    Attributes
    ----------
    charge_s
        Duration of the charge in seconds.
    glow_role
        Role of the frames of the glow.
    """

    charge_s: float = 0.0
    glow_role: str = ""

    def check(self, session: Session) -> None:
        """Switch the lamp off, and photograph the glow where the sample lies."""
        capabilities = session.rig[CAMERA].capabilities()
        steps: list[TimedAction] = [at(0.0, LAMP_OFF)]
        if SHIELD in session.rig:
            steps.append(at(0.0, SHIELD_COVER))
        at_s = GLOW_FIRST_S
        for step in reversed(range(GLOW_EXPOSURES)):
            exposure_s = capabilities.exposure_at_most(self.bracketing.longest_s / LONGER**step)
            steps.append(at(at_s, TakeFrame(self.glow_role, self.bracketing.settings(exposure_s))))
            at_s += exposure_s + capabilities.overhead_s + MARGIN_S
        session.run_sequence(steps)

    def light(self, session: Session) -> None:
        """Light the sample until lamp and glow are steady."""
        super().light(session)
        session.wait(self.charge_s, "charging")
