"""Devices that swing: the trap door below the sample and the shield before the lamp."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from pydantic import BaseModel, Field

from labrig.acquire.channels import Board, Servo
from labrig.acquire.connections import Connections
from labrig.acquire.roles.board_device import BoardDevice, keys_model, require_distinct
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


class ServoSwing(BoardDevice):
    """A part of the bench that a servo swings between two ends.

    The read-back is the command that the board sends, not the place of the part: one that is
    stuck, or a servo without power, is seen by the camera alone.
    """

    kind = Servo
    #: Keys of the safe end and of the other one in a rig file, and their descriptions.
    ends: ClassVar[Mapping[str, str]]

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._servo: Servo = self.channel_class(self.board, settings)
        self._safe, self._other = (getattr(settings, key) for key in self.ends)

    @classmethod
    def keys(cls, board: type[Board], channel: type[Servo]) -> type[BaseModel]:
        """Return the model of the device's keys: a position for each end, and those of a servo."""
        first, second = cls.ends
        expected = f"two different positions for '{first}' and '{second}'"

        def differ(settings: Any) -> None:
            ends = [channel.distinct(getattr(settings, key)) for key in cls.ends]
            require_distinct(ends, expected)

        return keys_model(
            cls,
            (channel.Settings, board.Settings),
            differ,
            **{
                key: (channel.Position, Field(description=description))
                for key, description in cls.ends.items()
            },
        )

    def identity(self) -> str:
        """Return the board's identity, the channel and the position that is commanded."""
        return f"{self.board.identity()}, {self.noun} on {self._servo.place()}"

    def travel_s(self) -> float:
        """Return the time in seconds from the command until it has stopped, from the rig file."""
        travel_s: float = self.settings.travel
        return travel_s

    def make_safe(self) -> None:
        """Swing to the safe end, whatever was interrupted; return when it has had the time."""
        self._servo.make_safe(self._safe)


class ServoDoor(ServoSwing):
    """A trap door that a servo swings."""

    noun = "trap door"
    ends: ClassVar[Mapping[str, str]] = {
        "closed": "Position of the servo with the door closed, for example `1000 us`.",
        "open": "Position of the servo with the door open, for example `2000 us`.",
    }

    def open(self) -> None:
        """Begin to open the door."""
        self._servo.go(self._other)

    def close(self) -> None:
        """Begin to close the door."""
        self._servo.go(self._safe)


class ServoShield(ServoSwing):
    """A shield that a servo swings before the lamp."""

    noun = "lamp shield"
    ends: ClassVar[Mapping[str, str]] = {
        "uncovering": "Position of the servo with the shield away from the lamp, its safe end, for "
        "example `2000 us`.",
        "covering": "Position of the servo with the shield before the lamp, for example `1000 us`.",
    }

    def cover(self) -> None:
        """Begin to cover the lamp."""
        self._servo.go(self._other)

    def uncover(self) -> None:
        """Begin to uncover the lamp."""
        self._servo.go(self._safe)


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
    planned=lambda settings, clock: PlannedSwing(settings.travel),
    on_board=ServoDoor,
    exercise=_exercise_door,
    safe_first=True,
)

SHIELD: Role[LampShield] = Role(
    key="shield",
    protocol_class=LampShield,
    name="shield",
    planned=lambda settings, clock: PlannedSwing(settings.travel),
    on_board=ServoShield,
    exercise=_exercise_shield,
    safe_first=True,
)
