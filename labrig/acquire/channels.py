"""Boards and their channels: what a driver of a board writes, and what roles take.

A board is a device with several channels on one line, such as relays, servos or analogue inputs.
Its driver lists the classes of its channels (`Board.channels`). A role of the rig file takes the
channels that it needs, such as one `Switch` for a lamp, so that nothing is written for each pair of
board and role.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Hashable, Iterable, Sequence
from contextlib import suppress
from typing import Any, ClassVar

from labrig.acquire.connections import Connections
from labrig.foundation.errors import DeviceError, UnclearAnswerError
from labrig.foundation.models import FrozenModel


class Channel(ABC):
    """One channel of a board.

    Parameters
    ----------
    board
        Board that has the channel.
    settings
        The channel's keys in the rig file, of the class `Settings`.
    """

    class Settings(FrozenModel):
        """Keys of a channel in a rig file."""

    #: Noun for a channel in messages, such as `relay`.
    noun: ClassVar[str] = "channel"

    def __init__(self, board: Any, settings: Any) -> None:
        self.board = board
        self.settings = settings

    @abstractmethod
    def place(self) -> str:
        """Return the channel's place on the board, such as `relay 3`; empty if it has no name."""

    @classmethod
    def outlet(cls, settings: Any) -> Hashable:
        """Return what of the board the channel with these keys occupies; None if it is unknown."""
        return None

    def identity(self) -> str:
        """Return the place, and what else of the channel is worth recording."""
        return self.place()

    @property
    def name(self) -> str:
        """Name of the channel in messages, such as `relay 3 of the Numato board at COM3`."""
        return f"{self.place() or self.noun} of {self.board.name}"


class Switch(Channel):
    """A channel that is on or off, and may have a brightness among its settings.

    Attributes
    ----------
    state
        State that was commanded last, and read back where the board can; None if it is unknown.
    """

    def __init__(self, board: Any, settings: Any) -> None:
        super().__init__(board, settings)
        self.state: bool | None = None

    @classmethod
    def distinct(cls, settings: Any) -> Hashable:
        """Return what no other channel of the board may have in common with this one."""
        return tuple(getattr(settings, key) for key in cls.Settings.model_fields)

    @classmethod
    def outlet(cls, settings: Any) -> Hashable:
        """Return what no other switch of the board may have in common with this one."""
        return cls.distinct(settings)

    @abstractmethod
    def command(self, *, on: bool) -> None:
        """Send the command that switches; return when it is confirmed, or has left the PC.

        Raises
        ------
        DeviceError
            The board refuses or does not answer.
        """

    def reads_back(self) -> bool:
        """Return whether `is_on` asks the board."""
        return True

    def acknowledges(self) -> bool:
        """Return whether the board confirms commands."""
        return self.reads_back()

    def is_on(self) -> bool:
        """Return the state that the board reports, else the one commanded last.

        A channel whose state is unknown may be on, and counts as on.
        """
        return self.state is not False

    def switch(self, *, on: bool) -> None:
        """Switch, and read back where the board can.

        Raises
        ------
        UnclearAnswerError
            The board refuses, or the channel does not read as it was switched.
        """
        self.state = None
        self.command(on=on)
        if self.reads_back() and self.is_on() != on:
            raise self.contradicts(on=on)
        self.state = on

    def contradicts(self, *, on: bool) -> UnclearAnswerError:
        """Return the error that the channel was switched and does not read so."""
        state, opposite = ("on", "off") if on else ("off", "on")
        return UnclearAnswerError(
            f"{self.name} was switched {state} but reads {opposite}; switch off by hand and check "
            "the board"
        )

    def head_nm(self) -> float | None:
        """Return the wavelength in nm that a light names itself; None if it names none."""
        return None


class Positions(Channel):
    """A channel that brings a part of the bench to one of several positions."""

    class Settings(FrozenModel):
        """Keys of a channel that moves; every one has `travel`, a time in seconds."""

        travel: float

    #: Type of a position in a rig file, such as the length of a pulse.
    Position: ClassVar[Any]
    #: Position without a filter or a sample that the rig file need not name; `...`: it has to.
    empty: ClassVar[Any] = ...

    @classmethod
    def distinct(cls, position: Any) -> Hashable:
        """Return what no other position may have in common with this one."""
        hashable: Hashable = position
        return hashable

    def require_possible(self, position: Any) -> None:
        """Refuse a position that this board does not have.

        Raises
        ------
        DeviceError
            It has not.
        """

    @abstractmethod
    def bring(self, position: Any) -> None:
        """Move to a position; return when it is reached.

        Raises
        ------
        UnclearAnswerError
            The board does not confirm it.
        """

    def make_safe(self, position: Any) -> None:
        """Move to the safe position, whatever was interrupted."""
        self.board.resynchronise()
        self.bring(position)


class Servo(Positions):
    """A channel that begins to move at once, so that protocols can time what swings."""

    @abstractmethod
    def go(self, position: Any) -> None:
        """Begin to move to a position; return when the command is acknowledged.

        Raises
        ------
        UnclearAnswerError
            The board does not acknowledge it.
        """


class TemperatureSensor(Channel):
    """A channel that reads a temperature."""

    @abstractmethod
    def celsius(self) -> float:
        """Return the temperature in degrees Celsius; takes seconds at most, even when it fails.

        Raises
        ------
        DeviceError
            There is no plausible reading.
        """


class Board(ABC):
    """A device with channels on one line.

    Parameters
    ----------
    address
        Address of the board; several devices of a rig may share it.
    settings
        Keys of the rig file, of the class `Settings` or one that extends it.
    connections
        Connections that open the port.
    """

    class Settings(FrozenModel):
        """Keys that concern a whole board in a rig file: none."""

    #: Classes of the channels that the board has.
    channels: ClassVar[tuple[type[Channel], ...]]
    #: Whether its commands are those of a rig file, so that other drivers may speak on its line.
    has_own_commands: ClassVar[bool] = False
    #: Name of the board in messages, such as `the Numato board at COM3`.
    name: str

    @abstractmethod
    def __init__(self, address: str, settings: Any, connections: Connections) -> None: ...

    @abstractmethod
    def identity(self) -> str:
        """Return one line that identifies the board: maker, model, serial number, firmware."""

    def resynchronise(self) -> None:  # noqa: B027, most boards have no need
        """End a command that was cut off, and discard answers that are still to come.

        It can do no harm and may be called at any time. By default nothing is sent.
        """

    def are_on(self, switches: Sequence[Switch]) -> list[bool]:
        """Return the states of some switches, by one query where the board can."""
        return [switch.is_on() for switch in switches]

    def make_safe(self, switches: Sequence[Switch]) -> None:
        """Switch channels off, whatever was interrupted.

        A board that has nothing but lights may switch off all others, too.

        Raises
        ------
        DeviceError
            A channel could not be confirmed as off.
        """
        self.resynchronise()
        self.switch_off(switches)

    def heartbeat(self) -> None:  # noqa: B027, most boards have none
        """Restart the board's watchdog, if it has one; takes milliseconds.

        Raises
        ------
        DeviceError
            If the watchdog has triggered already.
        """

    @classmethod  # noqa: B027, most settings name no addresses
    def check_addresses(cls, settings: Any, addresses: Collection[str]) -> None:
        """Refuse settings that contradict the addresses of the boards of a bank.

        Raises
        ------
        UsageError
            They do.
        """

    @staticmethod
    def switch_off(switches: Iterable[Switch]) -> None:
        """Switch channels off, each even if another one fails.

        Raises
        ------
        DeviceError
            A channel could not be confirmed as off: the first failure.
        """
        failure: DeviceError | None = None
        for switch in switches:
            try:
                switch.switch(on=False)
            except DeviceError as error:
                failure = failure or error
                with suppress(DeviceError):  # so that the next one is understood
                    switch.board.resynchronise()
        if failure:
            raise failure
