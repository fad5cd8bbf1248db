"""Devices that swing: the trap door below the sample and the shield before the lamp."""

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
from labrig.foundation.quantity import duration_text


@runtime_checkable
class TrapDoor(Device, Protocol):
    """A door that swings the sample from the filter towards the camera. Safe state: closed."""

    def open(self) -> None:
        """Begin to open the door; return when the command is acknowledged."""

    def close(self) -> None:
        """Begin to close the door; return when the command is acknowledged."""

    def travel_s(self) -> float:
        """Return the time in seconds from the command until the door has stopped."""


@runtime_checkable
class LampShield(Device, Protocol):
    """A shield that keeps the afterglow of the lamp from the sample (Nalbach et al., section 4.4).

    Safe state: uncovered, since a hot lamp behind a shield cannot lose its heat.
    """

    def cover(self) -> None:
        """Begin to cover the lamp; return when the command is acknowledged."""

    def uncover(self) -> None:
        """Begin to uncover the lamp; return when the command is acknowledged."""

    def travel_s(self) -> float:
        """Return the time in seconds from the command until the shield has stopped."""


class PlannedSwing(PlannedDevice):
    """Stand-in of a trap door or shield in a plan; protocols wait for its travel themselves."""

    def __init__(self, travel_s: float) -> None:
        self._travel_s = travel_s

    def travel_s(self) -> float:
        """Return the travel time in seconds that the driver declares."""
        return self._travel_s

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def cover(self) -> None:
        """Do nothing."""

    def uncover(self) -> None:
        """Do nothing."""


@dataclass(frozen=True)
class Door:
    """The action that opens or closes the trap door."""

    open: bool
    device: ClassVar[str] = "door"

    def __str__(self) -> str:
        return "open" if self.open else "close"

    def begin(self, door: TrapDoor) -> None:
        """Begin the movement, which ends `TrapDoor.travel_s` later."""
        if self.open:
            door.open()
        else:
            door.close()


@dataclass(frozen=True)
class Shield:
    """The action that covers or uncovers the lamp."""

    cover: bool
    device: ClassVar[str] = "shield"

    def __str__(self) -> str:
        return "cover" if self.cover else "uncover"

    def begin(self, shield: LampShield) -> None:
        """Begin the movement, which ends `LampShield.travel_s` later."""
        if self.cover:
            shield.cover()
        else:
            shield.uncover()


DOOR_OPEN = Door(open=True)
DOOR_CLOSE = Door(open=False)
SHIELD_COVER = Shield(cover=True)
SHIELD_UNCOVER = Shield(cover=False)


def _swing(
    moves: Mapping[str, Callable[[], None]], travel_s: float, context: ExerciseContext
) -> Exercised:
    """Move a device once in each way, over its full travel; the last way is the safe one."""
    measured = []
    for name, move in moves.items():
        measured.append(Measured(name, f"{context.timed_s(move) * 1e3:.1f} ms"))
        context.clock.sleep(travel_s)
    travelled = Measured(
        "travel, from the rig file",
        f"{duration_text(travel_s)}; watch that it has stopped by then: no board sees that",
    )
    return Exercised((*measured, travelled))


def _exercise_door(door: TrapDoor, context: ExerciseContext) -> Exercised:
    moves = {"open, read back": door.open, "close, read back": door.close}
    return _swing(moves, door.travel_s(), context)


def _exercise_shield(shield: LampShield, context: ExerciseContext) -> Exercised:
    moves = {"cover, read back": shield.cover, "uncover, read back": shield.uncover}
    return _swing(moves, shield.travel_s(), context)


DOOR: Role[TrapDoor] = Role(
    key="door",
    protocol_class=TrapDoor,
    name="door",
    planned=lambda driver, settings, clock: PlannedSwing(driver.declared_travel_s(settings)),
    exercise=_exercise_door,
    safe_first=True,
)

SHIELD: Role[LampShield] = Role(
    key="shield",
    protocol_class=LampShield,
    name="shield",
    planned=lambda driver, settings, clock: PlannedSwing(driver.declared_travel_s(settings)),
    exercise=_exercise_shield,
    safe_first=True,
)
