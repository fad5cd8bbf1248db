"""What a protocol's unit can have done, by a device or by a person, and when in a sequence."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.acquire.rig import Rig
from labrig.acquire.values import ExposureSettings
from labrig.quantity import duration_text


@dataclass(frozen=True)
class Switch:
    """Lamp on or off."""

    on: bool
    device: ClassVar[str] = "lamp"

    def __str__(self) -> str:
        return "on" if self.on else "off"

    def begin(self, rig: Rig) -> None:
        """Do it."""
        if self.on:
            rig.lamp.on()
        else:
            rig.lamp.off()


@dataclass(frozen=True)
class Door:
    """The trap door begins to open or to close."""

    open: bool
    device: ClassVar[str] = "door"

    def __str__(self) -> str:
        return "open" if self.open else "close"

    def begin(self, rig: Rig) -> None:
        """Begin it; it is over `TrapDoor.travel_s` later."""
        if self.open:
            rig.door.open()
        else:
            rig.door.close()


@dataclass(frozen=True)
class Shield:
    """The lamp's shield begins to cover the lamp or to uncover it."""

    cover: bool
    device: ClassVar[str] = "shield"

    def __str__(self) -> str:
        return "cover" if self.cover else "uncover"

    def begin(self, rig: Rig) -> None:
        """Begin it; it is over `LampShield.travel_s` later."""
        if self.cover:
            rig.shield.cover()
        else:
            rig.shield.uncover()


@dataclass(frozen=True)
class Shoot:
    """One photograph, for a purpose: `dark`, `meter`, `decay`, `daylight`."""

    purpose: str
    settings: ExposureSettings

    def __str__(self) -> str:
        return f"{self.purpose} frame, {self.settings}"


Action = Switch | Door | Shield | Shoot

LAMP_ON = Switch(on=True)
LAMP_OFF = Switch(on=False)
DOOR_OPEN = Door(open=True)
DOOR_CLOSE = Door(open=False)
SHIELD_COVER = Shield(cover=True)
SHIELD_UNCOVER = Shield(cover=False)


@dataclass(frozen=True)
class Timed:
    """An action and when it begins, in seconds after the start of its sequence."""

    at_s: float
    action: Action


def at(at_s: float, action: Action) -> Timed:
    """`action`, to begin `at_s` seconds after the start of the sequence."""
    return Timed(at_s, action)


@dataclass(frozen=True)
class Missed:
    """An action that began later than its tolerance allows."""

    timed: Timed
    late_s: float

    def __str__(self) -> str:
        action = self.timed.action
        what = str(action) if isinstance(action, Shoot) else f"{action.device} {action}"
        return f"{what} by {duration_text(self.late_s)}"
