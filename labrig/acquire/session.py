"""What a protocol's unit may do: act, wait, photograph; all of it timed, recorded, interruptible.

The same code runs on a bench and in the planner: only devices, clock and recorder differ.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

from labrig.acquire.rig import Rig
from labrig.acquire.roles import KeptAwake
from labrig.acquire.values import ExposureSettings, Frame
from labrig.clock import Clock
from labrig.errors import DeviceError, LabrigError
from labrig.quantity import duration_text
from labrig.record import FrameRecord

T = TypeVar("T")

#: Cameras can be set to switch off after a minute at the least.
AWAKE_PERIOD_S = 30.0
#: Nobody is spoken to so shortly before an action: a busy camera may take seconds to answer.
QUIET_BEFORE_S = 10.0


@dataclass(frozen=True)
class Switch:
    """Lamp on or off."""

    on: bool

    def __str__(self) -> str:
        return "on" if self.on else "off"


@dataclass(frozen=True)
class Shoot:
    """One photograph, for a purpose: `dark`, `meter`, `decay`, `daylight`."""

    purpose: str
    settings: ExposureSettings

    def __str__(self) -> str:
        return f"{self.purpose} frame, {self.settings}"


Action = Switch | Shoot

LAMP_ON = Switch(on=True)
LAMP_OFF = Switch(on=False)


@dataclass(frozen=True)
class Timed:
    """An action and when it begins, in seconds after the start of its sequence."""

    at_s: float
    action: Action


def at(at_s: float, action: Action) -> Timed:
    """`action`, to begin `at_s` seconds after the start of the sequence."""
    return Timed(at_s, action)


class Recorder(Protocol):
    """Keeps what happens in a unit. Times are on the rig's clock."""

    def acted(self, device: str, action: str, start_s: float, end_s: float, late_s: float) -> None:
        """Something was switched, moved or decided."""

    def photographed(self, purpose: str, frame: Frame, late_s: float) -> None:
        """A frame is to be kept."""

    def frames(self, purpose: str) -> Sequence[FrameRecord]:
        """Frames with that purpose: of completed units, then of this one."""

    def choose(self, what: str, decide: Callable[[], T], worst: T) -> T:
        """`decide()` on a bench; `worst` when planning, where there is nothing to decide on."""


class Observer(Protocol):
    """Is told what is going on. `until_s` is on the rig's clock."""

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Something that takes a while begins."""

    def warn(self, text: str) -> None:
        """Something a person should know."""


class Session:
    """One unit's hold on the bench."""

    def __init__(self, rig: Rig, recorder: Recorder, observer: Observer) -> None:
        self.rig = rig
        self._recorder = recorder
        self._observer = observer
        self._in_force: ExposureSettings | None = None

    @property
    def clock(self) -> Clock:
        """The rig's clock."""
        return self.rig.clock

    def wait(self, duration_s: float, why: str) -> None:
        """Wait `duration_s` seconds from now."""
        until_s = self.clock.now() + duration_s
        self._observer.doing(f"{why}, {duration_text(duration_s)}", until_s)
        self._sleep_until(until_s)

    def wait_until_warm(self, key: str) -> None:
        """Wait until the device has been connected for its warm-up time."""
        left_s = self.rig.connected_s + self.rig.warm_up_s(key) - self.clock.now()
        if left_s > 0:
            self.wait(left_s, f"warming up the {key}")

    def perform(self, action: Action) -> None:
        """Do one thing now."""
        self._prepare(action)
        self._execute(action, late_s=0.0)

    def run_sequence(self, sequence: Sequence[Timed]) -> None:
        """Do things at their times after now, against absolute deadlines.

        The camera is set and half-pressed for its next photograph as soon as the previous one is
        over, for the first one before the sequence begins. An action whose time has passed is done
        at once and recorded as late.
        """
        photographs = [timed.action for timed in sequence if isinstance(timed.action, Shoot)]
        if photographs:
            self._prepare(photographs.pop(0))
        zero_s = self.clock.now()
        for timed in sequence:
            deadline_s = zero_s + timed.at_s
            self._sleep_until(deadline_s)
            self._execute(timed.action, late_s=self.clock.now() - deadline_s)
            if isinstance(timed.action, Shoot) and photographs:
                self._prepare(photographs.pop(0))

    def frames(self, purpose: str) -> Sequence[FrameRecord]:
        """Frames taken for that purpose, by completed units and by this one so far."""
        return self._recorder.frames(purpose)

    def choose(self, what: str, decide: Callable[[], T], worst: T) -> T:
        """A choice that rests on frames already taken; the plan assumes `worst`.

        `decide` must depend on nothing but recorded frames, so that a resumed run chooses alike.
        """
        chosen = self._recorder.choose(what, decide, worst)
        now_s = self.clock.now()
        self._recorder.acted("protocol", f"{what}: {chosen}", now_s, now_s, 0.0)
        return chosen

    def warn(self, text: str) -> None:
        """Tell the person at the terminal."""
        self._observer.warn(text)

    def _sleep_until(self, deadline_s: float) -> None:
        """Wait, and keep from falling asleep what would."""
        while self._sleepy and deadline_s - self.clock.now() > AWAKE_PERIOD_S + QUIET_BEFORE_S:
            self.clock.sleep(AWAKE_PERIOD_S)
            for key, device in self._sleepy.items():
                with _device_errors(key):
                    device.keep_awake()
        self.clock.sleep_until(deadline_s)

    @cached_property
    def _sleepy(self) -> dict[str, KeptAwake]:
        return {k: d for k, d in self.rig.devices.items() if isinstance(d, KeptAwake)}

    def _prepare(self, action: Action) -> None:
        if not isinstance(action, Shoot):
            return
        camera = self.rig.camera
        with _device_errors("camera"):
            if action.settings != self._in_force:
                self._in_force = None
                camera.configure(action.settings)
                self._in_force = action.settings
            camera.arm()

    def _execute(self, action: Action, late_s: float) -> None:
        if isinstance(action, Shoot):
            self._observer.doing(str(action))
            with _device_errors("camera"):
                frame = self.rig.camera.shoot()
            self._recorder.photographed(action.purpose, frame, late_s)
            return
        self._observer.doing(f"lamp {action}")
        lamp, start_s = self.rig.lamp, self.clock.now()
        with _device_errors("lamp"):
            if action.on:
                lamp.on()
            else:
                lamp.off()
        self._recorder.acted("lamp", str(action), start_s, self.clock.now(), late_s)


@contextmanager
def _device_errors(key: str) -> Iterator[None]:
    """Whatever a driver raises, its own faults included, names the device and ends the run."""
    try:
        yield
    except LabrigError:
        raise
    except Exception as error:
        raise DeviceError(f"{key}: its driver failed ({error!r})") from error
