"""What a role is: what its devices can do, what stands in for one in a plan, how it is tried."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeVar, runtime_checkable

from labrig.acquire.values import Frame
from labrig.clock import Clock, VirtualClock

#: `refuse`: photometry would be spoilt. `warn`: somebody should look. `fine`: as it should be.
Severity = Literal["refuse", "warn", "fine"]


@dataclass(frozen=True)
class Finding:
    """One setting of a device.

    Attributes
    ----------
    what
        How it is set, and what that does.
    remedy
        What to do, and where: the place in the menu. Empty where all is fine.
    """

    severity: Severity
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}" if self.remedy else self.what


@runtime_checkable
class Device(Protocol):
    """What every device can do."""

    def identity(self) -> str:
        """One line that identifies the device that answers: maker, model, serial, firmware."""

    def make_safe(self) -> None:
        """Bring the line back into step, whatever was interrupted, then reach the safe state.

        Raises
        ------
        DeviceError
            The safe state could not be confirmed.
        """

    def disconnect(self) -> None:
        """Release the device. Never raises because it is gone already."""


@runtime_checkable
class Light(Device, Protocol):
    """What every device can do that gives light. Safe: dark."""

    def reads_back(self) -> bool:
        """Whether its state is what the device says; else it is what was asked last."""


@runtime_checkable
class Checkable(Protocol):
    """A device that can say whether its own settings spoil a measurement."""

    def findings(self) -> Sequence[Finding]:
        """How it is set by hand, as far as it tells."""


@runtime_checkable
class KeptAwake(Protocol):
    """A device that switches itself off unless it is spoken to."""

    def keep_awake(self) -> None:
        """Make it count its time anew. Short, and harmless at any time between two actions."""


@runtime_checkable
class Guarded(Protocol):
    """A device with a watchdog: it goes to its safe state when it hears nothing for long."""

    def heartbeat(self) -> None:
        """Let it hear from this PC; takes milliseconds.

        Raises
        ------
        DeviceError
            Its watchdog has struck already.
        """


class PlannedDevice:
    """What all stand-ins of a plan have in common: nothing happens, and it takes no time."""

    def identity(self) -> str:
        """Nobody asks a plan."""
        return "planned"

    def make_safe(self) -> None:
        """It is."""

    def disconnect(self) -> None:
        """It is not connected."""


@dataclass(frozen=True)
class Measured:
    """One thing that was measured, with its unit in the text of `value`."""

    what: str
    value: str


@dataclass(frozen=True)
class Suggestion:
    """A key of the rig file and the measured value it could have."""

    key: str
    value: str


@dataclass(frozen=True)
class Exercised:
    """What a gentle exercise of a device has taught, beside that it worked."""

    measured: tuple[Measured, ...] = ()
    findings: tuple[Finding, ...] = ()
    suggestions: tuple[Suggestion, ...] = ()


class FrameReader(Protocol):
    """Somebody who can read what a camera delivers."""

    def dark_frame(self, frame: Frame) -> Exercised:
        """What a frame tells that was taken in darkness.

        Raises
        ------
        FrameError
            It cannot be read.
        """

    def live_picture(self, jpeg: bytes) -> Measured:
        """What is to be told of a live view's picture.

        Raises
        ------
        FrameError
            It cannot be read.
        """


@dataclass(frozen=True)
class ExerciseContext:
    """What there is to exercise a device with."""

    clock: Clock
    eyes: FrameReader

    def timed_s(self, act: Callable[[], object]) -> float:
        """Do it; returns how long it took."""
        asked_s = self.clock.now()
        act()
        return self.clock.now() - asked_s


def spread_ms(durations_s: Sequence[float]) -> str:
    """Shortest to longest, in milliseconds."""
    shortest, longest = min(durations_s) * 1e3, max(durations_s) * 1e3
    return f"{shortest:.1f} to {longest:.1f} ms ({len(durations_s)} times)"


DeviceT = TypeVar("DeviceT", bound=Device)

#: What is called the state of a light that gives none, as by the action that switches it off.
DARK = "off"


@dataclass(frozen=True)
class Role(Generic[DeviceT]):
    """A role that devices fill, and all that labrig knows of it.

    Parameters
    ----------
    key
        Of its device in a rig file and in the journal.
    does
        The Protocol that its drivers satisfy.
    name
        What to call its device in messages.
    planned
        The stand-in of a plan, from the driver's class, its settings and the plan's clock; None:
        a plan does without. What it has to know beforehand, drivers declare by class methods.
    exercise
        Tries it gently; None: nothing is tried. Leaves it safe, whatever happens.
    state
        Of a role that gives light: how its device is, in the words of the actions that switch it
        (`DARK` if it gives none), as it reads. None: it gives no light.
    safe_first
        Whether it is made safe before all devices that are not, in the order of `ROLES`.
    """

    key: str
    does: type
    name: str
    planned: Callable[[Any, Any, VirtualClock], DeviceT] | None = None
    exercise: Callable[[DeviceT, ExerciseContext], Exercised] | None = None
    state: Callable[[DeviceT], str] | None = None
    safe_first: bool = False


class DeviceAction(Protocol):
    """Something that a device is told to do, now or at a time of a sequence.

    Its text is what the journal says of it.
    """

    @property
    def device(self) -> str:
        """Key of the role."""

    def begin(self, device: Any, /) -> None:
        """Begin it on the device that fills the role.

        Raises
        ------
        ProtocolError
            The device has not got what is asked for.
        DeviceError
            It did not do it.
        """
