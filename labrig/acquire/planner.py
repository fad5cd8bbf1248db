"""The plan of a run: the protocol's own code run on stand-ins that take the time of the devices."""

import json
import math
import zlib
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, field
from typing import TypeVar

from labrig.acquire.actions import ManualStep
from labrig.acquire.continuation import Continuation, Pace
from labrig.acquire.driver_loading import driver_and_settings, refuse_shared_outlets
from labrig.acquire.protocol import ProtocolModel, require_inside
from labrig.acquire.rig import Rig
from labrig.acquire.rig_file import RigFile
from labrig.acquire.roles import CAMERA, LAMP, LAMP_ON, ROLES, Device
from labrig.acquire.roles.camera import PlannedCamera
from labrig.acquire.session import TOLERANCE_S, Session
from labrig.acquire.values import CameraCapabilities, Frame
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text
from labrig.optics import SpectrometerReading
from labrig.record import (
    PERSON,
    ActionRecord,
    FrameRecord,
    RunSize,
    SpectrumRecord,
)


@dataclass(frozen=True)
class Step:
    """One line of the timeline.

    Attributes
    ----------
    at_s
        Start of the step in seconds after the start of the run.
    unit
        Name of the unit.
    device
        Key of the device, `PERSON` for a step by hand, `-` for a wait or a warning.
    action
        Action as text.
    exposure_s
        Shutter time of a photograph in seconds; None for all other steps.
    lasts_s
        Duration of a wait in seconds; None for all other steps.
    """

    at_s: float
    unit: str
    device: str
    action: str
    exposure_s: float | None = None
    lasts_s: float | None = None


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
    capabilities
        Settings that the camera offers.
    patches
        Largest number of patches of a unit.
    drawn
        Units with frames at random times, which the run draws anew.
    """

    steps: tuple[Step, ...]
    units: tuple[str, ...]
    unit_ends_s: tuple[float, ...]
    capabilities: CameraCapabilities
    patches: int = 1
    drawn: frozenset[str] = frozenset()

    @property
    def duration_s(self) -> float:
        """Lab time of the whole run in seconds."""
        return self.unit_ends_s[-1] if self.unit_ends_s else 0.0

    def ends_s(self, unit: str) -> float:
        """Return the end of a unit in seconds after the start of the run."""
        return self.unit_ends_s[self.units.index(unit)]

    def begins_s(self, unit: str) -> float:
        """Return the start of a unit in seconds after the start of the run."""
        return (0.0, *self.unit_ends_s)[self.units.index(unit)]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.size().frames

    @property
    def size_bytes(self) -> int:
        """Size of frames and results on disk in bytes."""
        return self.size().total_bytes

    def size(self, done: Collection[str] = ()) -> RunSize:
        """Return the size on disk to be expected of the units that are not done yet."""
        frames = sum(step.device == CAMERA.key and step.unit not in done for step in self.steps)
        return RunSize.expected(frames, self.capabilities.frame_bytes, self.patches)

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
        size = self.size()
        content = {
            "units": self.units,
            "duration_s": self.duration_s,
            "manual_steps": len(self.manual_steps),
            "frames": size.frames,
            "frames_bytes": size.frames_bytes,
            "size_bytes": size.total_bytes,
            "steps": [asdict(step) for step in self.steps],
        }
        return json.dumps(content, ensure_ascii=False)


#: Largest number of steps: more than any run has, and laid out in about a second.
MAX_STEPS = 50_000

T = TypeVar("T")


def plan(
    protocol: ProtocolModel,
    rig: RigFile,
    source: str,
    capabilities: CameraCapabilities | None = None,
    continuation: Continuation | None = None,
) -> Plan:
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
    capabilities
        Settings that the connected camera offers; None for those that the rig file declares.
    continuation
        Place at which a run goes on: only units that it lacks are laid out, with the warm-up that
        devices need from their connection on, and frames as fast as they were. None for a whole
        run.

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
    bench = planned_rig(rig, source)
    clock = bench.clock
    assert isinstance(clock, VirtualClock)
    protocol = protocol.resolved_for(rig)
    if capabilities is not None:
        bench.devices[CAMERA.key] = PlannedCamera(clock, capabilities)
    capabilities = bench[CAMERA].capabilities() if CAMERA in bench else CameraCapabilities((), ())
    if capabilities.frame_pixels is not None:
        require_inside(protocol.named_regions(), capabilities.frame_pixels)
    recorder = _PlanRecorder(clock, capabilities.overhead_s)
    units, unit_ends_s = protocol.units(), []
    pace = Pace(capabilities.overhead_s, capabilities.change_s)
    if continuation is not None:
        pace = continuation.pace(pace)
        completed = continuation.record.completed()
        units = [unit for unit in units if unit.name not in completed]
        recorder.follow(continuation)
        clock.epoch_s = continuation.time
        bench.connected_s = continuation.connected_time - continuation.time
        if CAMERA in bench:
            bench.devices[CAMERA.key] = PlannedCamera(clock, capabilities, pace)
        if LAMP in bench and continuation.burns(LAMP.key, str(LAMP_ON)):
            bench[LAMP].on()
    for unit in units:
        recorder.unit = unit.name
        clock.spend(pace.reading_s)
        try:
            unit.run(Session(bench, recorder, recorder))
        except ProtocolError as error:
            if (part := unit.name.rpartition("/")[0]) and unit.name not in str(error):
                error.args = (f"part {part}: {error}",)
            raise
        clock.spend(pace.reading_s)
        unit_ends_s.append(clock.now())
    return Plan(
        tuple(recorder.steps),
        tuple(unit.name for unit in units),
        tuple(unit_ends_s),
        capabilities,
        max((len(protocol.patches_of(unit.name)) for unit in units), default=1) or 1,
        frozenset(recorder.drawn),
    )


def planned_rig(rig: RigFile, source: str, keys: Collection[str] | None = None) -> Rig:
    """Return a rig of stand-ins, which take the time that the drivers declare and do nothing else.

    Parameters
    ----------
    rig
        Rig file with the devices.
    source
        Name or path of the rig file, for messages.
    keys
        Keys of the devices; None for all.

    Returns
    -------
    Rig
        Stand-ins on a virtual clock, for the roles that have one.

    Raises
    ------
    UsageError
        If there is no such driver, or a key of a device is unknown or invalid.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.acquire import DOOR, planned_rig
    >>> rig = labrig.read_rig_file(Path("runs/decay/rig.yaml"))
    >>> planned_rig(rig, "rig.yaml")[DOOR].travel_s()
    0.3
    """
    clock = VirtualClock()
    asked = [key for key in rig.devices if keys is None or key in keys]
    loaded = {key: driver_and_settings(rig, key, source) for key in asked}
    if keys is None:
        refuse_shared_outlets(rig, loaded, source)
    devices: dict[str, Device] = {
        key: stand_in(settings, clock)
        for key, (_, settings) in loaded.items()
        if (stand_in := ROLES[key].planned)
    }
    warm_up_s = {key: entry.warm_up for key, entry in rig.devices.items()}
    return Rig(rig.name, clock, devices, warm_up_s)


@dataclass
class _PlanRecorder:
    """Recorder and observer of a plan, which lists the steps and refuses late ones."""

    clock: VirtualClock
    overhead_s: float
    unit: str = ""
    steps: list[Step] = field(default_factory=list)
    done: list[ActionRecord] = field(default_factory=list)
    kept: list[ActionRecord] = field(default_factory=list)
    times: list[tuple[str, str, float]] = field(default_factory=list)
    drawn: set[str] = field(default_factory=set)

    def follow(self, continuation: Continuation) -> None:
        """Take over what was recorded before."""
        self.done, self.kept = continuation.all_actions, continuation.completed_actions
        self.times = [
            (frame.role, frame.unit, frame.start_time)
            for attempt in continuation.record.completed().values()
            for frame in attempt.frames
        ]

    def acted(
        self,
        device: str,
        action: str,
        start_s: float,
        end_s: float,
        late_s: float,
        task: str = "",
    ) -> None:
        self._add(Step(start_s, self.unit, device, action), late_s)
        begin, end = self.clock.wall(start_s), self.clock.wall(end_s)
        record = ActionRecord(self.unit, device, action, begin, end, late_s, task)
        self.done.append(record)
        self.kept.append(record)

    def photographed(self, role: str, frame: Frame, late_s: float) -> None:
        action, exposure_s = f"{role} frame, {frame.settings}", frame.settings.exposure_s
        self._add(Step(frame.start_s, self.unit, CAMERA.key, action, exposure_s), late_s)
        self.times.append((role, self.unit, self.clock.wall(frame.start_s)))

    def spectrum(
        self, role: str, reading: SpectrometerReading, start_s: float, end_s: float, late_s: float
    ) -> None:
        pass

    def temperature(self, celsius: float, at_s: float) -> None:
        pass

    def last_manual_step(self) -> None:
        return None

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str:
        self.clock.spend(step.takes_s)
        return ""

    def frames(self, role: str) -> Sequence[FrameRecord]:
        return ()

    def spectra(self, role: str) -> Sequence[SpectrumRecord]:
        return ()

    def frame_times(self, role: str) -> Sequence[tuple[str, float]]:
        return [(unit, time) for its_role, unit, time in self.times if its_role == role]

    def actions(self, device: str) -> Sequence[ActionRecord]:
        return [action for action in self.kept if action.device == device]

    def all_actions(self, device: str) -> Sequence[ActionRecord]:
        return [action for action in self.done if action.device == device]

    def decide(self, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
        return when_planned

    def seed(self) -> int:
        self.drawn.add(self.unit)
        return zlib.crc32(self.unit.encode())

    def doing(self, what: str, until_s: float | None = None) -> None:
        if until_s is not None:
            now_s = self.clock.now()
            self._add(Step(now_s, self.unit, "-", what, lasts_s=until_s - now_s))

    def warn(self, text: str) -> None:
        self._add(Step(self.clock.now(), self.unit, "-", f"warning: {text}"))

    def _add(self, step: Step, late_s: float = 0.0) -> None:
        if late_s > TOLERANCE_S:
            raise ProtocolError(self._lateness(step.action, late_s))
        if len(self.steps) == MAX_STEPS:
            raise ProtocolError(
                f"expected at most {MAX_STEPS} steps, got more in {self.unit}; ask for fewer "
                "repeats or frames"
            )
        self.steps.append(step)

    def _lateness(self, action: str, late_s: float) -> str:
        previous = next(step for step in reversed(self.steps) if step.device != "-")
        message = (
            f"{self.unit}: '{action}' would begin {duration_text(late_s)} late, because "
            f"'{previous.action}' is not over; "
        )
        if previous.exposure_s is None:
            return f"{message}leave more time before it"
        shortest_s = math.ceil(10 * (previous.exposure_s + self.overhead_s) - 1e-6) / 10
        return (
            f"{message}it takes {duration_text(previous.exposure_s)} and the camera "
            f"{duration_text(self.overhead_s)} until the next (frame_time): let frames begin at "
            f"least {duration_text(shortest_s)} apart (every: {duration_text(shortest_s)}), or "
            "expose for less"
        )
