"""Irradiance at the sample: of the lamp by itself, and through the LVF or of selected lights.

The map lamp × LVF at the sample's plane enters excitation rates one to one (Nalbach et al.,
Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.6): it is measured.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    LAMP,
    LAMP_OFF,
    LEDS,
    LEDS_OFF,
    SPECTROMETER,
    LedSwitch,
    ReadSpectrum,
    RigFile,
    Session,
)
from labrig.calibration import LVF_KIND
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.region import Region
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.bracketing import Bracketing, SceneUnit, StillDarkUnit
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.protocols.steps.exciting_lights import (
    CardSpectra,
    ExcitingLights,
    Nanometres,
    light_unit,
)
from labrig.protocols.steps.led_spectra import SpectrumReadings
from labrig.protocols.steps.sample_pose import LAMP_DARK_S, face_lamp
from labrig.protocols.steps.strip_scenes import StripUnit


class CardFrames(StrEnum):
    """Roles of frames of the card under the lamp by itself, and by a part of its light, or LEDs."""

    DIRECT = "irradiance-direct"
    THROUGH = "irradiance-through"


#: Edges of the bands of Table 1 of the paper.
BANDS_NM = (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)
_DIRECT = BenchConfiguration("grey card")
_THROUGH = BenchConfiguration("grey card", "on sample")


@dataclass(frozen=True)
class CardUnit(SceneUnit):
    """The card under the lamp or a part of its light, for the camera and for a spectrometer.

    Attributes
    ----------
    readings
        Settings of the spectrometer's readings, if there is one; None for none.
    spectrum
        Role of its reading.
    """

    readings: SpectrumReadings | None = None
    spectrum: CardSpectra = CardSpectra.LIGHT

    def run(self, session: Session) -> None:
        """Light, photograph, read the spectrum."""
        super().run(session)
        if self.readings is not None and SPECTROMETER in session.rig:
            self.readings.meter(session, self.name)
            self.readings.read(session, self.spectrum, self.name)


@dataclass(frozen=True)
class LedCardUnit(CardUnit):
    """The card under one LED, with the lamp off; `lamp` is the LED's name."""

    def run(self, session: Session) -> None:
        """Light the LED, photograph, switch it off."""
        super().run(session)
        session.perform(LEDS_OFF)

    def light(self, session: Session) -> None:
        """Switch the lamp off and the LED on, and wait until it is steady."""
        if session.rig[LAMP].is_on():
            session.perform(LAMP_OFF)
        face_lamp(session)
        session.perform(LedSwitch(self.lamp))
        settles_s = max(session.rig[LEDS].settling_s(self.lamp), LAMP_DARK_S)
        session.wait(settles_s, f"the {self.lamp} LED settles")


@dataclass(frozen=True)
class DarkSpectraUnit:
    """Readings of the spectrometer, if there is one, with the lights off, as long as all others.

    Attributes
    ----------
    readings
        Settings of the readings.
    most
        Largest number of integration times.
    """

    readings: SpectrumReadings
    most: int
    name: str = "dark-spectra"

    def run(self, session: Session) -> None:
        """Switch the lamp off, and read with every integration time that was used."""
        if SPECTROMETER not in session.rig:
            return
        session.perform(LAMP_OFF)
        session.wait(LAMP_DARK_S, "the lamp goes out")

        def used_s() -> tuple[float, ...]:
            records = [*session.spectra(CardSpectra.DIRECT), *session.spectra(CardSpectra.LIGHT)]
            return tuple(sorted({record.integration_s for record in records}))

        longest_s = (self.readings.longest_s,) * self.most
        for integration_s in session.decide("integration", used_s, longest_s):
            repetitions = self.readings.repetitions
            session.perform(ReadSpectrum(CardSpectra.DARK, integration_s, repetitions))


class Irradiance(ConfiguredProtocol):
    """Settings of an irradiance measurement; `irradiance.yaml` is the commented example.

    Attributes
    ----------
    bands_nm
        Edges of the wavelength bands in nm, rising. The default is that of Table 1 of the paper.
    select
        Lights that excite the sample one after another, as in the protocol `excitation`: colour
        filters by hand or in a wheel, wavelengths of a monochromator, or LEDs. There must be at
        least as many as there are bands. Default: the variable filter.
    sites
        With `select`: place of the sample in the frame, over which the card's light is averaged,
        `[x, y, width, height]` in pixels, or all four as fractions of the frame.
    vector_length
        Euclidean length to which the lamp's irradiance, one number for each band, is scaled;
        excitation rates belong to it. Table 1 of the paper has 1.
    illuminance_lux
        Illuminance by the lamp itself at the sample, read from a lux meter in the card's place.
        With it radiances of the material are absolute. Default: not read, and they are relative to
        the lamp.
    illuminance_lux_sigma
        Standard uncertainty of that reading in lux, with the meter's mismatch to the eye (f1′).
        Default: 5 % of it.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    integration
        With `select`: longest integration time of the spectrometer, if there is one, for example
        `1 s`. It faces the card, or a white beside it, and tells spectrum and brightness of every
        light better than the camera does.
    repetitions
        Number of spectra in each of its readings.
    repeats
        Number of photographs at each of two exposures of a scene; the longer exposure is for the
        dim ends of the strip.
    rounds
        Number of times that the card is photographed by itself and through the filter in turn,
        because the lamp drifts.
    """

    curves = ("lamp", "grey_card")

    protocol: Literal["irradiance"] = "irradiance"
    bands_nm: tuple[Nanometres, ...] = BANDS_NM
    select: ExcitingLights | None = None
    sites: Region = (0.1, 0.4, 0.8, 0.2)
    vector_length: float = Field(1.0, gt=0, allow_inf_nan=False)
    illuminance_lux: float | None = Field(None, gt=0, allow_inf_nan=False)
    illuminance_lux_sigma: float | None = Field(None, ge=0, allow_inf_nan=False)
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    integration: DurationS = Field(1.0, gt=0)
    repetitions: Count = Field(10, ge=2)
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
    def _a_light_for_every_band(self) -> Self:
        bands = len(self.bands_nm) - 1
        if self.select is not None and len(self.select.names()) < bands:
            raise ValueError(
                f"expected at least one light for each of the {bands} bands, got "
                f"{len(self.select.names())}; give fewer, wider bands in 'bands_nm'"
            )
        return self

    @model_validator(mode="after")
    def _sigma_of_a_reading(self) -> Self:
        if self.illuminance_lux_sigma is not None and self.illuminance_lux is None:
            raise ValueError("expected 'illuminance_lux' beside its σ, got nothing")
        return self

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing with which the card is photographed."""
        return Bracketing(self.camera, self.longest, self.repeats)

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, then the card by itself and through the LVF in turn, as the lamp drifts."""
        dark = ConfiguredUnit(
            StillDarkUnit(self.bracketing), BenchConfiguration(), "", is_dark=True
        )
        rounds = (self._round(number) for number in range(1, self.rounds + 1))
        scenes = [dark, *(scene for scenes in rounds for scene in scenes)]
        if self.select is None:
            return scenes
        most = self.rounds * (1 + len(self.select.names()))
        return [
            *scenes,
            ConfiguredUnit(DarkSpectraUnit(self._readings, most), _DIRECT, "the lights are off"),
        ]

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols whose results this one needs and the rig file does not name."""
        needed = (LVF_KIND,) if self.select is None else ()
        return [kind.protocol for kind in needed if rig.optics.named(kind) is None]

    def _round(self, number: int) -> Sequence[ConfiguredUnit]:
        scene = (self.bracketing, f"direct-{number}", CardFrames.DIRECT)
        if self.select is not None:
            card = CardUnit(*scene, readings=self._readings, spectrum=CardSpectra.DIRECT)
            return (
                ConfiguredUnit(card, _DIRECT, "how bright the lamp is by itself"),
                *self._lights(self.select, number),
            )
        direct = SceneUnit(*scene)
        through = StripUnit(self.bracketing, f"through-{number}", CardFrames.THROUGH)
        return (
            ConfiguredUnit(direct, _DIRECT, "how bright the lamp is by itself"),
            ConfiguredUnit(through, _THROUGH, "how much of it the variable filter leaves"),
        )

    @property
    def _readings(self) -> SpectrumReadings:
        return SpectrumReadings(self.integration, self.repetitions)

    def _lights(self, lights: ExcitingLights, number: int) -> Iterator[ConfiguredUnit]:
        """Yield the card under one light after another."""
        for name in lights.names():
            scene = (self.bracketing, light_unit(name, number), CardFrames.THROUGH)
            unit = (
                LedCardUnit(*scene, name, readings=self._readings)
                if lights.leds
                else CardUnit(*scene, readings=self._readings)
            )
            yield ConfiguredUnit(
                unit, lights.configuration(name, "grey card"), "how bright this light is"
            )
