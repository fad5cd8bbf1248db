"""Parts that swing between two ends: the trap door below the sample and the shield before the lamp.

Both are one kind of device under two keys of a rig file. The safe end of the door is closed; that
of the shield (Nalbach et al., section 4.4) is uncovered, since a hot lamp behind a shield cannot
lose its heat.
"""

from dataclasses import dataclass
from functools import partial
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
class Swing(Device, Protocol):
    """A part that swings between a safe end and another one, such as a trap door."""

    def swing(self, *, safe: bool) -> None:
        """Begin to swing to the safe end or to the other; return when it is acknowledged."""

    def travel_s(self) -> float:
        """Return the time in seconds from the command until the part has stopped."""


class PlannedSwing(PlannedDevice):
    """Stand-in of a part that swings in a plan; protocols wait for its travel themselves."""

    def __init__(self, travel_s: float) -> None:
        self._travel_s = travel_s

    def travel_s(self) -> float:
        """Return the travel time in seconds in the rig file."""
        return self._travel_s

    def swing(self, *, safe: bool) -> None:
        """Do nothing."""


class ServoSwing(BoardDevice):
    """A part of the bench that a servo swings.

    The read-back is the command that the board sends, not the place of the part: one that is
    stuck, or a servo without power, is seen by the camera alone.
    """

    kind = Servo
    #: Keys of the safe end and of the other one in a rig file, and their descriptions.
    ends: ClassVar[tuple[tuple[str, str], tuple[str, str]]]

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._servo: Servo = self.channel_class(self.board, settings)
        self._safe, self._other = (getattr(settings, key) for key, _ in self.ends)

    @classmethod
    def keys(cls, board: type[Board], channel: type[Servo]) -> type[BaseModel]:
        """Return the model of the device's keys: a position for each end, and those of a servo."""
        (safe, _), (other, _) = cls.ends

        def differ(settings: Any) -> None:
            positions = [channel.distinct(getattr(settings, key)) for key in (safe, other)]
            require_distinct(positions, f"two different positions for '{safe}' and '{other}'")

        ends = {key: (channel.Position, Field(description=text)) for key, text in cls.ends}
        return keys_model(cls, (channel.Settings, board.Settings), differ, **ends)

    def identity(self) -> str:
        """Return the board's identity, the channel and the position that is commanded."""
        return f"{self.board.identity()}, {self.noun} on {self._servo.identity()}"

    def travel_s(self) -> float:
        """Return the time in seconds from the command until it has stopped, from the rig file."""
        travel_s: float = self.settings.travel
        return travel_s

    def ends_at(self) -> tuple[Any, Any]:
        """Return the positions of the safe end and of the other one, from the rig file."""
        return self._safe, self._other

    def go(self, position: Any) -> None:
        """Begin to move to a position, such as a pulse in seconds; used where ends are set up."""
        self._servo.go(position)

    def swing(self, *, safe: bool) -> None:
        """Begin to swing to the safe end or to the other; return when it is acknowledged."""
        self._servo.go(self._safe if safe else self._other)

    def make_safe(self) -> None:
        """Swing to the safe end, whatever was interrupted; return when it has had the time."""
        self._servo.make_safe(self._safe)


class ServoDoor(ServoSwing):
    """A trap door that a servo swings."""

    noun = "trap door"
    ends = (
        ("closed", "Position of the servo with the door closed, for example `1000 us`."),
        ("open", "Position of the servo with the door open, for example `2000 us`."),
    )


class ServoShield(ServoSwing):
    """A shield that a servo swings before the lamp."""

    noun = "lamp shield"
    ends = (
        (
            "uncovering",
            "Position of the servo with the shield away from the lamp, its safe end, for example "
            "`2000 us`.",
        ),
        (
            "covering",
            "Position of the servo with the shield before the lamp, for example `1000 us`.",
        ),
    )


@dataclass(frozen=True)
class SwingTo:
    """The action that swings a part to one of its ends.

    Attributes
    ----------
    device
        Key of the role.
    end
        Name of the movement in the journal.
    safe
        Whether it leads to the safe end.
    """

    device: str
    end: str
    safe: bool

    def __str__(self) -> str:
        return self.end

    def begin(self, part: Swing) -> None:
        """Begin the movement, which ends `Swing.travel_s` later."""
        part.swing(safe=self.safe)


DOOR_OPEN = SwingTo("door", "open", safe=False)
DOOR_CLOSE = SwingTo("door", "close", safe=True)
SHIELD_COVER = SwingTo("shield", "cover", safe=False)
SHIELD_UNCOVER = SwingTo("shield", "uncover", safe=True)


def _exercise(part: Swing, context: ExerciseContext, *, there: SwingTo, back: SwingTo) -> Exercised:
    """Move a part once to each end, over its full travel; the last one is the safe one."""
    measured = []
    for move in (there, back):
        moved_s = context.timed_s(partial(move.begin, part))
        measured.append(Measured(f"{move}, read back", f"{moved_s * 1e3:.1f} ms"))
        context.clock.sleep(part.travel_s())
    travelled = Measured(
        "travel, from the rig file",
        f"{duration_text(part.travel_s())}; watch that it has stopped by then: no board sees that",
    )
    return Exercised((*measured, travelled))


def _role(there: SwingTo, back: SwingTo, on_board: type[ServoSwing]) -> Role[Swing]:
    return Role(
        key=there.device,
        protocol_class=Swing,
        name=there.device,
        planned=lambda settings, clock: PlannedSwing(settings.travel),
        on_board=on_board,
        exercise=partial(_exercise, there=there, back=back),
        safe_first=True,
    )


DOOR = _role(DOOR_OPEN, DOOR_CLOSE, ServoDoor)
SHIELD = _role(SHIELD_COVER, SHIELD_UNCOVER, ServoShield)
