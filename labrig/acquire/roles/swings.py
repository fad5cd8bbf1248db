"""What swings to and fro: the trap door below the sample, the shield before the lamp."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

from labrig.acquire.roles.role import (
    Device,
    ExerciseContext,
    Exercised,
    Measured,
    PlannedDevice,
    Role,
)
from labrig.quantity import duration_text


@runtime_checkable
class TrapDoor(Device, Protocol):
    """Swings the sample away from the filter and towards the camera. Safe: closed."""

    def open(self) -> None:
        """Begin to open; returns when the command is acknowledged."""

    def close(self) -> None:
        """Begin to close."""

    def travel_s(self) -> float:
        """Seconds from the command until the door has stopped."""


@runtime_checkable
class LampShield(Device, Protocol):
    """Keeps the afterglow of a lamp that is off from the sample (Nalbach et al., section 4.4).

    Safe: uncovered, since a hot lamp behind a shield cannot lose its heat.
    """

    def cover(self) -> None:
        """Begin to cover the lamp; returns when the command is acknowledged."""

    def uncover(self) -> None:
        """Begin to uncover it."""

    def travel_s(self) -> float:
        """Seconds from the command until the shield has stopped."""


class PlannedSwing(PlannedDevice):
    """A trap door or a shield; moving it takes no time, its travel is the protocol's to wait."""

    def __init__(self, travel_s: float) -> None:
        self._travel_s = travel_s

    def travel_s(self) -> float:
        """As its driver declares."""
        return self._travel_s

    def open(self) -> None:
        """It is open."""

    def close(self) -> None:
        """It is closed."""

    def cover(self) -> None:
        """It covers the lamp."""

    def uncover(self) -> None:
        """It does not."""


@dataclass(frozen=True)
class Door:
    """The trap door begins to open or to close."""

    open: bool
    device: ClassVar[str] = "door"

    def __str__(self) -> str:
        return "open" if self.open else "close"

    def begin(self, door: TrapDoor) -> None:
        """Begin it; it is over `TrapDoor.travel_s` later."""
        if self.open:
            door.open()
        else:
            door.close()


@dataclass(frozen=True)
class Shield:
    """The lamp's shield begins to cover the lamp or to uncover it."""

    cover: bool
    device: ClassVar[str] = "shield"

    def __str__(self) -> str:
        return "cover" if self.cover else "uncover"

    def begin(self, shield: LampShield) -> None:
        """Begin it; it is over `LampShield.travel_s` later."""
        if self.cover:
            shield.cover()
        else:
            shield.uncover()


DOOR_OPEN = Door(open=True)
DOOR_CLOSE = Door(open=False)
SHIELD_COVER = Shield(cover=True)
SHIELD_UNCOVER = Shield(cover=False)


def _swing(
    ways: Mapping[str, Callable[[], None]], travel_s: float, trial: ExerciseContext
) -> Exercised:
    """There and back, the full travel each; the last way is the safe one."""
    measured = []
    for what, go in ways.items():
        measured.append(Measured(what, f"{trial.timed_s(go) * 1e3:.1f} ms"))
        trial.clock.sleep(travel_s)
    travelled = Measured(
        "travel, from the rig file",
        f"{duration_text(travel_s)}; watch that it has stopped by then: no board sees that",
    )
    return Exercised((*measured, travelled))


def _exercise_door(door: TrapDoor, trial: ExerciseContext) -> Exercised:
    ways = {"open, read back": door.open, "close, read back": door.close}
    return _swing(ways, door.travel_s(), trial)


def _exercise_shield(shield: LampShield, trial: ExerciseContext) -> Exercised:
    ways = {"cover, read back": shield.cover, "uncover, read back": shield.uncover}
    return _swing(ways, shield.travel_s(), trial)


DOOR: Role[TrapDoor] = Role(
    key="door",
    does=TrapDoor,
    name="door",
    planned=lambda driver, settings, clock: PlannedSwing(driver.declared_travel_s(settings)),
    exercise=_exercise_door,
    safe_first=True,
)

SHIELD: Role[LampShield] = Role(
    key="shield",
    does=LampShield,
    name="shield",
    planned=lambda driver, settings, clock: PlannedSwing(driver.declared_travel_s(settings)),
    exercise=_exercise_shield,
    safe_first=True,
)
