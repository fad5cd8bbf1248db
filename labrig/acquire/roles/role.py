"""Definition of a role: methods of its devices, stand-in of a plan, exercise of a rig check."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar, runtime_checkable

from labrig.acquire.channels import Board
from labrig.acquire.values import Frame
from labrig.foundation.clock import Clock, VirtualClock

if TYPE_CHECKING:
    from labrig.acquire.roles.board_device import BoardDevice

#: `refuse`: the setting spoils photometry. `warn`: it may. `fine`: it is correct.
Severity = Literal["refuse", "warn", "fine"]


@dataclass(frozen=True)
class Finding:
    """Assessment of one setting of a device.

    Attributes
    ----------
    severity
        Effect on a measurement; see `Severity`.
    what
        The setting and its effect.
    remedy
        Remedy with its place in the device's menu; empty if none is needed.
    """

    severity: Severity
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}" if self.remedy else self.what


@runtime_checkable
class Device(Protocol):
    """Methods of every device."""

    def identity(self) -> str:
        """Return one line that identifies the device: maker, model, serial number, firmware."""

    def make_safe(self) -> None:
        """Synchronise the connection, whatever was interrupted, then reach the safe state.

        Raises
        ------
        DeviceError
            If the safe state could not be confirmed.
        """

    def disconnect(self) -> None:
        """Release the device; never raises if it is gone already."""


@runtime_checkable
class Light(Device, Protocol):
    """Methods of every device that gives light. Safe state: dark."""

    def reads_back(self) -> bool:
        """Whether the device reports its state; else the state is the one commanded last."""


@runtime_checkable
class Checkable(Protocol):
    """A device that can report settings of its own that spoil a measurement."""

    def findings(self) -> Sequence[Finding]:
        """Return assessments of the settings made by hand, as far as the device reports them."""


@runtime_checkable
class KeptAwake(Protocol):
    """A device that switches itself off unless it receives commands."""

    def keep_awake(self) -> None:
        """Restart the device's auto-off timer; short, and harmless between any two actions."""


@runtime_checkable
class Guarded(Protocol):
    """A device with a watchdog, which reaches its safe state when commands stay away for long."""

    def heartbeat(self) -> None:
        """Restart the watchdog; takes milliseconds.

        Raises
        ------
        DeviceError
            If the watchdog has triggered already.
        """


class PlannedDevice:
    """Base of all stand-ins in plans: every method does nothing and takes no time."""

    def identity(self) -> str:
        """Return a placeholder."""
        return "planned"

    def make_safe(self) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Do nothing."""


@dataclass(frozen=True)
class Measured:
    """One measured quantity.

    Attributes
    ----------
    what
        Name of the quantity.
    value
        Value with its unit, as text.
    """

    what: str
    value: str


@dataclass(frozen=True)
class Suggestion:
    """A key of the rig file with the value that was measured for it."""

    key: str
    value: str


@dataclass(frozen=True)
class Exercised:
    """Outcome of the exercise of a device that worked.

    Attributes
    ----------
    measured
        Measured quantities.
    findings
        Assessments of the device's settings.
    suggestions
        Values for the rig file.
    """

    measured: tuple[Measured, ...] = ()
    findings: tuple[Finding, ...] = ()
    suggestions: tuple[Suggestion, ...] = ()


class FrameReader(Protocol):
    """Reader of the pictures that a camera delivers."""

    def dark_frame(self, frame: Frame) -> Exercised:
        """Return measurements and findings of a frame taken in darkness.

        Raises
        ------
        FrameError
            If the frame cannot be read.
        """

    def live_picture(self, jpeg: bytes) -> Measured:
        """Return a measurement of a picture of the live view.

        Raises
        ------
        FrameError
            If the picture cannot be read.
        """


@dataclass(frozen=True)
class ExerciseContext:
    """Resources for the exercise of a device.

    Attributes
    ----------
    clock
        Clock of the rig.
    frame_reader
        Reader of frames and live pictures.
    """

    clock: Clock
    frame_reader: FrameReader

    def timed_s(self, act: Callable[[], object]) -> float:
        """Call `act` and return its duration in seconds."""
        start_s = self.clock.now()
        act()
        return self.clock.now() - start_s


def spread_ms(durations_s: Sequence[float]) -> str:
    """Return shortest and longest of durations in milliseconds, as text."""
    shortest, longest = min(durations_s) * 1e3, max(durations_s) * 1e3
    return f"{shortest:.1f} to {longest:.1f} ms ({len(durations_s)} times)"


DeviceT = TypeVar("DeviceT", bound=Device)

#: State of a light that is off, as in the action that switches it off.
DARK = "off"


@dataclass(frozen=True)
class Role(Generic[DeviceT]):
    """A role that devices fill.

    Parameters
    ----------
    key
        Key of the role's device in a rig file and in the journal.
    protocol_class
        Protocol class that its drivers satisfy.
    name
        Name of its device in messages.
    planned
        Factory of the stand-in in a plan, from the device's settings and the plan's clock; None if
        a plan needs none.
    on_board
        Class of its devices that are channels of a board; None if no board has such channels.
    exercise
        Function that exercises the device gently and leaves it safe in any case; None for no
        exercise.
    state
        Function that reads the state of a device that gives light, in the words of the actions that
        switch it (`DARK` if it is off); None if the role gives no light.
    safe_first
        Whether the device is made safe before the devices of other roles, in the order of `ROLES`.
    """

    key: str
    protocol_class: type
    name: str
    planned: Callable[[Any, VirtualClock], DeviceT] | None = None
    on_board: "type[BoardDevice] | None" = None
    exercise: Callable[[DeviceT, ExerciseContext], Exercised] | None = None
    state: Callable[[DeviceT], str] | None = None
    safe_first: bool = False

    def driver(self, registered: type) -> type[Any] | None:
        """Return the class that fills the role with a registered driver, None if it cannot.

        It is the driver itself, or the role's own device on the channels of the driver's board.
        """
        if issubclass(registered, self.protocol_class):
            return registered
        if self.on_board is not None and issubclass(registered, Board):
            return self.on_board.for_board(registered)
        return None


class DeviceAction(Protocol):
    """An action of a device, now or at a time of a sequence; its text is in the journal."""

    @property
    def device(self) -> str:
        """Key of the role."""

    def begin(self, device: Any, /) -> None:
        """Begin the action on the device of the role.

        Raises
        ------
        ProtocolError
            If the device does not have what is demanded.
        DeviceError
            If the device did not perform the action.
        """
