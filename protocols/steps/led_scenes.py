"""Scenes lit by one LED or lamp after another, each followed by a frame with all lights off."""

import random
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field

from labrig.acquire import (
    ILLUMINANTS,
    ILLUMINANTS_OFF,
    LEDS,
    LEDS_OFF,
    IlluminantSwitch,
    LedSwitch,
    Offer,
    ProtocolModel,
    Rig,
    Session,
    TakeFrame,
)
from labrig.foundation.quantity import Count, DurationS

from .bench_configuration import BenchConfiguration
from .bracketing import Bracketing
from .camera_settings import CameraSettings

#: LEDs of the shipped rig, after the thesis's nine and its ultraviolet lamp.
LED_NAMES = (
    "365 nm", "405 nm", "430 nm", "455 nm", "490 nm", "530 nm", "565 nm", "590 nm", "625 nm",
)  # fmt: skip
#: The bench with the samples, and with the card in their place.
ON_SAMPLE, ON_CARD = BenchConfiguration(), BenchConfiguration("grey card")
#: Start of the names of units, which end with the LED: the card, and the first LED once more.
CARD, AGAIN = "card ", "again "
CARD_REASON = "its light under every LED measures the brightness of the LED"


def _once(kind: str) -> AfterValidator:
    def check(names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise ValueError(f"expected every {kind} once, got {', '.join(names)}")
        return names

    return AfterValidator(check)


@dataclass(frozen=True)
class AllLeds(Offer):
    """Annotation of the names of LEDs, which are all of the rig's where some of them are none."""

    def fitted(self, names: tuple[str, ...], rig: Rig) -> tuple[str, ...]:
        """Return the names, or those of all LEDs of the rig."""
        offered = rig[LEDS].channels() if LEDS in rig else names
        return names if set(names) <= set(offered) else offered

    def reason(self, rig: Rig) -> str:
        """Return the names of the rig's LEDs."""
        return f"its LEDs are {self.text(rig[LEDS].channels())}"


#: Names of LEDs of the rig, and of lamps of its bank.
LedNames = Annotated[tuple[str, ...], Field(min_length=1), _once("LED")]
LampNames = Annotated[tuple[str, ...], _once("lamp")]


def shuffled(names: Sequence[str], seed: int) -> list[str]:
    """Return names in an order by chance, the same for the same seed."""
    order = list(names)
    random.Random(seed).shuffle(order)
    return order


class LedSettings(ProtocolModel):
    """Settings of a protocol that lights one LED after another before a camera.

    Attributes
    ----------
    leds
        Names of the LEDs in the rig file, for example `[455 nm, 530 nm]`.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    exposures
        Number of exposures in a bracket, each eight times the one before; the longest ones are for
        channels that see little of the light.
    repeats
        Number of photographs at each exposure.
    order_seed
        Seed of the order of the LEDs, which is shuffled so that drift does not look like a
        spectrum.
    """

    leds: Annotated[LedNames, AllLeds()] = LED_NAMES
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    exposures: Annotated[Count, Field(ge=1, le=5)] = 3
    repeats: Count = Field(2, ge=1)
    order_seed: Count = Field(1, ge=0)

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing of every scene."""
        return Bracketing(self.camera, self.longest, self.repeats, self.exposures)

    def shuffled(self) -> Sequence[str]:
        """Return the LEDs in the order in which they are lit."""
        return shuffled(self.leds, self.order_seed)


@dataclass(frozen=True)
class LitUnit(ABC):
    """The scene under one light of a bank.

    Attributes
    ----------
    bracketing
        Bracketing of the scene's photographs.
    lit_by
        Name of the light.
    name, role, off_role
        Name of the unit, and roles of its frames with the light on and off.
    """

    bracketing: Bracketing
    lit_by: str
    name: str
    role: str
    off_role: str

    def run(self, session: Session) -> None:
        """Light the scene, let the light settle, photograph; then photograph what is left."""
        session.wait_until_warm("camera")
        self.light(session)
        self.measure_lit(session)
        self.darken(session)
        self.measure_dark(session)

    @abstractmethod
    def light(self, session: Session) -> None:
        """Switch the light on and wait until it is steady."""

    @abstractmethod
    def darken(self, session: Session) -> None:
        """Switch the light off."""

    def measure_lit(self, session: Session) -> None:
        """Photograph the scene with the light on."""
        # A camera sees no ultraviolet: what is dark here is judged with the light's spectrum.
        self.bracketing.photograph(session, self.name, self.role, self.lit_by, may_be_dark=True)

    def measure_dark(self, session: Session) -> None:
        """Photograph what is left with the light off."""
        settings = self.bracketing.settings(
            session.decide("exposure off", lambda: self._longest_s(session), self._worst_s)
        )
        session.perform(TakeFrame(self.off_role, settings))

    @property
    def _worst_s(self) -> float:
        return self.bracketing.longest_s

    def _longest_s(self, session: Session) -> float:
        frames = [frame for frame in session.frames(self.role) if frame.unit == self.name]
        return max(frame.exposure_s for frame in frames)


class LedUnit(LitUnit):
    """The scene under one LED."""

    def light(self, session: Session) -> None:
        """Switch the LED on and wait until it is steady."""
        session.perform(LedSwitch(self.lit_by))
        session.wait(session.rig[LEDS].settling_s(self.lit_by), f"the {self.lit_by} LED settles")

    def darken(self, session: Session) -> None:
        """Switch the LED off."""
        session.perform(LEDS_OFF)


class LampUnit(LitUnit):
    """The scene under one lamp of the bank."""

    def light(self, session: Session) -> None:
        """Switch the lamp on and wait until it is warm."""
        session.perform(IlluminantSwitch(self.lit_by))
        warm_up_s = session.rig[ILLUMINANTS].settling_s(self.lit_by)
        session.wait(warm_up_s, f"the {self.lit_by} lamp warms up")

    def darken(self, session: Session) -> None:
        """Switch the lamp off."""
        session.perform(ILLUMINANTS_OFF)
