"""The runner: performs the units of a protocol and records them in the run folder."""

import logging
import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from labrig.acquire.actions import UndoManualStep
from labrig.acquire.protocol import Unit
from labrig.acquire.readback import LightReadback
from labrig.acquire.rig import Rig
from labrig.acquire.session import Observer, Session
from labrig.acquire.temperature import TemperatureLog
from labrig.acquire.values import Frame
from labrig.foundation.clock import Clock
from labrig.foundation.quantity import duration_text
from labrig.optics import SpectrometerReading
from labrig.record import (
    PC_CLOCK,
    UNDONE,
    ActionRecord,
    AttemptWriter,
    FrameRecord,
    RunFolder,
    SpectrumRecord,
    TemperatureRecord,
    clock_stepped,
)

T = TypeVar("T")

_logger = logging.getLogger(__name__)


class RunObserver(Observer, Protocol):
    """Observer of a run, its units included."""

    def unit(self, name: str, number: int, total: int) -> None:
        """Note that a unit begins.

        Parameters
        ----------
        name
            Name of the unit.
        number
            Number of the unit, from 1.
        total
            Number of units.
        """

    def frame(self, record: FrameRecord) -> None:
        """Note that a frame was recorded."""


def run_units(
    units: Sequence[Unit],
    rig: Rig,
    folder: RunFolder,
    observer: RunObserver,
    metadata: Mapping[str, Any],
) -> None:
    """Run all units that are not complete in a run folder, in order.

    Parameters
    ----------
    units
        Units of the protocol.
    rig
        Open devices of the bench.
    folder
        Run folder, open for writing.
    observer
        Observer of units, frames and waits.
    metadata
        Keys and values of the RunStart of every attempt, such as the plan and the versions.

    Raises
    ------
    Slept
        If the PC was suspended during a unit.

    Notes
    -----
    A unit that ends by an exception leaves its attempt open: the caller first reaches the safe
    state, then closes the attempt with `RunFolder.close_open_attempts`. Where a person undoes the
    last step done by hand, the unit of that step no longer counts and is done again. The
    temperature is read at begin and end of a unit and while it waits; lights are read back while it
    waits.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.acquire import LAMP_OFF, LAMP_ON, at, run_units
    >>> from labrig.record import RunFolder
    >>> class Flash:
    ...     name = "flash"
    ...     def run(self, session):
    ...         session.run_sequence([at(0.0, LAMP_ON), at(2.0, LAMP_OFF)])
    >>> class Silent:
    ...     def unit(self, name, number, total): pass
    ...     def frame(self, record): pass
    ...     def doing(self, what, until_s=None): pass
    ...     def warn(self, text): pass
    ...     def ask(self, step, last, meanwhile): return ""
    >>> rig_file = labrig.read_rig_file(Path("runs/decay/rig.yaml"))
    >>> with (
    ...     labrig.open_bench(rig_file, "rig.yaml") as bench,
    ...     bench.devices() as rig,
    ...     RunFolder.create(Path("trials"), "flash", bench.clock.wall(), {}, bench.seed) as folder,
    ... ):
    ...     run_units([Flash()], rig, folder, Silent(), {})
    ...     [str(action.action) for action in folder.read().completed()["flash"].actions]
    ['on', 'off']
    """
    temperature = TemperatureLog(rig, observer.warn)
    while True:
        try:
            _run_remaining_units(units, rig, folder, observer, metadata, temperature)
        except UndoManualStep:
            rig.make_safe()
        else:
            return


def _run_remaining_units(
    units: Sequence[Unit],
    rig: Rig,
    folder: RunFolder,
    observer: RunObserver,
    metadata: Mapping[str, Any],
    temperature: TemperatureLog,
) -> None:
    record = folder.read()
    completed = record.completed()
    frames = [frame for attempt in completed.values() for frame in attempt.frames]
    spectra = [spectrum for attempt in completed.values() for spectrum in attempt.spectra]
    actions = [action for attempt in completed.values() for action in attempt.actions]
    # Of failed attempts, too: what moved or shone then did so all the same.
    all_actions = [action for attempt in record.attempts for action in attempt.actions]
    lights = LightReadback(rig)
    for number, unit in enumerate(units, start=1):
        if unit.name in completed:
            continue
        observer.unit(unit.name, number, len(units))
        writer = folder.attempt(unit.name, rig.clock.wall, metadata)
        attempts = [attempt.uid for attempt in record.attempts if attempt.unit == unit.name]
        seed = _seed(attempts[0] if attempts else writer.uid)
        recorder = _Recorder(
            rig.clock, writer, frames, spectra, actions, all_actions, observer, seed
        )
        session = Session(rig, recorder, observer, temperature, lights)
        try:
            with rig.clock.noticing_sleep():
                session.read_temperature()
                unit.run(session)
                session.read_temperature()
            recorder.note_clock_step()
        except UndoManualStep:
            recorder.take_back()
            raise
        writer.stop("success")
        frames, spectra = recorder.kept_frames, recorder.kept_spectra
        actions = recorder.kept_actions


def _seed(uid: str) -> int:
    """Return a seed of random numbers, which follows from the uid of a unit's first attempt."""
    return uuid.UUID(uid).int % 2**32


class _Recorder:
    """Recorder that converts the rig's times to wall times and writes to the attempt."""

    def __init__(
        self,
        clock: Clock,
        writer: AttemptWriter,
        frames: Sequence[FrameRecord],
        spectra: Sequence[SpectrumRecord],
        actions: Sequence[ActionRecord],
        all_actions: list[ActionRecord],
        observer: RunObserver,
        seed: int,
    ) -> None:
        self._clock = clock
        self._seed = seed
        self._writer = writer
        self._observer = observer
        self.kept_frames = list(frames)
        self.kept_spectra = list(spectra)
        self.kept_actions = list(actions)
        self._all_actions = all_actions

    def acted(
        self,
        device: str,
        action: str,
        start_s: float,
        end_s: float,
        late_s: float,
        task: str = "",
    ) -> None:
        wall, unit = self._clock.wall, self._writer.unit
        record = ActionRecord(unit, device, action, wall(start_s), wall(end_s), late_s, task)
        self._writer.action(record)
        _logger.info("%s: %s", device, action)
        self.kept_actions.append(record)
        self._all_actions.append(record)

    def temperature(self, celsius: float, at_s: float) -> None:
        self._writer.temperature(
            TemperatureRecord(self._writer.unit, self._clock.wall(at_s), celsius)
        )

    def last_manual_step(self) -> str | None:
        last = self._last_manual_step()
        return None if last is None else last.action

    def note_clock_step(self) -> None:
        """Record and tell that somebody stepped the PC's time of day, which `wall` ignores."""
        step_s, now_s = self._clock.step_s(), self._clock.now()
        if step_s:
            direction = "ahead" if step_s > 0 else "back"
            text = f"set {direction} by {duration_text(abs(step_s))}"
            self.acted(PC_CLOCK, text, now_s, now_s, 0.0)
            self._observer.warn(str(clock_stepped(text)))

    def take_back(self) -> None:
        """Record that the unit of the last manual step no longer counts, and abort this attempt."""
        last, now_s = self._last_manual_step(), self._clock.now()
        assert last is not None, "only what was done is taken back"
        self.acted(UNDONE, last.unit, now_s, now_s, 0.0)
        self._writer.stop("abort", f"taken back: '{last.action}'; {last.unit} is done again")

    def photographed(self, role: str, frame: Frame, late_s: float) -> None:
        record = self._writer.frame(
            frame.data,
            frame.suffix,
            role=role,
            exposure_s=frame.settings.exposure_s,
            iso=frame.settings.iso,
            f_number=frame.settings.f_number,
            start_time=self._clock.wall(frame.start_s),
            end_time=self._clock.wall(frame.end_s),
            late_s=late_s,
        )
        self.kept_frames.append(record)
        self._observer.frame(record)

    def spectrum(
        self, role: str, reading: SpectrometerReading, start_s: float, end_s: float, late_s: float
    ) -> None:
        record = self._writer.spectrum(
            reading.text().encode(),
            role=role,
            integration_s=reading.integration_s,
            repetitions=len(reading.raw_counts),
            start_time=self._clock.wall(start_s),
            end_time=self._clock.wall(end_s),
            late_s=late_s,
        )
        self.kept_spectra.append(record)

    def frames(self, role: str) -> Sequence[FrameRecord]:
        return [frame for frame in self.kept_frames if frame.role == role]

    def frame_times(self, role: str) -> Sequence[tuple[str, float]]:
        return [(frame.unit, frame.start_time) for frame in self.frames(role)]

    def spectra(self, role: str) -> Sequence[SpectrumRecord]:
        return [spectrum for spectrum in self.kept_spectra if spectrum.role == role]

    def actions(self, device: str) -> Sequence[ActionRecord]:
        return [action for action in self.kept_actions if action.device == device]

    def all_actions(self, device: str) -> Sequence[ActionRecord]:
        return [action for action in self._all_actions if action.device == device]

    def decide(self, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
        return on_bench()

    def seed(self) -> int:
        return self._seed

    def _last_manual_step(self) -> ActionRecord | None:
        return next((action for action in reversed(self.kept_actions) if action.is_manual), None)
