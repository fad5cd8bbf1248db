"""Turn-off and turn-on transients of the lamp, from photographs of a card.

The shutter opens with another delay after the switch in every photograph. The rest of the fade is
over in a second, so that every photograph contains all of it. The steady lamp is photographed
before each. (Nalbach et al., section 4.6, give 320 ms until the lamp is dark.)
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    CAMERA,
    LAMP_OFF,
    LAMP_ON,
    CameraCapabilities,
    ExposureSettings,
    Session,
    TakeFrame,
    Unit,
    at,
)
from labrig.foundation.quantity import Count, DurationS, duration_text
from labrig.foundation.region import CENTRE, Region
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.camera_settings import CameraSettings, frame_times_s
from labrig.protocols.steps.grey_card import (
    CARD_REASON,
    HALF,
    CardDarkUnit,
    CardLight,
    CardMeterUnit,
    card_light,
    light_card,
)


class LampFrames(StrEnum):
    """Roles of frames of the card: steady lamp, after switching off, after on, during warm-up."""

    STEADY = "steady"
    FADE = "fade"
    RISE = "rise"
    WARMING = "warming"


#: Roles of frames after a switch.
SWITCHED = LampFrames.FADE, LampFrames.RISE

#: Reason for laying the card, and the filter before the camera.
BANDS_REASON = "the fade is measured band by band"
#: Slowest fade of a lamp to 1/e, with which photographs clip at no delay.
SLOWEST_S = 0.09
#: Time after which a filament is steady, or cold.
STEADY_S = 4.0
#: How long a lamp's housing cools before it is watched, when from switching on it is photographed,
#: how often each time, and how far apart: the last per cents of light come with the housing.
COOLS_S = 600.0
WARMING_S = (4.0, 15.0, 30.0, 60.0, 100.0, 160.0, 250.0, 400.0, 600.0)
WARMING_SHOTS, WARMING_EVERY_S = 4, 2.0


class Fade(ConfiguredProtocol):
    """Settings of a fade; `fade.yaml` is the commented example.

    Attributes
    ----------
    camera
        Sensitivity and aperture of the camera. A halogen lamp on mains fills the range within a few
        milliseconds at the default.
    every
        Step of the delay from the switch to the release of the shutter, for example `30 ms`.
    until
        Longest delay, by which the lamp is dark, for example `450 ms`; at least four times `every`.
    passes
        Number of passes through all delays, each a part of a step later than the one before.
    longest
        Longest exposure of the fade, which should contain all that is left of it, for example
        `1 s`.
    rise
        Whether the rise after switching on is measured, too.
    repeat_late
        Number of times that a delay is photographed again if something began late. The late
        photograph is kept, with its actual times.
    warming
        Whether the warm-up of the lamp's housing is recorded, which takes 20 minutes. Short charges
        are known to a part of the last per cents of light by it.
    through_lvf
        Whether the lamp is seen band by band through a calibrated variable filter before the
        camera. If not, the camera's three channels are used and the lamp is taken for a black-body
        emitter.
    card
        Place of the lit grey card in the frame: `[x, y, width, height]` in pixels, or all four as
        fractions of the frame.
    bands
        Edges of the wavelength bands in nm, rising.
    """

    curves = ("lamp",)

    protocol: Literal["fade"] = "fade"
    camera: CameraSettings = CameraSettings(iso=400, f_number=4.0)
    every: DurationS = Field(0.03, gt=0)
    until: DurationS = Field(0.45, gt=0)
    passes: Count = Field(4, ge=2)
    longest: DurationS = Field(1.0, gt=0)
    rise: bool = True
    repeat_late: Count = Field(2, ge=0)
    warming: bool = True
    through_lvf: bool = False
    card: Region = CENTRE
    bands: tuple[float, ...] = tuple(380.0 + 20.0 * number for number in range(21))

    @model_validator(mode="after")
    def _has_delays(self) -> Self:
        if self.until < 4 * self.every:
            raise ValueError(
                f"until: {duration_text(self.until)} leaves fewer than four delays "
                f"{duration_text(self.every)} apart; make it longer"
            )
        if list(self.bands) != sorted(set(self.bands)) or len(self.bands) < 2:
            raise ValueError("expected rising edges in 'bands'")
        return self

    def settings(self) -> ExposureSettings:
        """Return the reference settings, whose shutter time is to be metered."""
        return ExposureSettings(1.0, self.camera.iso, self.camera.f_number)

    def delays_s(self, number: int) -> list[float]:
        """Return the delays from the switch to the release in one pass; each pass begins later."""
        first_s = number / self.passes * self.every
        return frame_times_s(first_s, self.every, self.until)

    def fade_exposure_s(
        self, delay_s: float, light: CardLight, capabilities: CameraCapabilities
    ) -> float:
        """Return the longest shutter time in which even a slowly fading lamp does not clip."""
        steady_s = light.exposure_s(HALF, self.settings())
        remaining_s = SLOWEST_S * math.exp(-delay_s / SLOWEST_S)
        if remaining_s <= steady_s:
            return capabilities.exposure_at_most(self.longest)
        filled_s = -SLOWEST_S * math.log1p(-steady_s / remaining_s)
        return capabilities.exposure_at_most(min(filled_s, self.longest))

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, metering, the warm-up, and passes over all delays, in the warm lamp."""
        reference = self.settings()
        card = BenchConfiguration("grey card", "before camera" if self.through_lvf else "away")
        dark = CardDarkUnit(reference, self.card, self.camera.iso, self.longest)
        lit: list[Unit] = [
            CardMeterUnit(reference, self.card),
            *([WarmingUnit(self)] if self.warming else []),
            *(PassUnit(self, number) for number in range(self.passes)),
        ]
        why = BANDS_REASON if self.through_lvf else CARD_REASON
        return [
            ConfiguredUnit(dark, card, why, is_dark=True),
            *(ConfiguredUnit(unit, card, why) for unit in lit),
        ]


@dataclass(frozen=True)
class PassUnit:
    """One photograph of the rise and one of the fade at every delay."""

    protocol: Fade
    number: int

    @property
    def name(self) -> str:
        """Name of the unit: `pass-1`, `pass-2`, …"""
        return f"pass-{self.number + 1}"

    def run(self, session: Session) -> None:
        """Photograph the steady lamp, the fade and the rise at every delay."""
        protocol, capabilities = self.protocol, session.rig[CAMERA].capabilities()
        session.wait_until_warm("camera")
        light_card(session)
        light = card_light(session, protocol.settings(), protocol.card)
        steady = light.exposed(HALF, protocol.settings(), capabilities)
        for delay_s in protocol.delays_s(self.number):
            exposure_s = protocol.fade_exposure_s(delay_s, light, capabilities)
            for _ in range(1 + protocol.repeat_late):
                if not self._missed(session, delay_s, steady, exposure_s):
                    break

    def _missed(
        self, session: Session, delay_s: float, steady: ExposureSettings, exposure_s: float
    ) -> bool:
        """Photograph one delay; return whether something began late."""
        session.perform(TakeFrame(LampFrames.STEADY, steady))
        fading = TakeFrame(LampFrames.FADE, replace(steady, exposure_s=exposure_s))
        missed = session.run_sequence([at(0.0, LAMP_OFF), at(delay_s, fading)])
        if not self.protocol.rise:
            session.perform(LAMP_ON)
            session.wait(STEADY_S, "lamp settles")
            return bool(missed)
        session.wait(STEADY_S, "lamp cools")
        rising = [at(0.0, LAMP_ON), at(delay_s, TakeFrame(LampFrames.RISE, steady))]
        missed = [*missed, *session.run_sequence(rising)]
        session.wait(STEADY_S, "lamp settles")
        return bool(missed)


@dataclass(frozen=True)
class WarmingUnit:
    """Photographs of the card while the lamp's housing becomes warm."""

    protocol: Fade
    name: str = "warming"

    def run(self, session: Session) -> None:
        """Wait until the housing is cold; switch on and photograph with growing pauses."""
        protocol = self.protocol
        session.wait_until_warm("camera")
        light_card(session)
        capabilities = session.rig[CAMERA].capabilities()
        light = card_light(session, protocol.settings(), protocol.card)
        steady = light.exposed(HALF, protocol.settings(), capabilities)
        session.perform(LAMP_OFF)
        session.wait(COOLS_S, "lamp's housing cools")
        busy_s = steady.exposure_s + capabilities.overhead_s
        shots = [at(s, TakeFrame(LampFrames.WARMING, steady)) for s in warming_times_s(busy_s)]
        session.run_sequence([at(0.0, LAMP_ON), *shots])


def warming_times_s(busy_s: float) -> list[float]:
    """Return the begins of the photographs of the warming lamp in seconds after lamp on.

    A camera that is busy with each for `busy_s` seconds, longer than the usual pause, takes fewer.
    """
    every_s = max(WARMING_EVERY_S, math.ceil(10 * busy_s) / 10)
    return [
        begin_s + number * every_s
        for begin_s, next_s in pairwise((*WARMING_S, math.inf))
        for number in range(WARMING_SHOTS)
        if number == 0 or begin_s + number * every_s + busy_s <= next_s
    ]
