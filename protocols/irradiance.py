"""Irradiance of the lamp at the sample, by itself and through the LVF that lies on it.

The map lamp × LVF at the sample's plane enters excitation rates one to one (Nalbach et al.,
Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.6): it is measured.
"""

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.calibration import LVF_KIND
from labrig.quantity import Count, DurationS

from .lvf_calibration import StripUnit
from .steps.camera_settings import CameraSettings
from .steps.scenes import (
    Arrangement,
    Bracketing,
    Scene,
    ScenesProtocol,
    SceneUnit,
    StillDarkUnit,
)


class CardFrames(StrEnum):
    """Roles of frames of the card under the lamp by itself, and through the filter."""

    DIRECT = "irradiance-direct"
    THROUGH = "irradiance-through"


Nanometres = Annotated[float, Field(gt=0, allow_inf_nan=False)]

#: Edges of the bands of Table 1 of the paper.
BANDS_NM = (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)
_DIRECT = Arrangement("grey card")
_THROUGH = Arrangement("grey card", "on sample")


class Irradiance(ScenesProtocol):
    """Settings of an irradiance measurement; `irradiance.yaml` is the commented example.

    Attributes
    ----------
    bands_nm
        Edges of the wavelength bands in nm, rising. The default is that of Table 1 of the paper.
    vector_length
        Euclidean length to which the lamp's irradiance, one number for each band, is scaled;
        excitation rates belong to it. Table 1 of the paper has 1.
    illuminance_lux
        Illuminance by the lamp itself at the sample, read from a lux meter in the card's place.
        With it radiances of the material are absolute. Default: not read, and they are relative to
        the lamp.
    illuminance_sigma_lux
        Standard uncertainty of that reading in lux, with the meter's mismatch to the eye (f1′).
        Default: 5 % of it.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs at each of two exposures of a scene; the longer exposure is for the
        dim ends of the strip.
    rounds
        Number of times that the card is photographed by itself and through the filter in turn,
        because the lamp drifts.
    """

    rests_on = (LVF_KIND,)

    protocol: Literal["irradiance"] = "irradiance"
    bands_nm: tuple[Nanometres, ...] = BANDS_NM
    vector_length: float = Field(1.0, gt=0, allow_inf_nan=False)
    illuminance_lux: float | None = Field(None, gt=0, allow_inf_nan=False)
    illuminance_sigma_lux: float | None = Field(None, ge=0, allow_inf_nan=False)
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(2, ge=1)
    rounds: Count = Field(2, ge=1)

    @model_validator(mode="after")
    def _bands_rise(self) -> Self:
        if len(self.bands_nm) < 2 or any(b <= a for a, b in pairwise(self.bands_nm)):
            raise ValueError(
                f"expected two or more rising wavelengths in 'bands_nm', got {list(self.bands_nm)}"
            )
        return self

    @model_validator(mode="after")
    def _sigma_of_a_reading(self) -> Self:
        if self.illuminance_sigma_lux is not None and self.illuminance_lux is None:
            raise ValueError("expected 'illuminance_lux' beside its σ, got nothing")
        return self

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing with which the card is photographed."""
        return Bracketing(self.camera, self.longest, self.repeats)

    def scenes(self) -> Sequence[Scene]:
        """Return darks, then the card by itself and through the LVF in turn, as the lamp drifts."""
        dark = Scene(StillDarkUnit(self.bracketing), Arrangement(), "", is_dark=True)
        rounds = (self._round(number) for number in range(1, self.rounds + 1))
        return [dark, *(scene for scenes in rounds for scene in scenes)]

    def _round(self, number: int) -> tuple[Scene, Scene]:
        direct = SceneUnit(self.bracketing, f"direct-{number}", CardFrames.DIRECT)
        through = StripUnit(self.bracketing, f"through-{number}", CardFrames.THROUGH)
        return (
            Scene(direct, _DIRECT, "how bright the lamp is by itself"),
            Scene(through, _THROUGH, "how much of it the variable filter leaves"),
        )
