"""Devices that bring one of several named things into place: filters of a wheel, samples."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

from pydantic import BaseModel, Field

from labrig.acquire.channels import Board, Positions
from labrig.acquire.connections import Connections
from labrig.acquire.roles.board_device import BoardDevice, keys_model, require_distinct
from labrig.acquire.roles.role import Device, ExerciseContext, Measured, PlannedDevice
from labrig.foundation.clock import VirtualClock
from labrig.foundation.quantity import duration_text


@runtime_checkable
class Places(Device, Protocol):
    """A device that brings one of several named things, or none of them, into place.

    A filter wheel, or a slide with filters, is at rest when it is safe. A filter that is in it is
    put in place by it; all others, by hand.
    """

    def names(self) -> tuple[str, ...]:
        """Return the names of the things."""

    def put(self, name: str | None, /) -> None:
        """Bring a thing into place, or none for None; return when it is there.

        Raises
        ------
        DeviceError
            The device does not confirm it.
        """


class PlannedPlaces(PlannedDevice):
    """Stand-in in a plan, for which every move takes the longest time."""

    def __init__(self, clock: VirtualClock, names: Sequence[str], travel_s: float) -> None:
        self._clock = clock
        self._names = tuple(names)
        self._travel_s = travel_s
        self._name: str | None = None

    def names(self) -> tuple[str, ...]:
        """Return the names in the rig file."""
        return self._names

    def put(self, name: str | None, /) -> None:
        """Let the time of a move pass, unless it is in place."""
        if name != self._name:
            self._clock.spend(self._travel_s)
        self._name = name


class BoardPlaces(BoardDevice):
    """Named things that a channel of a board brings into place, one position for each."""

    kind = Positions
    #: Keys in a rig file of the things and of the position without any, and their descriptions.
    things: ClassVar[tuple[str, str]]
    empty: ClassVar[tuple[str, str]]
    #: Further keys of the role.
    role_keys: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        super().__init__(address, settings, connections)
        self._positions: Mapping[str, Any] = getattr(settings, self.things[0])
        self._empty = getattr(settings, self.empty[0])
        self._channel: Positions = self.channel_class(self.board, settings)
        for position in (*self._positions.values(), self._empty):
            self._channel.require_possible(position)

    @classmethod
    def keys(cls, board: type[Board], channel: type[Positions]) -> type[BaseModel]:
        """Return the model of the device's keys: a position for each thing, those of a channel."""
        (things, things_text), (empty, empty_text) = cls.things, cls.empty
        thing = things.removesuffix("s")

        def differ(settings: Any) -> None:
            positions = [getattr(settings, empty), *getattr(settings, things).values()]
            require_distinct(
                map(channel.distinct, positions),
                f"a {channel.noun} of its own for every {thing} and for '{empty}'",
            )

        return keys_model(
            cls,
            (channel.Settings, board.Settings),
            differ,
            **{
                things: (
                    Mapping[str, channel.Position],  # type: ignore[name-defined]
                    Field(min_length=1, description=things_text),
                ),
                empty: (
                    Annotated[channel.Position, Field(description=empty_text)],
                    channel.empty,
                ),
            },
            **cls.role_keys,
        )

    def identity(self) -> str:
        """Return the board's identity and the device, with its channel if that has a name."""
        place = self._channel.identity()
        return f"{self.board.identity()}, {self.noun}{f' on {place}' if place else ''}"

    def names(self) -> tuple[str, ...]:
        """Return the names of the things, in the rig file's order."""
        return tuple(self._positions)

    def put(self, name: str | None, /) -> None:
        """Bring a thing, or for None nothing, into place; return when it is there.

        Raises
        ------
        UnclearAnswerError
            The board does not confirm it.
        """
        self._channel.bring(self._empty if name is None else self._positions[name])

    def make_safe(self) -> None:
        """Bring the empty position into place, whatever was interrupted."""
        self._channel.make_safe(self._empty)


def timed(places: Places, context: ExerciseContext, to_none: str) -> list[Measured]:
    """Return the time of a move to each of the things in turn, and at last to none of them."""
    moves = {**{f"to {name}": name for name in places.names()}, to_none: None}
    return [
        Measured(move, duration_text(context.timed_s(partial(places.put, name))))
        for move, name in moves.items()
    ]
