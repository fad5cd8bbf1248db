"""What a body and a lens make of light: dark, gain, linearity, shutter, ISO, aperture, flat field.

A grey card under the steady lamp is all that is needed. Photon transfer and linearity as EMVA
Standard 1288 has them; brackets are interleaved with one reference exposure, so that neither the
lamp's drift nor the shutter's flicker is taken for a factor.
"""

from collections.abc import Sequence
from typing import Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import ExposureSettings, ProtocolModel, Unit
from labrig.quantity import Count, DurationS
from labrig.region import CENTRE, Region

from .camera_calibration_units import (
    LINEARITY,
    BracketUnit,
    CardDarkUnit,
    FlatUnit,
    PhotonUnit,
    RepeatUnit,
    aperture_bracket,
    iso_bracket,
    linearity_bracket,
    shutter_bracket,
)
from .steps.arrangement import Arrangement
from .steps.camera_settings import CameraSettings
from .steps.lit_card import CardMeterUnit
from .steps.prepared import PutBackUnit


class CameraCalibration(ProtocolModel):
    """See `camera_calibration.yaml` for what each key means."""

    protocol: Literal["camera_calibration"] = "camera_calibration"
    camera: CameraSettings = CameraSettings(iso=100, f_number=4.0)
    isos: tuple[int, ...] = Field((100, 200, 400, 800, 1600), min_length=1)
    f_numbers: tuple[float, ...] = (2.8, 4.0, 5.6, 8.0, 11.0)
    card: Region = CENTRE
    levels: int = Field(6, ge=3, le=30)
    repeats: Count = Field(24, ge=6)
    cycles: Count = Field(4, ge=2)
    every_nth_shutter_time: int = Field(2, ge=1, le=9)
    longest_dark: DurationS = Field(8.0, gt=0)

    @model_validator(mode="after")
    def _has_its_reference(self) -> Self:
        if self.camera.iso not in self.isos:
            raise ValueError(f"expected camera.iso {self.camera.iso} among 'isos'")
        f_number = self.camera.f_number
        if f_number is None and self.f_numbers:
            raise ValueError("expected 'f_numbers: []' where camera.f_number is null")
        if f_number is not None and f_number not in self.f_numbers:
            raise ValueError(f"expected camera.f_number {f_number:g} among 'f_numbers'")
        return self

    def settings(self) -> ExposureSettings:
        """The reference; its shutter time is to be metered."""
        return ExposureSettings(1.0, self.camera.iso, self.camera.f_number)

    def units(self) -> Sequence[Unit]:
        """Darks, metering, photon transfer, repeats, brackets, flats; then the card goes away."""
        reference = self.settings()
        apertures: list[float | None] = [*self.f_numbers] or [None]
        brackets = {
            LINEARITY: linearity_bracket,
            "shutter": shutter_bracket(self.every_nth_shutter_time, apertures),
            "iso": iso_bracket(self.isos),
            "aperture": aperture_bracket(apertures),
        }
        return [
            *(
                CardDarkUnit(reference, self.card, iso, self.longest_dark, asks=number == 0)
                for number, iso in enumerate(self.isos)
            ),
            CardMeterUnit(reference, self.card),
            *(PhotonUnit(reference, self.card, iso, self.levels) for iso in self.isos),
            RepeatUnit(reference, self.card, self.repeats),
            *(
                BracketUnit(reference, self.card, name, bracket, self.cycles)
                for name, bracket in brackets.items()
            ),
            *(FlatUnit(reference, self.card, f_number) for f_number in apertures),
            PutBackUnit(Arrangement("grey card")),
        ]
