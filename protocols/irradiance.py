"""What the lamp does to the sample: by itself, and through the LVF that lies on it.

The map lamp × LVF at the sample's plane enters excitation rates one to one (Nalbach et al.,
Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.6): it is measured.
"""

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import ProtocolModel, Unit
from labrig.calibration import LVF_KIND
from labrig.quantity import Count, DurationS

from .lvf_calibration import StripUnit
from .steps.camera_settings import CameraSettings
from .steps.scenes import Arrangement, Bracketing, PutBackUnit, SceneUnit, StillDarkUnit


class CardFrames(StrEnum):
    """The card under the lamp by itself, and through the filter."""

    DIRECT = "irradiance-direct"
    THROUGH = "irradiance-through"


Nanometres = Annotated[float, Field(gt=0, allow_inf_nan=False)]

#: Of Table 1 of the paper.
BANDS_NM = (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)
_DIRECT = Arrangement("grey card")
_THROUGH = Arrangement("grey card", "on sample")


class Irradiance(ProtocolModel):
    """The irradiance protocol; see `irradiance.yaml` for what each key means."""

    rests_on = (LVF_KIND,)

    protocol: Literal["irradiance"] = "irradiance"
    bands_nm: tuple[Nanometres, ...] = BANDS_NM
    vector_length: float = Field(1.0, gt=0, allow_inf_nan=False)
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

    @property
    def bracketing(self) -> Bracketing:
        """How the card is photographed."""
        return Bracketing(self.camera, self.longest, self.repeats)

    def units(self) -> Sequence[Unit]:
        """Darks, then the card by itself and through the LVF in turn: the lamp drifts."""
        units: list[SceneUnit] = []
        for number in range(1, self.rounds + 1):
            before = units[-1].wanted if units else Arrangement()
            why = "how bright the lamp is by itself"
            units.append(
                SceneUnit(
                    self.bracketing, f"direct-{number}", CardFrames.DIRECT, _DIRECT, before, why
                )
            )
            why = "how much of it the variable filter leaves"
            units.append(
                StripUnit(
                    self.bracketing,
                    f"through-{number}",
                    CardFrames.THROUGH,
                    _THROUGH,
                    _DIRECT,
                    why,
                )
            )
        return [StillDarkUnit(self.bracketing), *units, PutBackUnit(units[-1].wanted)]
