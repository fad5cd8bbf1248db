"""A protocol on a bench, into a run folder: prepared, recorded, resumed."""

import shutil
import signal
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Protocol, Self

from labrig.acquire import (
    Checkable,
    Plan,
    ProtocolModel,
    Rig,
    RigFile,
    RunObserver,
    plan,
    plugins,
    read_rig_file,
    run_units,
)
from labrig.bench import Bench, open_bench
from labrig.clock import Clock, Interrupted
from labrig.errors import DataError, DiskError, LabrigError, ProtocolError, UsageError
from labrig.optics import read_camera
from labrig.quantity import duration_text
from labrig.record import RunFolder, read_run
from labrig.signals import interrupting
from labrig.yaml_file import yaml_text

#: Room left on the disk beyond what the frames need: journal, results, report.
SPARE_BYTES = 200e6


class Watch(Protocol):
    """Tells a person what is going on: given the plan, the units already complete, the clock."""

    def __call__(
        self, plan: Plan, done: Sequence[str], clock: Clock
    ) -> AbstractContextManager[RunObserver]:
        """The observer of one run."""


@dataclass(frozen=True)
class Recording:
    """A protocol that fits its rig, before anything is opened."""

    protocol: ProtocolModel
    rig: RigFile
    rig_source: Path
    runs: Path
    plan: Plan

    @classmethod
    def prepare(cls, protocol_path: Path, rig_path: Path, runs: Path) -> Self:
        """Read both files, lay out the plan, refuse what cannot work.

        Raises
        ------
        UsageError
            A file is malformed, or the plan cannot work on this rig.
        DiskError
            The frames will not fit.
        """
        protocol = plugins.read_protocol(protocol_path)
        rig = read_rig_file(rig_path)
        if rig.optics.camera is not None:
            read_camera(rig.optics.camera)  # a misspelt name is found now, not after the run
        laid_out = plan(protocol, rig, str(rig_path))
        free_bytes = shutil.disk_usage(_existing(runs)).free
        if laid_out.size_bytes + SPARE_BYTES > free_bytes:
            raise DiskError(
                f"{runs}: {laid_out.frames} frames need {laid_out.size_bytes / 1e9:.2f} GB, "
                f"{free_bytes / 1e9:.2f} GB are free; free some space or give another --runs"
            )
        return cls(protocol, rig, rig_path, runs, laid_out)

    def summary(self) -> str:
        """Duration, frames and bytes in one line."""
        return (
            f"{len(self.plan.units)} units, at most {duration_text(self.plan.duration_s)} of lab "
            f"time, {self.plan.frames} frames, {self.plan.size_bytes / 1e6:.0f} MB"
        )

    def record(self, watch: Watch) -> Path:
        """Make a run folder and fill it; returns its path.

        Raises
        ------
        Interrupted, LabrigError
            After the safe state was reached; the text says what is kept and how to go on.
        """
        with open_bench(self.rig, str(self.rig_source)) as stand:
            folder = RunFolder.create(
                self.runs,
                f"{self.protocol.protocol}_{self.protocol.sample.name}",
                stand.clock.wall(),
                {
                    "protocol.yaml": yaml_text(
                        self.protocol.model_dump(mode="json", by_alias=True)
                    ),
                    "rig.yaml": yaml_text(self.rig.model_dump(mode="json", exclude_none=True)),
                },
                stand.seed,
            )
            try:
                with folder:
                    fill(folder, self.protocol, stand, self.plan, watch)
            except BaseException:
                if not read_run(folder.path).attempts:
                    shutil.rmtree(folder.path)  # no device was reached, nothing happened
                raise
        return folder.path


def resume_run(path: Path, watch: Watch) -> Path:
    """Do what is left of the run in `path`; returns the path.

    Raises
    ------
    UsageError
        Not a run folder.
    """
    if not (path / "protocol.yaml").is_file():
        raise UsageError(f"{path}: expected a run folder with protocol.yaml in it; see --runs")
    protocol = plugins.read_protocol(path / "protocol.yaml")
    rig = read_rig_file(path / "rig.yaml")
    last_time = read_run(path).last_time if (path / "journal.jsonl").exists() else 0.0
    laid_out = plan(protocol, rig, str(path / "rig.yaml"))
    with (
        open_bench(rig, str(path / "rig.yaml"), not_before_s=last_time) as stand,
        RunFolder(path, stand.seed) as folder,
    ):
        fill(folder, protocol, stand, laid_out, watch)
    return path


def fill(
    folder: RunFolder, protocol: ProtocolModel, stand: Bench, laid_out: Plan, watch: Watch
) -> None:
    """Do all units that `folder` lacks; a unit cut off by a crash is done again.

    Raises
    ------
    Interrupted, LabrigError
        After the safe state was reached; the text says what is kept and how to go on.
    """
    dead = folder.close_open_attempts(
        stand.clock.wall, "abort", "labrig ended before this attempt did; closed at resume"
    )
    done = folder.read().completed()
    # More signals while the attempt is being closed must not cut that short.
    with interrupting(stand.clock), watch(laid_out, list(done), stand.clock) as observer:
        for unit in dead:
            observer.warn(f"the unit {unit} was cut off and is done again")
        units = protocol.units()
        if all(unit.name in done for unit in units):
            return
        try:
            with stand.devices() as rig:
                _refuse_what_spoils(rig)
                metadata = {
                    "protocol": protocol.protocol,
                    "sample": protocol.sample.name,
                    "rig": rig.name,
                    "devices": rig.identities(),
                    "labrig_version": version("labrig"),
                }
                run_units(units, rig, folder, observer, metadata)
        except Interrupted as stop:
            _close(folder, stand, "abort", f"signal {stop.signum}")
            name = signal.Signals(stop.signum).name
            raise Interrupted(
                stop.signum, f"stopped by {name}, safe state reached; {_kept(folder, units)}"
            ) from None
        except LabrigError as error:
            _close(folder, stand, "fail", str(error))
            raise type(error)(f"{error}; {_kept(folder, units)}") from error


def _refuse_what_spoils(rig: Rig) -> None:
    """Raise `ProtocolError` if a device is set so that its data could not be trusted."""
    spoilers = [
        f"{key}: {finding}"
        for key, device in rig.devices.items()
        if isinstance(device, Checkable)
        for finding in device.findings()
        if finding.severity == "refuse"
    ]
    if spoilers:
        raise ProtocolError("this would spoil the measurement: " + "; ".join(spoilers))


def _close(folder: RunFolder, stand: Bench, exit_status: str, reason: str) -> None:
    """Close the attempt; a full disk must not hide why the run ended."""
    try:
        folder.close_open_attempts(stand.clock.wall, exit_status, reason)
    except (DiskError, DataError):
        return


def _kept(folder: RunFolder, units: Sequence[object]) -> str:
    record = folder.read()
    if not record.attempts:
        return "nothing was recorded"
    done = len(record.completed())
    return (
        f"{done} of {len(units)} units are complete and kept; go on with: "
        f"labrig resume {folder.path}"
    )


def _existing(path: Path) -> Path:
    path = path.absolute()
    while not path.exists():
        path = path.parent
    return path
