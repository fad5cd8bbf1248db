"""What a protocol's unit may do: act, wait, photograph; all of it timed, recorded, interruptible.

The same code runs on a bench and in the planner: only devices, clock and recorder differ.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Protocol, TypeVar

from labrig.acquire.actions import Action, LateAction, ManualStep, TimedAction, UndoManualStep
from labrig.acquire.readback import LightReadback
from labrig.acquire.rig import Rig, device_errors
from labrig.acquire.roles import CAMERA, CHANGER, Guarded, KeptAwake, Shoot
from labrig.acquire.temperature import TemperatureLog
from labrig.acquire.values import ExposureSettings, Frame
from labrig.clock import Clock
from labrig.quantity import duration_text
from labrig.record import PERSON, ActionRecord, FrameRecord, unit_within

T = TypeVar("T")
RecordT = TypeVar("RecordT", FrameRecord, ActionRecord)

#: Cameras can be set to switch off after a minute at the least.
AWAKE_PERIOD_S = 30.0
#: Nobody is spoken to so shortly before an action: a busy camera may take seconds to answer.
QUIET_BEFORE_S = 10.0
#: A watchdog is heard of in less.
BEAT_S = 0.5
#: An action may begin this much after its time; a PC is no better (tails of 5 ms, 10 under load).
TOLERANCE_S = 0.02


class Recorder(Protocol):
    """Keeps what happens in a unit. Times are on the rig's clock."""

    def acted(
        self,
        device: str,
        action: str,
        start_s: float,
        end_s: float,
        late_s: float,
        task: str = "",
    ) -> None:
        """Something was switched, moved or decided; `task` as in `ActionRecord`."""

    def photographed(self, role: str, frame: Frame, late_s: float) -> None:
        """A frame is to be kept."""

    def temperature(self, celsius: float, at_s: float) -> None:
        """The thermometer was read."""

    def last_manual_step(self) -> str | None:
        """What a person did last, in this unit or a completed one."""

    def frames(self, role: str) -> Sequence[FrameRecord]:
        """Frames with that role: of completed units, then of this one."""

    def actions(self, device: str) -> Sequence[ActionRecord]:
        """What that device did, in the same units."""

    def choose(self, what: str, decide: Callable[[], T], worst: T) -> T:
        """`decide()` on a bench; `worst` when planning, where there is nothing to decide on."""


class Observer(Protocol):
    """Is told what is going on. `until_s` is on the rig's clock."""

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Something that takes a while begins."""

    def warn(self, text: str) -> None:
        """Something a person should know."""

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Have a person do something, and wait until it is done.

        Parameters
        ----------
        last
            What can be taken back.
        meanwhile
            Called some times a second while nobody answers.

        Returns
        -------
        str or None
            A remark, mostly empty; None to take back what was done last.
        """


class Session:
    """One unit's hold on the bench.

    Parameters
    ----------
    temperature
        Reads the thermometer, for all units of a run; None: one of this unit's own.
    lights
        Reads the lights back, for all units of a run; None: one of this unit's own.
    """

    def __init__(
        self,
        rig: Rig,
        recorder: Recorder,
        observer: Observer,
        temperature: TemperatureLog | None = None,
        lights: LightReadback | None = None,
    ) -> None:
        self.rig = rig
        self._recorder = recorder
        self._observer = observer
        self._temperature = temperature or TemperatureLog(rig, observer.warn)
        self._lights = lights or LightReadback(rig)
        self._in_force: ExposureSettings | None = None
        self._beaten_s = rig.clock.now()

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
        self._beat_if_due()
        self._read_lights_before([action])
        self._prepare(action)
        self._execute(action, late_s=0.0)

    def run_sequence(
        self, sequence: Sequence[TimedAction], tolerance_s: float = TOLERANCE_S
    ) -> Sequence[LateAction]:
        """Do things at their times after now, against absolute deadlines.

        The camera is set and half-pressed for its next photograph as soon as the previous one is
        over, for the first one before the sequence begins. Before it, the lights are read back
        that the sequence switches. An action whose time has passed is done at once and recorded as
        late; of all but photographs that is said, too.

        Returns
        -------
        sequence of Missed
            What began more than `tolerance_s` after its time, for protocols that then repeat it.
        """
        missed = []
        self._read_lights_before([timed.action for timed in sequence])
        photographs = [timed.action for timed in sequence if isinstance(timed.action, Shoot)]
        if photographs:
            self._prepare(photographs.pop(0))
        zero_s = self.clock.now()
        for timed in sequence:
            deadline_s = zero_s + timed.at_s
            self._sleep_until(deadline_s)
            late_s = self.clock.now() - deadline_s
            self._execute(timed.action, late_s)
            if late_s > tolerance_s:
                missed.append(LateAction(timed, late_s))
            if isinstance(timed.action, Shoot) and photographs:
                self._prepare(photographs.pop(0))
        if moves := [str(one) for one in missed if not isinstance(one.timed.action, Shoot)]:
            self.warn(
                f"began late: {', '.join(moves)}; the times at which it happened are recorded "
                "(leave more time before it, or let this PC do less)"
            )
        return missed

    def ask(self, step: ManualStep) -> str:
        """Have something done by hand; returns the remark that came with it, mostly empty.

        Raises
        ------
        UndoManualStep
            What was done by hand last is to be done again. The runner does its unit again.
        """
        start_s = self.clock.now()
        self._beat_if_due()
        remark = self._observer.ask(step, self._recorder.last_manual_step(), self._meanwhile())
        if remark is None:
            raise UndoManualStep
        if CHANGER in self.rig:
            with device_errors(CHANGER.key):
                self.rig[CHANGER].do(step.task)
        said = f"{step.what} ({remark})" if remark else step.what
        self._recorder.acted(PERSON, said, start_s, self.clock.now(), 0.0, step.task)
        return remark

    def frames(self, role: str) -> Sequence[FrameRecord]:
        """Frames taken for that role, by completed units and by this one so far."""
        return self._recorder.frames(role)

    def actions(self, device: str) -> Sequence[ActionRecord]:
        """What that device did, in completed units and in this one so far."""
        return self._recorder.actions(device)

    def within(self, part: str) -> "Session":
        """The session of a unit of one part of a chain: it sees frames of its part only."""
        recorder = _PartRecorder(self._recorder, part)
        return Session(self.rig, recorder, self._observer, self._temperature, self._lights)

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

    def read_temperature(self) -> None:
        """Record the temperature now; in a wait that is long enough, that happens by itself."""
        self._temperature.read(self._recorder.temperature)

    def _sleep_until(self, deadline_s: float) -> None:
        """Wait; keep from falling asleep what would, and from striking what guards."""
        looked_after = (
            self._sleepy or self._guarded or self._temperature.is_kept or self._lights.is_told
        )
        while looked_after and deadline_s - self.clock.now() > AWAKE_PERIOD_S + QUIET_BEFORE_S:
            self.clock.sleep(AWAKE_PERIOD_S)
            self._look_after()
        if deadline_s - self.clock.now() > QUIET_BEFORE_S:
            self._lights.read_if_due()
            self._temperature.read_if_due(self._recorder.temperature)
        if deadline_s - self.clock.now() > BEAT_S:
            self._beat_if_due()
        self.clock.sleep_until(deadline_s)

    def _meanwhile(self) -> Callable[[], None]:
        """While a person takes an unknown time: the devices are looked after, too."""
        next_s = self.clock.now() + AWAKE_PERIOD_S

        def look_up() -> None:
            nonlocal next_s
            self.clock.sleep(0.0)
            if self.clock.now() >= next_s:
                self._look_after()
                next_s = self.clock.now() + AWAKE_PERIOD_S

        return look_up

    def _look_after(self) -> None:
        for key, device in self._sleepy.items():
            with device_errors(key):
                device.keep_awake()
        self._beat()
        self._lights.read_if_due()
        self._temperature.read_if_due(self._recorder.temperature)

    def _read_lights_before(self, actions: Sequence[Action]) -> None:
        self._lights.read_before([one for one in actions if not isinstance(one, Shoot)])

    def _beat_if_due(self) -> None:
        if self.clock.now() - self._beaten_s >= AWAKE_PERIOD_S:
            self._beat()

    def _beat(self) -> None:
        for key, device in self._guarded.items():
            with device_errors(key):
                device.heartbeat()
        self._beaten_s = self.clock.now()

    @cached_property
    def _guarded(self) -> dict[str, Guarded]:
        return {k: d for k, d in self.rig.devices.items() if isinstance(d, Guarded)}

    @cached_property
    def _sleepy(self) -> dict[str, KeptAwake]:
        return {k: d for k, d in self.rig.devices.items() if isinstance(d, KeptAwake)}

    def _prepare(self, action: Action) -> None:
        if not isinstance(action, Shoot):
            return
        camera = self.rig[CAMERA]
        with device_errors(CAMERA.key):
            if action.settings != self._in_force:
                self._in_force = None
                camera.configure(action.settings)
                self._in_force = action.settings
            camera.arm()

    def _execute(self, action: Action, late_s: float) -> None:
        if isinstance(action, Shoot):
            self._observer.doing(str(action))
            with device_errors(CAMERA.key):
                frame = self.rig[CAMERA].shoot()
            self._recorder.photographed(action.role, frame, late_s)
            return
        self._observer.doing(f"{action.device} {action}")
        start_s = self.clock.now()
        with device_errors(action.device):
            action.begin(self.rig.device(action.device))
        self._lights.asked(action)
        self._recorder.acted(action.device, str(action), start_s, self.clock.now(), late_s)


class _PartRecorder:
    """Records as the recorder it is given; shows frames of one part of a chain as its own."""

    def __init__(self, whole: Recorder, part: str) -> None:
        self.acted = whole.acted
        self.photographed = whole.photographed
        self.temperature = whole.temperature
        self.last_manual_step = whole.last_manual_step
        self.choose = whole.choose
        self._whole = whole
        self._part = part

    def frames(self, role: str) -> Sequence[FrameRecord]:
        return self._own(self._whole.frames(role))

    def actions(self, device: str) -> Sequence[ActionRecord]:
        return self._own(self._whole.actions(device))

    def _own(self, records: Sequence[RecordT]) -> list[RecordT]:
        return [
            replace(record, unit=unit)
            for record in records
            if (unit := unit_within(self._part, record.unit)) is not None
        ]
