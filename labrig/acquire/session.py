"""The session of a unit: actions, waits and photographs, timed, recorded and interruptible.

The same code runs on a bench and in the planner; only devices, clock and recorder differ.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Protocol, TypeVar

from labrig.acquire.actions import Action, LateAction, ManualStep, TimedAction, UndoManualStep
from labrig.acquire.readback import LightReadback
from labrig.acquire.rig import Rig, device_errors
from labrig.acquire.roles import (
    CAMERA,
    CHANGER,
    LAMP,
    LAMP_OFF,
    SAMPLE_CHANGER,
    SPECTROMETER,
    BringSample,
    Guarded,
    KeptAwake,
    ReadSpectrum,
    TakeFrame,
)
from labrig.acquire.temperature import TemperatureLog
from labrig.acquire.values import ExposureSettings, Frame
from labrig.foundation.clock import Clock
from labrig.foundation.quantity import duration_text
from labrig.optics import SpectrometerReading
from labrig.record import PERSON, ActionRecord, FrameRecord, SpectrumRecord, unit_within

T = TypeVar("T")
RecordT = TypeVar("RecordT", FrameRecord, ActionRecord, SpectrumRecord)

#: Period of keeping devices awake; cameras switch off after one minute at the earliest.
AWAKE_PERIOD_S = 30.0
#: Time before an action without other commands: a busy camera may take seconds to answer.
QUIET_PERIOD_S = 10.0
#: Longest duration of serving a watchdog.
HEARTBEAT_DURATION_S = 0.5
#: Delay up to which an action is on time; a PC has tails of 5 ms, 10 ms under load.
TOLERANCE_S = 0.02


class Recorder(Protocol):
    """Recorder of what happens in a unit; times are on the rig's clock in seconds."""

    def acted(
        self,
        device: str,
        action: str,
        start_s: float,
        end_s: float,
        late_s: float,
        task: str = "",
    ) -> None:
        """Record an action of a device, a person or the protocol; `task` as in `ActionRecord`."""

    def photographed(self, role: str, frame: Frame, late_s: float) -> None:
        """Record a frame."""

    def spectrum(
        self, role: str, reading: SpectrometerReading, start_s: float, end_s: float, late_s: float
    ) -> None:
        """Record a reading of the spectrometer."""

    def temperature(self, celsius: float, at_s: float) -> None:
        """Record a reading of the thermometer."""

    def last_manual_step(self) -> str | None:
        """Return the last step done by hand, in this unit or a completed one; None without one."""

    def frames(self, role: str) -> Sequence[FrameRecord]:
        """Return the frames with a role, those of completed units before those of this one."""

    def frame_times(self, role: str) -> Sequence[tuple[str, float]]:
        """Return unit and start of each of these frames, in a plan those that it lays out, too."""

    def spectra(self, role: str) -> Sequence[SpectrumRecord]:
        """Return the spectra with a role, those of completed units before those of this one."""

    def actions(self, device: str) -> Sequence[ActionRecord]:
        """Return the actions of a device, those of completed units before those of this one."""

    def all_actions(self, device: str) -> Sequence[ActionRecord]:
        """Return the actions of a device in order of time, those of failed attempts included."""

    def decide(self, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
        """Return `on_bench()` on a bench; `when_planned` in a plan, which has no data for it."""

    def seed(self) -> int:
        """Return a seed of this unit's random numbers, the same in all attempts at it."""


class Observer(Protocol):
    """Observer of what goes on in a run; times are on the rig's clock in seconds."""

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Note the start of an action or, with its end `until_s`, of a wait."""

    def warn(self, text: str) -> None:
        """Show a warning to the person at the bench."""

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Ask a person to do a step by hand, and wait until it is done.

        Parameters
        ----------
        step
            Step to be done.
        last
            Last step done by hand, which can be undone; None if there is none.
        meanwhile
            Function that is called some times a second until the person answers.

        Returns
        -------
        str or None
            Remark of the person, mostly empty; None to undo the last step.
        """


class Session:
    """Access of one unit to the bench.

    Parameters
    ----------
    rig
        Open devices of the bench.
    recorder
        Recorder of actions, frames and temperatures.
    observer
        Observer of the run.
    temperature
        Log of the thermometer, shared by all units of a run; None for one of this unit's own.
    lights
        Read-back of the lights, shared by all units of a run; None for one of this unit's own.
    dark_since_s
        Time on the rig's clock in seconds since when the sample has been in the dark on the sample
        changer; None if it was not taken away.
    """

    def __init__(
        self,
        rig: Rig,
        recorder: Recorder,
        observer: Observer,
        temperature: TemperatureLog | None = None,
        lights: LightReadback | None = None,
        dark_since_s: float | None = None,
    ) -> None:
        self.rig = rig
        self._recorder = recorder
        self._observer = observer
        self._temperature = temperature or TemperatureLog(rig, observer.warn)
        self._lights = lights or LightReadback(rig)
        self._dark_since_s = dark_since_s
        self._settings_in_force: ExposureSettings | None = None
        self._heartbeat_s = rig.clock.now()

    @property
    def clock(self) -> Clock:
        """Clock of the rig."""
        return self.rig.clock

    def wait(self, duration_s: float, why: str) -> None:
        """Wait for `duration_s` seconds."""
        until_s = self.clock.now() + duration_s
        self._observer.doing(f"{why}, {duration_text(duration_s)}", until_s)
        self._sleep_until(until_s)

    def wait_until_warm(self, key: str) -> None:
        """Wait until a device has been connected for its warm-up time."""
        left_s = self.rig.connected_s + self.rig.warm_up_s(key) - self.clock.now()
        if left_s > 0:
            self.wait(left_s, f"warming up the {key}")

    def bring(self, sample: str | None) -> None:
        """Bring a sample of the changer into place, with the lamp off; all others lie in the dark.

        Where a changer keeps samples in the dark, `rest` counts the time since it took this one
        away.

        Parameters
        ----------
        sample
            Name of the sample on the changer; None for all of them in the dark. A lamp burns on if
            they are there already.

        Raises
        ------
        ProtocolError
            The rig has no sample changer, or the changer has no such sample.
        """
        changer, action = self.rig[SAMPLE_CHANGER], BringSample(sample)
        turns = self._recorder.all_actions(action.device)
        self._dark_since_s = None
        if sample is None and not self._is_any_in_place(turns):
            return
        if LAMP in self.rig and self.rig[LAMP].is_on():
            self.perform(LAMP_OFF)
        if changer.keeps_dark():
            in_place = [n for n, turn in enumerate(turns) if turn.action == str(action)]
            # A sample that nothing was put in place of was in place up to now, or up to the crash.
            if in_place and in_place[-1] + 1 < len(turns):
                taken_away = turns[in_place[-1] + 1].start_time
                self._dark_since_s = taken_away - self.clock.wall(0.0)
        self.perform(action)

    def _is_any_in_place(self, turns: Sequence[ActionRecord]) -> bool:
        """Return whether a sample may be in place: when devices are connected, none is."""
        since = self.clock.wall(self.rig.connected_s)
        here = [turn.action for turn in turns if turn.start_time >= since]
        return bool(here) and here[-1] != str(BringSample(None))

    def rest(self, duration_s: float) -> None:
        """Wait until the sample has rested in the dark for `duration_s` seconds.

        Time on the sample changer counts, and is recorded; else the rest begins now.
        """
        now_s = self.clock.now()
        since_s = now_s if self._dark_since_s is None else min(self._dark_since_s, now_s)
        left_s = since_s + duration_s - now_s
        if left_s > 0:
            self.wait(left_s, "resting in the dark")
        if self._dark_since_s is not None:
            now_s = self.clock.now()
            text = f"in the dark for {now_s - since_s:.1f} s"
            self._recorder.acted("protocol", text, now_s, now_s, 0.0)

    def perform(self, action: Action) -> None:
        """Perform one action now."""
        self._heartbeat_if_due()
        self._read_lights_before([action])
        self._prepare(action)
        self._execute(action, late_s=0.0)

    def run_sequence(
        self, sequence: Sequence[TimedAction], tolerance_s: float = TOLERANCE_S
    ) -> Sequence[LateAction]:
        """Perform actions at their times after now, against absolute deadlines.

        The camera is configured and half-pressed for the next photograph as soon as the previous
        one is over, for the first one before the sequence begins. The lights that the sequence
        switches are read back before it begins. An action whose time has passed is performed at
        once and recorded as late; a warning is given for late actions other than photographs.

        Parameters
        ----------
        sequence
            Actions in order of time.
        tolerance_s
            Delay in seconds up to which an action is on time.

        Returns
        -------
        sequence of LateAction
            Actions that began more than `tolerance_s` late, for protocols that repeat them.
        """
        late_actions = []
        self._read_lights_before([timed.action for timed in sequence])
        photographs = [timed.action for timed in sequence if isinstance(timed.action, TakeFrame)]
        if photographs:
            self._prepare(photographs.pop(0))
        start_s = self.clock.now()
        for timed in sequence:
            deadline_s = start_s + timed.at_s
            self._sleep_until(deadline_s)
            late_s = self.clock.now() - deadline_s
            self._execute(timed.action, late_s)
            if late_s > tolerance_s:
                late_actions.append(LateAction(timed, late_s))
            if isinstance(timed.action, TakeFrame) and photographs:
                self._prepare(photographs.pop(0))
        if moves := [
            str(late) for late in late_actions if not isinstance(late.timed.action, TakeFrame)
        ]:
            self.warn(
                f"began late: {', '.join(moves)}; the times at which it happened are recorded "
                "(leave more time before it, or let this PC do less)"
            )
        return late_actions

    def ask(self, step: ManualStep) -> str:
        """Have a step done by hand and return the remark that came with it, mostly empty.

        Raises
        ------
        UndoManualStep
            If the last step done by hand is to be undone; the runner then does its unit again.
        """
        start_s = self.clock.now()
        self._heartbeat_if_due()
        remark = self._observer.ask(
            step, self._recorder.last_manual_step(), self._service_while_waiting()
        )
        if remark is None:
            raise UndoManualStep
        if CHANGER in self.rig:
            with device_errors(CHANGER.key):
                self.rig[CHANGER].do(step.task)
        text = f"{step.what} ({remark})" if remark else step.what
        self._recorder.acted(PERSON, text, start_s, self.clock.now(), 0.0, step.task)
        return remark

    def frames(self, role: str) -> Sequence[FrameRecord]:
        """Return the frames taken with a role, in completed units and in this one so far."""
        return self._recorder.frames(role)

    def frame_times(self, role: str) -> list[float]:
        """Return the begins of these frames in seconds since 1970, in a plan the planned ones."""
        return [time for _, time in self._recorder.frame_times(role)]

    def spectra(self, role: str) -> Sequence[SpectrumRecord]:
        """Return the spectra read with a role, in completed units and in this one so far."""
        return self._recorder.spectra(role)

    def actions(self, device: str) -> Sequence[ActionRecord]:
        """Return the actions of a device, in completed units and in this one so far."""
        return self._recorder.actions(device)

    def within(self, part: str) -> "Session":
        """Return a session for a unit of one part of a chain, which shows that part's frames."""
        recorder = _PartRecorder(self._recorder, part)
        return Session(
            self.rig,
            recorder,
            self._observer,
            self._temperature,
            self._lights,
            self._dark_since_s,
        )

    def decide(self, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
        """Make and record a decision on frames already taken; a plan assumes `when_planned`.

        `on_bench` must depend on recorded frames only, so that a resumed run decides the same.
        """
        chosen = self._recorder.decide(name, on_bench, when_planned)
        now_s = self.clock.now()
        self._recorder.acted("protocol", f"{name}: {chosen}", now_s, now_s, 0.0)
        return chosen

    def seed(self, purpose: str) -> int:
        """Return and record a seed of random numbers for a purpose such as `begins of frames`.

        Every unit has another one, which a unit that is done again keeps.
        """
        seed, now_s = self._recorder.seed(), self.clock.now()
        self._recorder.acted("protocol", f"seed of {purpose}: {seed}", now_s, now_s, 0.0)
        return seed

    def warn(self, text: str) -> None:
        """Show a warning to the person at the terminal."""
        self._observer.warn(text)

    def read_temperature(self) -> None:
        """Record the temperature now; long waits record it without this call."""
        self._temperature.read(self._recorder.temperature)

    def _sleep_until(self, deadline_s: float) -> None:
        """Wait, and keep devices awake and watchdogs served meanwhile."""
        needs_service = (
            self._kept_awake
            or self._guarded
            or self._temperature.is_kept
            or self._lights.is_reported
        )
        while needs_service and deadline_s - self.clock.now() > AWAKE_PERIOD_S + QUIET_PERIOD_S:
            self.clock.sleep(AWAKE_PERIOD_S)
            self._serve_devices()
        if deadline_s - self.clock.now() > QUIET_PERIOD_S:
            self._lights.read_if_due()
            self._temperature.read_if_due(self._recorder.temperature)
        if deadline_s - self.clock.now() > HEARTBEAT_DURATION_S:
            self._heartbeat_if_due()
        self.clock.sleep_until(deadline_s)

    def _service_while_waiting(self) -> Callable[[], None]:
        """Return a function that keeps devices awake and served while a person works."""
        next_s = self.clock.now() + AWAKE_PERIOD_S

        def serve() -> None:
            nonlocal next_s
            self.clock.sleep(0.0)
            if self.clock.now() >= next_s:
                self._serve_devices()
                next_s = self.clock.now() + AWAKE_PERIOD_S

        return serve

    def _serve_devices(self) -> None:
        for key, device in self._kept_awake.items():
            with device_errors(key):
                device.keep_awake()
        self._heartbeat()
        self._lights.read_if_due()
        self._temperature.read_if_due(self._recorder.temperature)

    def _read_lights_before(self, actions: Sequence[Action]) -> None:
        self._lights.read_before(
            [action for action in actions if not isinstance(action, TakeFrame | ReadSpectrum)]
        )

    def _heartbeat_if_due(self) -> None:
        if self.clock.now() - self._heartbeat_s >= AWAKE_PERIOD_S:
            self._heartbeat()

    def _heartbeat(self) -> None:
        for key, device in self._guarded.items():
            with device_errors(key):
                device.heartbeat()
        self._heartbeat_s = self.clock.now()

    @cached_property
    def _guarded(self) -> dict[str, Guarded]:
        return {k: d for k, d in self.rig.devices.items() if isinstance(d, Guarded)}

    @cached_property
    def _kept_awake(self) -> dict[str, KeptAwake]:
        return {k: d for k, d in self.rig.devices.items() if isinstance(d, KeptAwake)}

    def _prepare(self, action: Action) -> None:
        if not isinstance(action, TakeFrame):
            return
        camera = self.rig[CAMERA]
        with device_errors(CAMERA.key):
            if action.settings != self._settings_in_force:
                self._settings_in_force = None
                camera.configure(action.settings)
                self._settings_in_force = action.settings
            camera.arm()

    def _execute(self, action: Action, late_s: float) -> None:
        if isinstance(action, TakeFrame):
            self._observer.doing(str(action))
            with device_errors(CAMERA.key):
                frame = self.rig[CAMERA].shoot()
            self._recorder.photographed(action.role, frame, late_s)
            return
        self._observer.doing(f"{action.device} {action}")
        start_s = self.clock.now()
        if isinstance(action, ReadSpectrum):
            with device_errors(SPECTROMETER.key):
                reading = self.rig[SPECTROMETER].read(action.integration_s, action.repetitions)
            self._recorder.spectrum(action.role, reading, start_s, self.clock.now(), late_s)
        else:
            with self._lights.asking(action), device_errors(action.device):
                action.begin(self.rig.device(action.device))
        self._recorder.acted(action.device, str(action), start_s, self.clock.now(), late_s)


class _PartRecorder:
    """Recorder that passes records on and shows the frames of one part of a chain as its own."""

    def __init__(self, recorder: Recorder, part: str) -> None:
        self.acted = recorder.acted
        self.photographed = recorder.photographed
        self.spectrum = recorder.spectrum
        self.temperature = recorder.temperature
        self.last_manual_step = recorder.last_manual_step
        self.all_actions = recorder.all_actions
        self.decide = recorder.decide
        self.seed = recorder.seed
        self._recorder = recorder
        self._part = part

    def frames(self, role: str) -> Sequence[FrameRecord]:
        return self._records_of_part(self._recorder.frames(role))

    def frame_times(self, role: str) -> Sequence[tuple[str, float]]:
        units = ((unit_within(self._part, u), t) for u, t in self._recorder.frame_times(role))
        return [(unit, time) for unit, time in units if unit is not None]

    def spectra(self, role: str) -> Sequence[SpectrumRecord]:
        return self._records_of_part(self._recorder.spectra(role))

    def actions(self, device: str) -> Sequence[ActionRecord]:
        return self._records_of_part(self._recorder.actions(device))

    def _records_of_part(self, records: Sequence[RecordT]) -> list[RecordT]:
        return [
            replace(record, unit=unit)
            for record in records
            if (unit := unit_within(self._part, record.unit)) is not None
        ]
