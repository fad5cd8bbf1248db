"""Execution of a protocol into a run folder, unit by unit, with recovery from lost devices."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import Any, Protocol, TypeVar

from labrig.acquire import (
    CAMERA,
    CHANGER,
    LIGHTS,
    SAMPLE_CHANGER,
    SPECTROMETER,
    Camera,
    CameraCapabilities,
    Checkable,
    Continuation,
    ExposureSettings,
    Plan,
    PlanClock,
    ProtocolModel,
    Rig,
    RigFile,
    RunObserver,
    Unit,
    lights_that_read_back,
    plan,
    run_units,
)
from labrig.bench.opening import Bench
from labrig.bench.run_clock import ClockedObserver
from labrig.bench.run_log import LoggedObserver
from labrig.bench_optics import calibration
from labrig.calibration import REFERENCE_KIND, ReferenceFile
from labrig.foundation.clock import Clock, Interrupted, Slept
from labrig.foundation.errors import (
    DataError,
    DeviceError,
    DeviceLostError,
    DiskError,
    LabrigError,
    ProtocolError,
    is_memory_shortage,
    memory_shortage,
)
from labrig.foundation.input_file import MAX_FRAME_BYTES, read_bytes
from labrig.foundation.quantity import duration_text
from labrig.foundation.signals import PAUSE_SIGNAL, interrupting, name_of, stop_here
from labrig.record import JOURNAL, ActionRecord, FrameRecord, RunFolder, RunRecord, damaged_frames
from labrig.reduce import read_exif, read_raw

ANEW = "calibrate the bench with this one (labrig run calibration), or use the other"


def require_calibrated_camera(rig: RigFile, devices: dict[str, str]) -> None:
    """Refuse another camera than that of the rig's calibration.

    Parameters
    ----------
    rig
        The rig file, with the calibrations that were found for it.
    devices
        Identities of the connected devices by their keys.

    Raises
    ------
    ProtocolError
        The camera is another one.
    """
    reference = calibration(rig, REFERENCE_KIND)
    camera = devices.get(CAMERA.key)
    if reference is not None and camera is not None and not reference.is_of(camera):
        raise ProtocolError(
            f"expected the calibrated camera, {reference.camera}, got {camera}; {ANEW}"
        )


class LensObserver(LoggedObserver):
    """Observer that compares the lens of the first frame with that of the rig's calibration.

    Parameters
    ----------
    observer
        Observer for the person at the terminal.
    rig
        The rig file, with the calibrations that were found for it.
    """

    def __init__(self, observer: RunObserver, rig: RigFile) -> None:
        super().__init__(observer)
        self._reference: ReferenceFile | None = calibration(rig, REFERENCE_KIND)
        self._only_warns = "lens" in rig.calibrations.only_warn

    def frame(self, record: FrameRecord) -> None:
        """Log that a frame was recorded; refuse the first one if it shows another lens.

        Raises
        ------
        ProtocolError
            The lens is another one.
        """
        super().frame(record)
        reference, self._reference = self._reference, None
        if reference is None or reference.lens is None:
            return
        lens = read_exif(read_bytes(record.path, MAX_FRAME_BYTES)).lens
        if lens is None or lens == reference.lens:
            return
        text = f"expected the calibrated lens, {reference.lens}, got {lens}"
        if not self._only_warns:
            raise ProtocolError(f"{text}; {ANEW}")
        self.warn(f"{text}: vignetting and place of the filter may be others")


#: Shutter time in seconds at most: the picture does not matter, only its size.
EXPOSURE_S = 1 / 60


def offers_with_frame_size(camera: Camera) -> CameraCapabilities:
    """Take a frame, which is not kept, and return the camera's offers with the size of its frames.

    Parameters
    ----------
    camera
        Open camera in its safe state.

    Returns
    -------
    CameraCapabilities
        Settings that the camera offers; `frame_pixels` is that of the frame.

    Raises
    ------
    ProtocolError
        The rig file gives another size of the frame.
    FrameError
        The frame cannot be read.
    """
    capabilities = camera.capabilities()
    camera.configure(
        ExposureSettings(
            capabilities.exposure_at_most(EXPOSURE_S),
            capabilities.isos[0],
            max(capabilities.f_numbers, default=None),
        )
    )
    camera.arm()
    raw = read_raw(camera.shoot().data, "a trial frame")
    frame_pixels = (raw.width, raw.height)
    if capabilities.frame_pixels is not None and capabilities.frame_pixels != frame_pixels:
        raise ProtocolError(
            f"the rig file expects frames of {list(capabilities.frame_pixels)} pixels, "
            "the camera's "
            f"have {list(frame_pixels)}; write frame_pixels: {list(frame_pixels)} "
            "under 'devices.camera'"
        )
    return replace(capabilities, frame_pixels=frame_pixels)


ErrorT = TypeVar("ErrorT", bound=BaseException)

#: Time to wait for a lost device: the user has to notice and walk to the bench.
COMES_BACK_S = 300.0
LOOK_PERIOD_S = 2.0
#: Number of lost devices in one unit at which the run ends.
MAX_LOSSES = 3
#: Difference from which a clock counts as set back; times are rounded, and kept exact by NTP.
CLOCK_STEP_S = 1.0
#: Largest number of files named in a warning.
MAX_NAMED = 4


class Watch(Protocol):
    """Factory of a run's observer, from the clock of the plan and that of the rig."""

    def __call__(self, plan_clock: PlanClock, clock: Clock) -> AbstractContextManager[RunObserver]:
        """Return the observer of one run."""


def execute(
    folder: RunFolder, protocol: ProtocolModel, bench: Bench, laid_out: Plan, watch: Watch
) -> None:
    """Record all units that `folder` lacks, with this PC kept awake.

    A unit that was cut off by a crash or a lost device, or in which the PC slept, is repeated.

    Raises
    ------
    Interrupted, LabrigError
        The run ended early, in the safe state; the text tells what is kept and how to continue.
    """
    bench = replace(bench, left_out=_not_used(protocol, bench, laid_out))
    interrupted_units = folder.close_open_attempts(
        bench.clock.wall, "abort", "labrig ended before this attempt did; closed at resume"
    )
    record = folder.read()
    done = record.completed()
    # More signals while the attempt is being closed must not cut that short.
    plan_clock = PlanClock(laid_out)
    with interrupting(bench.clock), watch(plan_clock, bench.clock) as watching:
        clocked = ClockedObserver(watching, plan_clock, bench.clock)
        observer = LensObserver(clocked, bench.file)
        for unit in interrupted_units:
            observer.warn(f"the unit {unit} was cut off and is done again")
        for oddity in [*_oddities(folder, record), *_changes(protocol, record)]:
            observer.warn(oddity)
        if record.last_time > bench.clock.wall() + CLOCK_STEP_S:
            observer.warn(
                "the clock of this PC was set back since the run began: times of day in its "
                "journal go back, durations are right"
            )
        units = protocol.units()
        if all(unit.name in done for unit in units):
            return
        metadata = {
            "protocol": protocol.protocol,
            "sample": protocol.sample.name,
            "labrig_version": version("labrig"),
            "guard": bench.guarded_by,
        }

        manual_actions = [
            action for attempt in record.attempts for action in attempt.actions if action.task
        ]

        def use(rig: Rig) -> None:
            _refuse_what_spoils(rig)
            offers = _offers(rig, protocol, folder, bench)

            def rest() -> tuple[Plan, RunRecord]:
                record, wall = folder.read(), bench.clock.wall
                goes_on = Continuation(record, wall(rig.connected_s), wall())
                return plan(protocol, bench.file, bench.source, offers, goes_on), record

            with _naming_own_files(folder):
                clocked.connected(rest)
            _place_sample(protocol.sample_in_place, rig, observer)
            devices = rig.identities()
            require_calibrated_camera(bench.file, devices)
            _arrange_again(manual_actions, rig, observer)
            _report_exchanged_camera(folder, devices, observer)
            rig_metadata = {"rig": rig.name, "devices": devices} | {
                f"{key}_reads_back": reads_back
                for key, reads_back in lights_that_read_back(rig).items()
            }
            run_units(units, rig, folder, observer, {**metadata, **rig_metadata})

        try:
            with bench.kept_awake(observer.warn):
                _Reconnecting(bench, folder, observer).run(use)
        except Interrupted as interruption:
            _close(folder, bench, "abort", f"signal {interruption.signum}")
            raise Interrupted(
                interruption.signum,
                f"stopped by {name_of(interruption.signum)}, safe state reached; "
                f"{_kept_summary(folder, units)}",
            ) from None
        except LabrigError as error:
            _close(folder, bench, "fail", str(error))
            error.args = (f"{error}; {_kept_summary(folder, units)}",)
            raise
        except (MemoryError, ImportError, OSError) as error:
            if not is_memory_shortage(error):
                raise
            shortage = memory_shortage(error)
            _close(folder, bench, "fail", str(shortage))
            shortage.args = (f"{shortage}; {_kept_summary(folder, units)}",)
            raise shortage from None


@dataclass
class _Reconnecting:
    """Connection to the devices, restored when a device was lost: unplugged, asleep, switched off.

    While a PC sleeps its devices have no connection, and often no power: they count as lost, too.
    """

    bench: Bench
    folder: RunFolder
    observer: RunObserver
    losses: Counter[str] = field(default_factory=Counter)

    def run(self, use: Callable[[Rig], None]) -> None:
        """Call `use` with all devices connected until it completes.

        Raises
        ------
        DeviceError
            A device was missing from the start, did not come back, or was lost too often; or the
            wait for it was interrupted.
        """
        lost: DeviceLostError | None = None
        back_by_s = 0.0
        while True:
            connected = False
            try:
                if lost is not None:
                    self.bench.clock.sleep(LOOK_PERIOD_S)
                with self.bench.devices() as rig:
                    connected = True
                    use(rig)
                return
            except Interrupted as interruption:
                if not (connected or lost is None or LIGHTS.isdisjoint(lost.unsafe)):
                    raise lost from None  # nobody knows whether the light is off
                if interruption.signum != PAUSE_SIGNAL:
                    raise
                self._pause()
            except (DeviceError, Slept) as error:
                if connected and (loss := _loss(error)):
                    lost, back_by_s = loss, self.bench.clock.now() + COMES_BACK_S
                    self._give_up_units(loss)
                elif connected or lost is None:
                    raise
                elif self.bench.clock.now() >= back_by_s:
                    raise lost from error

    def _pause(self) -> None:
        """Stop at Ctrl-Z in the safe state; open units are repeated."""
        units = self.folder.close_open_attempts(self.bench.clock.wall, "abort", "paused by Ctrl-Z")
        repeated = "".join(f"; the unit {unit} is done again" for unit in units)
        self.observer.warn(f"paused, safe state reached{repeated} when it goes on (fg)")
        stop_here()

    def _give_up_units(self, error: DeviceLostError) -> None:
        """Close the open units, so that they are repeated, up to `MAX_LOSSES` times."""
        units = self.folder.close_open_attempts(self.bench.clock.wall, "fail", str(error))
        self.losses.update(units or ["between units"])
        if max(self.losses.values()) >= MAX_LOSSES:
            raise error
        repeated = "".join(f"; the unit {unit} is done again" for unit in units)
        self.observer.warn(
            f"{error}; waiting up to {duration_text(COMES_BACK_S)} for all devices to "
            f"answer{repeated}"
        )


def _loss(error: DeviceError | Slept) -> DeviceLostError | None:
    """Return the loss to wait for, None if there is none or a stop was requested."""
    if _first_of_kind(error, Interrupted):
        return None
    sleep = _first_of_kind(error, Slept)
    reason = (
        sleep and f"this PC slept for {duration_text(sleep.slept_s)} (switch its energy saving off)"
    )
    if isinstance(error, Slept):
        return DeviceLostError(reason)
    if not isinstance(error, DeviceLostError):
        return None
    if reason:
        error.args = (f"{reason}; {error}",)
    return error


def _first_of_kind(error: BaseException | None, kind: type[ErrorT]) -> ErrorT | None:
    """Return `error` or its first predecessor on the way to the safe state of that kind."""
    while error is not None and not isinstance(error, kind):
        error = error.__context__
    return error


def _not_used(protocol: ProtocolModel, bench: Bench, laid_out: Plan) -> frozenset[str]:
    """Return the keys of devices that need not be opened: the plan is the same without them.

    Only a spectrometer may be missing, as it has no light and moves nothing: whatever else is on
    the bench has to be brought to its safe state.
    """
    key = SPECTROMETER.key
    if key not in bench.file.devices:
        return frozenset()
    others = {name: entry for name, entry in bench.file.devices.items() if name != key}
    try:
        without = plan(protocol, bench.file.model_copy(update={"devices": others}), bench.source)
    except ProtocolError:
        return frozenset()
    return frozenset({key}) if without.steps == laid_out.steps else frozenset()


def _place_sample(name: str | None, rig: Rig, observer: RunObserver) -> None:
    """Have the sample changer bring the run's sample, or all of its samples into the dark."""
    if SAMPLE_CHANGER not in rig or name is None:  # the safe state is that all are in the dark
        return
    changer = rig[SAMPLE_CHANGER]
    samples = changer.names()
    if name not in samples:
        observer.warn(
            f"the sample changer has no sample '{name}' (it has {', '.join(samples)}): all of them "
            "are in the dark during this run"
        )
    changer.put(name if name in samples else None)


def _refuse_what_spoils(rig: Rig) -> None:
    """Raise `ProtocolError` if a device's settings would invalidate the data."""
    spoilers = [
        f"{key}: {finding}"
        for key, device in rig.devices.items()
        if isinstance(device, Checkable)
        for finding in device.findings()
        if finding.severity == "refuse"
    ]
    if spoilers:
        raise ProtocolError("this would spoil the measurement: " + "; ".join(spoilers))


def _offers(
    rig: Rig, protocol: ProtocolModel, folder: RunFolder, bench: Bench
) -> CameraCapabilities | None:
    """Return what the connected camera offers; None without a camera.

    The plan before the run had to believe the rig file. A real camera takes a trial frame, which
    shows whether the regions are inside of it: not after half an hour of warming up.
    """
    if CAMERA not in rig:
        return None
    with _naming_own_files(folder):
        capabilities = rig[CAMERA].capabilities()
        is_certain = capabilities.frame_pixels is not None and bench.room is not None
        if protocol.named_regions() and not is_certain:
            capabilities = offers_with_frame_size(rig[CAMERA])
    return capabilities


@contextmanager
def _naming_own_files(folder: RunFolder) -> Iterator[None]:
    """Name the run's own protocol and rig file, and how edits of them are taken."""
    try:
        yield
    except ProtocolError as error:
        if folder.read().attempts:
            files = " and ".join(str(folder.path / name) for name in ("protocol.yaml", "rig.yaml"))
            error.args = (f"{error}; to go on otherwise, edit {files} and resume with --edited",)
        raise


def _arrange_again(manual_actions: Sequence[ActionRecord], rig: Rig, observer: RunObserver) -> None:
    """Restore what was put on the bench by hand before the interruption.

    A changer repeats all actions; otherwise the user is reminded of the last one.
    """
    if manual_actions and CHANGER in rig:
        for action in manual_actions:
            rig[CHANGER].do(action.task)
    elif manual_actions:
        observer.warn(
            f"the bench has to be as it was left; last done by hand: {manual_actions[-1].action} "
            f"({manual_actions[-1].unit})"
        )


def _report_exchanged_camera(
    folder: RunFolder, devices: dict[str, str], observer: RunObserver
) -> None:
    """Warn if a camera was exchanged: dark frames of one camera do not apply to another."""
    previous: dict[str, Any] = {}
    for attempt in folder.read().completed().values():
        previous |= attempt.start.get("devices", {})
    for key, identity in devices.items():
        if previous.get(key, identity) != identity:
            observer.warn(
                f"{key}: completed units of this run were made with {previous[key]}, now it is "
                f"{identity}; their frames do not belong together"
            )


def _oddities(folder: RunFolder, record: RunRecord) -> Iterator[str]:
    """Yield warnings about the journal of a resumed run, and frames that disagree with it."""
    if folder.was_torn:
        yield (
            f"{folder.path / JOURNAL}: its last line is incomplete, as a crash leaves it, and is "
            "not used"
        )
    if unknown := folder.unknown_files():
        yield (
            f"{folder.path / 'frames'}: the journal does not mention {_listed(unknown)}, which a "
            "crash or a failing disk left; they are kept, and nothing is made of them"
        )
    files = [file for attempt in record.completed().values() for file in attempt.files]
    damaged = damaged_frames(folder.path, files)
    if texts := [f"{frame.path.name} {damage}" for frame, damage in damaged.items()]:
        yield (
            f"{folder.path / 'frames'}: {_listed(texts)}; restore from a copy, or begin a new "
            "run: labrig process refuses them"
        )


def _changes(protocol: ProtocolModel, record: RunRecord) -> Iterator[str]:
    """Yield a warning of complete units that the protocol, as it was edited, no longer has."""
    units = {unit.name for unit in protocol.units()}
    if gone := [name for name in record.completed() if name not in units]:
        yield (
            f"protocol.yaml was edited: it no longer has the units {_listed(gone)}, which are "
            "complete"
        )


def _listed(names: Sequence[str]) -> str:
    n_more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {n_more} more" if n_more > 0 else "")


def _close(folder: RunFolder, bench: Bench, exit_status: str, reason: str) -> None:
    """Close the attempt; a full disk must not hide why the run ended."""
    try:
        folder.close_open_attempts(bench.clock.wall, exit_status, reason)
    except (DiskError, DataError):
        return


def _kept_summary(folder: RunFolder, units: Sequence[Unit]) -> str:
    record = folder.read()
    if not record.attempts:
        return "nothing was recorded"
    done, plural = len(record.completed()), " is" if len(units) == 1 else "s are"
    return (
        f"{done} of {len(units)} unit{plural} complete and kept; go on with: "
        f"labrig resume {folder.path}"
    )
