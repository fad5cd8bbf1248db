"""Scenes lit by one LED after another, each followed by a frame with all LEDs off."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field

from labrig.acquire import LEDS, LEDS_OFF, LedSwitch, Session, Shoot

from .scenes import Bracketing


def _once(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) < len(names):
        raise ValueError(f"expected every LED once, got {', '.join(names)}")
    return names


#: Names of LEDs of the rig.
LedNames = Annotated[tuple[str, ...], Field(min_length=1), AfterValidator(_once)]


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
