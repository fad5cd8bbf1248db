"""Calibration of a camera with its lens: dark, gain, linearity, shutter, ISO, aperture, flat field.

A grey card under the steady lamp is all that is needed. Photon transfer and linearity follow EMVA
Standard 1288; brackets are interleaved with one reference exposure, so that neither the lamp's
drift nor the shutter's flicker is taken for a factor.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.acquire import (
    CAMERA,
    CameraCapabilities,
    ExposureSettings,
    Session,
    TakeFrame,
    Unit,
)
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.region import CENTRE, Region
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.camera_settings import CameraSettings, FNumber, Iso
from labrig.protocols.steps.grey_card import (
    CARD_REASON,
    HALF,
    CardDarkUnit,
    CardLight,
    CardMeterUnit,
    card_light,
    light_card,
)


class CardFrames(StrEnum):
    """Roles of frames of the card: pairs at rising light, repeats, brackets, flat field."""

    PHOTON = "photon"
    REPEAT = "repeat"
    BRACKET = "bracket"
    FLAT = "flat"


#: Name of the unit whose bracket shows the deviation from linearity.
LINEARITY = "linearity"

#: Fractions of the range that the lit card fills in a bracket: less is noise, more may clip where
#: the lens is brightest.
LEAST, MOST = 0.012, 0.7
#: … of the photon transfer.
PHOTON_FRACTIONS = (0.03, 0.75)
#: … of the linearity, into saturation.
LINEARITY_FRACTIONS = (0.015, 2.0)
#: Number of exposures of a bracket between two of its reference.
REFERENCE_EVERY = 3
FLATS = 4

#: The settings of a bracket, its reference first.
Bracket = Callable[[CardLight, CameraCapabilities, ExposureSettings], Sequence[ExposureSettings]]


@dataclass(frozen=True)
class PhotonUnit:
    """Pairs of frames of the lit card at several levels, at one ISO."""

    reference: ExposureSettings
    card: Region
    iso: int
    levels: int

    @property
    def name(self) -> str:
        """Name of the unit, for example `photon-iso-100`."""
        return f"photon-iso-{self.iso}"

    def run(self, session: Session) -> None:
        """Take two frames at each level."""
        light_card(session)
        light, capabilities = (
            card_light(session, self.reference, self.card),
            session.rig[CAMERA].capabilities(),
        )
        settings = replace(self.reference, iso=self.iso)
        fractions = np.linspace(*PHOTON_FRACTIONS, self.levels)
        shots = [light.exposed(float(fraction), settings, capabilities) for fraction in fractions]
        for shot in dict.fromkeys(shots):
            session.perform(TakeFrame(CardFrames.PHOTON, shot))
            session.perform(TakeFrame(CardFrames.PHOTON, shot))


@dataclass(frozen=True)
class RepeatUnit:
    """Repeated frames of one exposure, for the flicker."""

    reference: ExposureSettings
    card: Region
    repeats: int
    name: str = "repeats"

    def run(self, session: Session) -> None:
        """Photograph at the reference exposure."""
        light_card(session)
        light = card_light(session, self.reference, self.card)
        shot = light.exposed(HALF, self.reference, session.rig[CAMERA].capabilities())
        for _ in range(self.repeats):
            session.perform(TakeFrame(CardFrames.REPEAT, shot))


@dataclass(frozen=True)
class FlatUnit:
    """Frames of the lit card at one aperture, for the flat field."""

    reference: ExposureSettings
    card: Region
    f_number: float | None

    @property
    def name(self) -> str:
        """Name of the unit, for example `flat-f4`."""
        return "flat" if self.f_number is None else f"flat-f{self.f_number:g}"

    def run(self, session: Session) -> None:
        """Take a few frames, whose noise averages out."""
        light_card(session)
        light = card_light(session, self.reference, self.card)
        settings = replace(self.reference, f_number=self.f_number)
        shot = light.exposed(HALF, settings, session.rig[CAMERA].capabilities())
        for _ in range(FLATS):
            session.perform(TakeFrame(CardFrames.FLAT, shot))


@dataclass(frozen=True)
class BracketUnit:
    """Frames that differ in one setting, forwards and backwards, with the reference in between."""

    reference: ExposureSettings
    card: Region
    name: str
    bracket: Bracket
    cycles: int

    def run(self, session: Session) -> None:
        """Photograph forwards in one cycle, backwards in the next, so that the drift cancels."""
        light_card(session)
        light = card_light(session, self.reference, self.card)
        first, *others = self.bracket(light, session.rig[CAMERA].capabilities(), self.reference)
        for cycle in range(self.cycles):
            order = others if cycle % 2 == 0 else others[::-1]
            for shot in _interleaved(order, first):
                session.perform(TakeFrame(CardFrames.BRACKET, shot))


def linearity_bracket(
    light: CardLight, capabilities: CameraCapabilities, reference: ExposureSettings
) -> Sequence[ExposureSettings]:
    """Return shutter times from near darkness to saturation."""
    low, high = (light.exposure_s(fraction, reference) for fraction in LINEARITY_FRACTIONS)
    return [
        light.exposed(HALF, reference, capabilities),
        *(replace(reference, exposure_s=time_s) for time_s in _between(capabilities, low, high)),
    ]


def shutter_bracket(every_nth: int, f_numbers: Sequence[float | None]) -> Bracket:
    """Return shutter times at the reference aperture, then longer ones at the smallest aperture."""
    smallest = max((f_number or 0.0 for f_number in f_numbers), default=0.0)

    def bracket(
        light: CardLight, capabilities: CameraCapabilities, reference: ExposureSettings
    ) -> Sequence[ExposureSettings]:
        shots = [light.exposed(HALF, reference, capabilities)]
        stopped_down = replace(reference, f_number=smallest) if smallest else reference
        for settings in dict.fromkeys([reference, stopped_down]):
            low, high = (light.exposure_s(fraction, settings) for fraction in (LEAST, MOST))
            times_s = _between(capabilities, low, high)[::-1][::every_nth]
            shots += [replace(settings, exposure_s=time_s) for time_s in times_s]
        return shots

    return bracket


def iso_bracket(isos: Sequence[int]) -> Bracket:
    """Return one shutter time at every ISO."""

    def bracket(
        light: CardLight, capabilities: CameraCapabilities, reference: ExposureSettings
    ) -> Sequence[ExposureSettings]:
        shot = light.exposed(MOST, replace(reference, iso=max(isos)), capabilities)
        settings = replace(reference, exposure_s=shot.exposure_s)
        return [settings, *(replace(settings, iso=iso) for iso in isos if iso != reference.iso)]

    return bracket


def aperture_bracket(f_numbers: Sequence[float | None]) -> Bracket:
    """Return one shutter time at every aperture."""

    def bracket(
        light: CardLight, capabilities: CameraCapabilities, reference: ExposureSettings
    ) -> Sequence[ExposureSettings]:
        widest = min(f_numbers, key=lambda f_number: f_number or 0.0)
        shot = light.exposed(MOST, replace(reference, f_number=widest), capabilities)
        settings = replace(reference, exposure_s=shot.exposure_s)
        others = [f_number for f_number in f_numbers if f_number != reference.f_number]
        return [settings, *(replace(settings, f_number=f_number) for f_number in others)]

    return bracket


def _between(capabilities: CameraCapabilities, low_s: float, high_s: float) -> list[float]:
    """Return the offered shutter times of that range, at least two."""
    times_s = [time_s for time_s in capabilities.exposures_s if low_s <= time_s <= high_s * 1.0001]
    return times_s if len(times_s) > 1 else list(capabilities.exposures_s[:2])


def _interleaved(
    shots: Sequence[ExposureSettings], reference: ExposureSettings
) -> Iterator[ExposureSettings]:
    for number, shot in enumerate(shots):
        if number % REFERENCE_EVERY == 0:
            yield reference
        yield shot
    yield reference


def _overlap(first: Region, second: Region) -> bool:
    return all(
        first[k] < second[k] + second[k + 2] and second[k] < first[k] + first[k + 2] for k in (0, 1)
    )


class CameraCalibration(ConfiguredProtocol):
    """Settings of a camera calibration; `camera_calibration.yaml` is the commented example.

    Attributes
    ----------
    camera
        Reference sensitivity and aperture, at which all correction factors are 1; the lower the
        ISO, the less noise. Both stand in `isos` and `f_numbers`, too.
    isos
        Sensitivities to calibrate, for example `[100, 200, 400]`. Others are later taken by their
        labels.
    f_numbers
        Apertures to calibrate, for example `[2.8, 4, 5.6]`. Frames at other apertures are refused
        later. Empty for a lens that reports no aperture, with `f_number: null` in `camera`.
    card
        Place of the lit grey card in the frame: `[x, y, width, height]` in pixels, or all four as
        fractions of the frame. The larger it is, the better the flat field is known towards the
        corners.
    black
        Place of a black trap beside the card, such as a box with a hole, lined with black velvet:
        its light is the lens's veiling glare. Null: the glare is not measured.
    levels
        Number of signal levels of the photon transfer curve at every ISO, two frames each.
    repeats
        Number of frames of the same exposure, for the flicker of shutter, aperture and lamp.
    cycles
        Number of passes through each bracket. The uncertainty of a factor is about flicker /
        √cycles.
    every_nth_shutter_time
        Step through the camera's shutter times: 1 calibrates every one for which the lamp is bright
        enough, 3 every third. Those between are interpolated.
    longest_dark
        Longer of the two shutter times of the dark frames, for example `8 s`; the other one is the
        camera's shortest.
    """

    uses_calibrations = False

    protocol: Literal["camera_calibration"] = "camera_calibration"
    camera: CameraSettings = CameraSettings(iso=100, f_number=4.0)
    isos: tuple[Iso, ...] = Field((100, 200, 400, 800, 1600), min_length=1)
    f_numbers: tuple[FNumber, ...] = (2.8, 4.0, 5.6, 8.0, 11.0)
    card: Region = CENTRE
    black: Region | None = None
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

    @model_validator(mode="after")
    def _trap_beside_the_card(self) -> Self:
        if self.black is not None and _overlap(self.black, self.card):
            raise ValueError("expected 'black' beside 'card', got a part of it")
        return self

    def settings(self) -> ExposureSettings:
        """Return the reference settings, whose shutter time is to be metered."""
        return ExposureSettings(1.0, self.camera.iso, self.camera.f_number)

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, metering, photon transfer, repeats, brackets, flats."""
        reference = self.settings()
        apertures: list[float | None] = [*self.f_numbers] or [None]
        brackets = {
            LINEARITY: linearity_bracket,
            "shutter": shutter_bracket(self.every_nth_shutter_time, apertures),
            "iso": iso_bracket(self.isos),
            "aperture": aperture_bracket(apertures),
        }
        darks = [CardDarkUnit(reference, self.card, iso, self.longest_dark) for iso in self.isos]
        lit: list[Unit] = [
            CardMeterUnit(reference, self.card),
            *(PhotonUnit(reference, self.card, iso, self.levels) for iso in self.isos),
            RepeatUnit(reference, self.card, self.repeats),
            *(
                BracketUnit(reference, self.card, name, bracket, self.cycles)
                for name, bracket in brackets.items()
            ),
            *(FlatUnit(reference, self.card, f_number) for f_number in apertures),
        ]
        card = BenchConfiguration("grey card")
        return [
            *(ConfiguredUnit(dark, card, CARD_REASON, is_dark=True) for dark in darks),
            *(ConfiguredUnit(unit, card, CARD_REASON) for unit in lit),
        ]
