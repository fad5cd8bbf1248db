"""The lamp: the light that charges the sample."""

from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

from labrig.acquire.roles.role import (
    DARK,
    ExerciseContext,
    Exercised,
    Light,
    Measured,
    PlannedDevice,
    Role,
    spread_ms,
)
from labrig.errors import DeviceError

#: Often enough to see a slow line, seldom enough not to wear the relay.
SWITCHINGS = 3


@runtime_checkable
class Lamp(Light, Protocol):
    """A light that charges the sample. Safe: off."""

    def on(self) -> None:
        """Switch on, read back where the device can."""

    def off(self) -> None:
        """Switch off, read back where the device can."""

    def is_on(self) -> bool:
        """What the device says, not what was asked, where it reads back."""


class PlannedLamp(PlannedDevice):
    """A lamp of a plan."""

    def __init__(self) -> None:
        self._on = False

    def reads_back(self) -> bool:
        """Nobody else switches it."""
        return False

    def on(self) -> None:
        """Switch on."""
        self._on = True

    def off(self) -> None:
        """Switch off."""
        self._on = False

    def is_on(self) -> bool:
        """As it was switched."""
        return self._on


@dataclass(frozen=True)
class Switch:
    """Lamp on or off."""

    on: bool
    device: ClassVar[str] = "lamp"

    def __str__(self) -> str:
        return "on" if self.on else DARK

    def begin(self, lamp: Lamp) -> None:
        """Do it."""
        if self.on:
            lamp.on()
        else:
            lamp.off()


LAMP_ON = Switch(on=True)
LAMP_OFF = Switch(on=False)


def _exercise(lamp: Lamp, trial: ExerciseContext) -> Exercised:
    """Light it for some hundredths of a second, some times."""
    on_s, off_s = [], []
    try:
        for _ in range(SWITCHINGS):
            on_s.append(trial.timed_s(lamp.on))
            _require(lamp, on=True)
            off_s.append(trial.timed_s(lamp.off))
            _require(lamp, on=False)
    finally:
        with trial.clock.shielded():
            lamp.off()
    return Exercised(
        (
            Measured("switch on, read back", spread_ms(on_s)),
            Measured("switch off, read back", spread_ms(off_s)),
        )
    )


def _require(lamp: Lamp, *, on: bool) -> None:
    if lamp.is_on() != on:
        state = "on" if on else "off"
        raise DeviceError(
            f"the lamp was switched {state}, it says otherwise; look at it, switch it off by hand "
            "and check the relay"
        )


LAMP: Role[Lamp] = Role(
    key="lamp",
    does=Lamp,
    name="lamp",
    planned=lambda driver, settings, clock: PlannedLamp(),
    exercise=_exercise,
    state=lambda lamp: str(LAMP_ON if lamp.is_on() else LAMP_OFF),
    safe_first=True,
)
