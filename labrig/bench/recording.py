"""Runs: preparing, recording and resuming a protocol on a bench in a run folder."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from labrig.acquire import (
    Adaptation,
    Plan,
    ProtocolModel,
    RigFile,
    plan,
    planned_rig,
    read_protocol,
    read_rig_file,
    read_run_protocol,
    read_run_rig,
)
from labrig.bench.execution import Watch, execute
from labrig.bench.found_calibrations import FoundCalibrations, find_calibrations
from labrig.bench.opening import open_bench, wall_at_start, with_frame_size
from labrig.bench.run_log import run_log
from labrig.bench_optics import require_optics
from labrig.calibration import REFERENCE_KIND
from labrig.foundation import resources
from labrig.foundation.errors import DiskError, MissingDeviceError, ProtocolError, UsageError
from labrig.foundation.plugins import bench_check
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import (
    CALIBRATIONS_FILE,
    JOURNAL,
    Begun,
    RunFolder,
    RunSize,
    lost_files,
    read_run,
    size_text,
)

#: Consequence of the lack of a curve, by its key under `optics:`.
_CURVES = {
    "lamp": (
        "the rig file names no spectrum of the lamp ('lamp' under 'optics:'): {parts} can only be "
        "recorded, and processed once it does"
    ),
    "grey_card": (
        "the rig file names no reflectance of the grey card ('grey_card' under 'optics:'): {parts} "
        "can only be recorded, and processed once it does"
    ),
    "filters": (
        "the rig file names no colour filters ('filters' under 'optics:', a folder with their "
        "curves): {parts} asks for the shipped ones, which are invented; name yours before the run"
    ),
}


def _unnoticed(folder: Path, size: RunSize) -> None:
    """Receive a run that begins, as somebody who has nothing to do then."""


@dataclass(frozen=True)
class Recording:
    """A protocol validated for its rig, before anything is opened."""

    protocol: ProtocolModel
    rig: RigFile
    rig_source: Path
    runs: Path
    plan: Plan
    found: FoundCalibrations
    adaptations: tuple[Adaptation, ...] = ()

    @classmethod
    def prepare(
        cls,
        protocol_path: Path,
        rig_path: Path,
        runs: Path,
        changes: Mapping[str, Any] = MappingProxyType({}),
    ) -> Self:
        """Read both files, lay out the plan, and refuse what cannot work.

        Parameters
        ----------
        protocol_path, rig_path
            Files of the protocol and of the rig.
        runs
            Folder for the run's folder.
        changes
            Values of the protocol's keys instead of those in its file, by dotted keys.

        Raises
        ------
        UsageError
            A file is malformed, or the plan cannot work on this rig.
        DiskError
            The disk has no room for frames and results.
        """
        requested = read_protocol(protocol_path, changes)
        rig = with_frame_size(read_rig_file(rig_path), str(rig_path))
        # What is malformed there is named with the file's path.
        planned = planned_rig(rig, str(rig_path))
        with _naming(protocol_path, rig_path):
            requested, adaptations = requested.adapted_to(
                planned, changes if _is_shipped(protocol_path) else None
            )
        # A kept file that is malformed does not stop a run that measures it anew.
        found = (
            find_calibrations(
                rig,
                (runs, rig_path.parent),
                wall_at_start(rig, str(rig_path)),
                measured=requested.protocol,
            )
            if requested.uses_calibrations
            else FoundCalibrations(rig, {}, ())
        )
        found = found.without_apertures(requested.apertures())
        protocol = requested.resolved_for(found.rig)
        try:
            require_optics(found.rig)
        except UsageError as error:
            error.args = (f"{rig_path}, optics: {error}",)
            raise
        run_plan = _planned(protocol, protocol_path, found.rig, rig_path)
        _require_free_disk(runs, run_plan.size())
        return cls(protocol, found.rig, rig_path, runs, run_plan, found, tuple(adaptations))

    def notes(self) -> tuple[str, ...]:
        """Return notes for the user before the run, one line each."""
        unmeasured = (
            f"the result of {self.protocol.protocol} needs {name}, and the rig file names no run "
            "of "
            "it under 'optics:'; the frames are kept: measure it later, and name it to labrig "
            "process --optics"
            for name in self.protocol.unmeasured(self.rig)
        )
        check = bench_check()
        unchecked = (
            "nothing in this run compares the bench with that calibration: labrig run "
            f"{check} does",
        )
        reference = self.found.kept.get(REFERENCE_KIND.name)
        has_picture = reference is not None and reference.reference.picture is not None
        is_unchecked = has_picture and not any(
            check in (unit.rpartition("/")[0], self.protocol.protocol) for unit in self.plan.units
        )
        uncurved = (
            _CURVES[key].format(parts=", ".join(parts))
            for key, parts in self.protocol.unnamed_curves(self.rig).items()
        )
        return (
            *(f"adapted to this rig: {each}" for each in self.adaptations),
            *self.found.notes,
            *(unchecked if is_unchecked else ()),
            *unmeasured,
            *uncurved,
            *self.protocol.notes(self.rig),
        )

    def record(self, watch: Watch, begun: Begun = _unnoticed) -> Path:
        """Create a run folder, record into it and return its path.

        Parameters
        ----------
        watch
            Observer of the run.
        begun
            Called before anything happens with the run folder and the size of what is to come.

        Raises
        ------
        Interrupted, LabrigError
            The run ended early, in the safe state; the text tells what is kept and how to continue.
        """
        with open_bench(self.rig, str(self.rig_source)) as bench:
            folder = RunFolder.create(
                self.runs,
                f"{self.protocol.protocol}_{self.protocol.sample.name}",
                bench.clock.wall(),
                {
                    "protocol.yaml": yaml_text(
                        self.protocol.model_dump(mode="json", by_alias=True)
                    ),
                    "rig.yaml": yaml_text(self.rig.model_dump(mode="json", exclude_none=True)),
                    **self._found_text(bench.clock.wall()),
                },
                bench.seed,
                bench.disk,
            )
            try:
                begun(folder.path, self.plan.size())
                with folder, run_log(folder.path, self.rig.name, bench.clock):
                    execute(folder, self.protocol, bench, self.plan, watch)
            except BaseException:
                if not folder.read().attempts:  # no device was reached, nothing happened
                    folder.discard()
                raise
        return folder.path

    def _found_text(self, now_s: float) -> dict[str, str]:
        """Return the record of the calibrations that were found, as a file of the run."""
        record = self.found.record(now_s)
        return {CALIBRATIONS_FILE: yaml_text(record)} if record else {}


def _refuse(question: str) -> bool:
    """Answer as somebody who is not there."""
    return False


def resume_run(
    path: Path,
    watch: Watch,
    confirm: Callable[[str], bool] = _refuse,
    *,
    edited: bool = False,
    begun: Begun = _unnoticed,
) -> Path:
    """Complete a run: units that were not finished are done, again if need be.

    Parameters
    ----------
    path
        The run's folder.
    watch
        What is told of steps and devices, and asked for what is done by hand.
    confirm
        Function that answers whether to record again what the journal has lost.
    edited
        Whether protocol and rig are taken as their files were edited since, and written into the
        journal; else they are those of the journal.
    begun
        Called before anything happens with the run folder and the size of what is missing.

    Returns
    -------
    Path
        The run's folder.

    Raises
    ------
    UsageError
        The path is not a run folder, or lines of its journal were lost and nobody confirmed to
        record again what they were about.
    DiskError
        The disk has no room for the frames and results that are missing.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.bench import resume_run
    >>> resume_run(Path("somewhere"), watch=None)
    Traceback (most recent call last):
    labrig.foundation.errors.UsageError: somewhere: expected a run folder ...
    """
    protocol = read_run_protocol(path, edited=edited)
    rig = read_run_rig(path, edited=edited)
    last_time, done = 0.0, frozenset[str]()
    if (path / "journal.jsonl").exists():
        record = read_run(path)
        last_time, done = record.last_time, frozenset(record.completed())
    run_plan = _planned(protocol, path / "protocol.yaml", rig, path / "rig.yaml")
    size = run_plan.size(done)
    _require_free_disk(path, size)
    with (
        open_bench(rig, str(path / "rig.yaml"), not_before_s=last_time) as bench,
        RunFolder(path, bench.seed, bench.disk) as folder,
        run_log(path, rig.name, bench.clock),
    ):
        _confirm_losses(folder, confirm)
        if edited:
            folder.take_edits()
        begun(path, size)
        execute(folder, protocol, bench, run_plan, watch)
    return path


def _confirm_losses(folder: RunFolder, confirm: Callable[[str], bool]) -> None:
    """Ask whether to record again what was recorded, but has lost its lines in the journal.

    Raises
    ------
    UsageError
        Nobody confirmed it.
    """
    if not (lost := lost_files(folder.path, folder.read().attempts)):
        return
    done = list(folder.read().completed())
    kept = (
        f"{len(done)} complete units are left in it, the last is {done[-1]}"
        if done
        else ("no complete unit is left in it")
    )
    loss = (
        f"{folder.path / JOURNAL}: its end was lost: {len(lost)} frames have no line in it, "
        f"{lost[0]} to {lost[-1]}; {kept}"
    )
    if not confirm(f"{loss}; go on and record the rest again?"):
        raise UsageError(
            f"{loss}; restore the journal from a copy, or record the rest again: labrig resume "
            f"{folder.path} --yes"
        )


def _planned(protocol: ProtocolModel, path: Path, rig: RigFile, rig_path: Path) -> Plan:
    """Lay out the plan; what in the protocol makes it impossible is named with the file's path."""
    with _naming(path, rig_path):
        return plan(protocol, rig, str(rig_path))


@contextmanager
def _naming(path: Path, rig_path: Path) -> Iterator[None]:
    """Name the file in a refusal; of a shipped protocol or rig how to get another one."""
    try:
        yield
    except ProtocolError as error:
        if isinstance(error, MissingDeviceError):
            is_shipped = rig_path in resources.names("config").values()
            where = f"a rig file of your own, or plan on {_shipped_rigs_with(error.key)}"
            error.args = (f"{error} of {where if is_shipped else rig_path}",)
        elif _is_shipped(path):
            error.args = (
                f"{path.stem}: {error}; keys of a shipped protocol are changed in a copy: "
                f"labrig protocol new {path.stem}",
            )
        elif str(rig_path) not in str(error):
            error.args = (f"{path}: {error}",)
        raise


def _shipped_rigs_with(key: str) -> str:
    """Return the names of the shipped rigs that have a device."""
    rigs = resources.names("config")
    return " or ".join(name for name in rigs if key in read_yaml(rigs[name])["devices"])


def _is_shipped(path: Path) -> bool:
    return path in resources.names(resources.PROTOCOLS).values()


def _require_free_disk(folder: Path, size: RunSize) -> None:
    """Refuse a run for which the disk is too small.

    Raises
    ------
    DiskError
        The disk has no room for frames and results.
    """
    free_bytes = free_disk_bytes(folder)
    if size.total_bytes > free_bytes:
        raise DiskError(
            f"{folder}: {size.frames} frames and their results need about "
            f"{size_text(size.total_bytes)}, {size_text(free_bytes)} are free; free some space or "
            "give another --runs"
        )


def free_disk_bytes(folder: Path) -> int:
    """Return the free space of a disk.

    Parameters
    ----------
    folder
        A folder on the disk, which need not exist yet.

    Returns
    -------
    int
        Free space in bytes.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.bench import free_disk_bytes
    >>> free_disk_bytes(Path("runs")) > 0
    True
    """
    return shutil.disk_usage(_existing_parent(folder)).free


def _existing_parent(path: Path) -> Path:
    path = path.absolute()
    while not path.exists():
        path = path.parent
    return path
