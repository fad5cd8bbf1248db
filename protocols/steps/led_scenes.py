"""Scenes lit by one LED after another, each followed by a frame with all LEDs off."""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field

from labrig.acquire import LEDS, LEDS_OFF, LedSwitch, ProtocolModel, Session, Shoot
from labrig.quantity import Count, DurationS

from .camera_settings import CameraSettings
from .scenes import Arrangement, Bracketing

#: LEDs of the shipped rig, after the thesis's nine and its ultraviolet lamp.
LED_NAMES = (
    "365 nm", "405 nm", "430 nm", "455 nm", "490 nm", "530 nm", "565 nm", "590 nm", "625 nm",
)  # fmt: skip
#: The bench with the samples, and with the card in their place.
ON_SAMPLE, ON_CARD = Arrangement(), Arrangement("grey card")
#: Begin of the names of units, which end with the LED: the card, and the first LED once more.
CARD, AGAIN = "card ", "again "
CARD_REASON = "its light under every LED tells how bright the LED is"


def _once(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) < len(names):
        raise ValueError(f"expected every LED once, got {', '.join(names)}")
    return names


#: Names of LEDs of the rig.
LedNames = Annotated[tuple[str, ...], Field(min_length=1), AfterValidator(_once)]


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

    leds: LedNames = LED_NAMES
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
class LedUnit:
    """The scene under one LED.

    Attributes
    ----------
    bracketing
        Bracketing of the scene's photographs.
    led
        Name of the LED.
    name, role, off_role
        Name of the unit, and roles of its frames with the LED on and off.
    """

    bracketing: Bracketing
    led: str
    name: str
    role: str
    off_role: str

    def run(self, session: Session) -> None:
        """Light the LED, let it settle, photograph; then photograph what is left without it."""
        session.wait_until_warm("camera")
        session.perform(LedSwitch(self.led))
        session.wait(session.rig[LEDS].settling_s(self.led), f"the {self.led} LED settles")
        self.measure_lit(session)
        session.perform(LEDS_OFF)
        self.measure_dark(session)

    def measure_lit(self, session: Session) -> None:
        """Photograph the scene with the LED on."""
        # A camera sees no ultraviolet: what is dark here is judged with the LED's spectrum.
        self.bracketing.photograph(session, self.name, self.role, self.led, may_be_dark=True)

    def measure_dark(self, session: Session) -> None:
        """Photograph what is left with the LED off."""
        settings = self.bracketing.settings(
            session.choose("exposure off", lambda: self._longest_s(session), self._worst_s)
        )
        session.perform(Shoot(self.off_role, settings))

    @property
    def _worst_s(self) -> float:
        return self.bracketing.longest_s

    def _longest_s(self, session: Session) -> float:
        frames = [frame for frame in session.frames(self.role) if frame.unit == self.name]
        return max(frame.exposure_s for frame in frames)
