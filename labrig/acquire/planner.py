"""The plan: the protocol's own code run on stand-ins that take the time of the devices."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import TypeVar

from labrig.acquire.actions import ManualStep
from labrig.acquire.loading import load_driver
from labrig.acquire.protocol import ProtocolModel
from labrig.acquire.rig import Rig
from labrig.acquire.rig_file import RigFile
from labrig.acquire.roles import CAMERA, ROLES, Device
from labrig.acquire.session import TOLERANCE_S, Session
from labrig.acquire.values import CameraOffers, Frame
from labrig.clock import VirtualClock
from labrig.errors import ProtocolError
from labrig.quantity import duration_text
from labrig.record import PERSON, ActionRecord, FrameRecord
from labrig.yaml_file import validate

#: Largest number of steps: more than any run has, and laid out in about a second.
MAX_STEPS = 50_000

T = TypeVar("T")


@dataclass(frozen=True)
class Step:
    """One line of the timeline.

    Attributes
    ----------
    at_s
        Begin of the step in seconds after the start of the run.
    unit
        Name of the unit.
    device
        Key of the device, `PERSON` for a step by hand, `-` for a wait or a warning.
    action
        Action as text.
    """

    at_s: float
    unit: str
    device: str
    action: str


@dataclass(frozen=True)
class Plan:
    """Timeline of a run, with the longest durations and the largest number of frames.

    Attributes
    ----------
    steps
        Steps in order of time.
    units
        Names of the units in order.
    unit_ends_s
        End of each unit in seconds after the start of the run.
    frames
        Number of frames.
    offers
        Settings that the camera offers.
    """

    steps: tuple[Step, ...]
    units: tuple[str, ...]
    unit_ends_s: tuple[float, ...]
    frames: int
    offers: CameraOffers

    @property
    def duration_s(self) -> float:
        """Lab time of the whole run in seconds."""
        return self.unit_ends_s[-1] if self.unit_ends_s else 0.0

    @property
    def size_bytes(self) -> int:
        """Size of all frames in bytes."""
        return self.frames * self.offers.frame_bytes

    @property
    def manual_steps(self) -> tuple[str, ...]:
        """Steps to be done by hand."""
        return tuple(step.action for step in self.steps if step.device == PERSON)

    def lines(self) -> list[str]:
        """Return the timeline as lines `@t (+dt) device action`, with a heading for each unit."""
        lines, unit, before_s = [], "", 0.0
        for step in self.steps:
            if step.unit != unit:
                unit = step.unit
                lines.append(f"unit {unit}")
            lines.append(
                f"  @{step.at_s:10.3f} s (+{step.at_s - before_s:9.3f} s)  "
                f"{step.device:8} {step.action}"
            )
            before_s = step.at_s
        return lines

    def to_json(self) -> str:
        """Return the timeline as JSON."""
        content = {
            "units": self.units,
            "duration_s": self.duration_s,
            "frames": self.frames,
            "size_bytes": self.size_bytes,
            "steps": [asdict(step) for step in self.steps],
        }
        return json.dumps(content, ensure_ascii=False)


def plan(protocol: ProtocolModel, rig: RigFile, source: str) -> Plan:
    """Lay out a protocol on the devices of a rig without opening any of them.

    The units of the protocol are run on stand-ins that take the time that the drivers declare.
    Choices that depend on recorded frames are planned with their longest outcome.

    Parameters
    ----------
    protocol
        Protocol to be planned.
    rig
        Rig file with the devices.
    source
        Name or path of the rig file, for messages.

    Returns
    -------
    Plan
        Timeline, duration, number of frames and steps by hand.

    Raises
    ------
    ProtocolError
        If a device is missing, a setting is not offered, a frame does not fit before the next
        action, or there are more than `MAX_STEPS` steps.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> protocol = labrig.read_protocol(Path("runs/decay/protocol.yaml"))
    >>> rig = labrig.read_rig_file(Path("runs/decay/rig.yaml"))
    >>> plan = labrig.plan(protocol, rig, "rig.yaml")
    >>> plan.units, plan.frames
    (('dark', 'meter', 'decay-1'), 37)
    >>> print(plan.lines()[1])
      @     0.000 s (+    0.000 s)  -        warming up the camera, 1 min
    """
    clock = VirtualClock()
    recorder = _PlanRecorder(clock)
    devices: dict[str, Device] = {}
    for key, entry in rig.devices.items():
        driver = load_driver(key, entry.driver, source)
        settings = validate(entry.settings(), driver.Settings, f"{source}, devices.{key}")
        if stand_in := ROLES[key].planned:
            devices[key] = stand_in(driver, settings, clock)
    warm_up_s = {key: entry.warm_up for key, entry in rig.devices.items()}
    planned_rig = Rig(rig.name, clock, devices, warm_up_s)
    units, unit_ends_s = protocol.units(), []
    for unit in units:
        recorder.unit = unit.name
        unit.run(Session(planned_rig, recorder, recorder))
        unit_ends_s.append(clock.now())
    return Plan(
        tuple(recorder.steps),
        tuple(unit.name for unit in units),
        tuple(unit_ends_s),
        recorder.frame_count,
        planned_rig[CAMERA].offers() if CAMERA in planned_rig else CameraOffers((), ()),
    )


@dataclass
class _PlanRecorder:
    """Recorder and observer of a plan, which lists the steps and refuses late ones."""

    clock: VirtualClock
    unit: str = ""
    steps: list[Step] = field(default_factory=list)
    frame_count: int = 0

    def acted(
        self,
        device: str,
        action: str,
        start_s: float,
        end_s: float,
        late_s: float,
        task: str = "",
    ) -> None:
        self._add_step(start_s, device, action, late_s)

    def photographed(self, role: str, frame: Frame, late_s: float) -> None:
        self.frame_count += 1
        self._add_step(frame.start_s, CAMERA.key, f"{role} frame, {frame.settings}", late_s)

    def temperature(self, celsius: float, at_s: float) -> None:
        pass

    def last_manual_step(self) -> None:
        return None

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str:
        self.clock.spend(step.takes_s)
        return ""

    def frames(self, role: str) -> Sequence[FrameRecord]:
        return ()

    def actions(self, device: str) -> Sequence[ActionRecord]:
        return ()

    def choose(self, what: str, decide: Callable[[], T], worst: T) -> T:
        return worst

    def doing(self, what: str, until_s: float | None = None) -> None:
        if until_s is not None:
            self._add_step(self.clock.now(), "-", what, 0.0)

    def warn(self, text: str) -> None:
        self._add_step(self.clock.now(), "-", f"warning: {text}", 0.0)

    def _add_step(self, at_s: float, device: str, action: str, late_s: float) -> None:
        if late_s > TOLERANCE_S:
            previous = next(step for step in reversed(self.steps) if step.device != "-")
            raise ProtocolError(
                f"{self.unit}: '{action}' would begin {duration_text(late_s)} late, because "
                f"'{previous.action}' is not over; leave more time between frames (every:) or "
                "expose for less"
            )
        if len(self.steps) == MAX_STEPS:
            raise ProtocolError(
                f"expected at most {MAX_STEPS} steps, got more in {self.unit}; ask for fewer "
                "repeats or frames"
            )
        self.steps.append(Step(at_s, self.unit, device, action))
