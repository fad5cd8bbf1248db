"""Runs: preparing, recording and resuming a protocol on a bench in a run folder."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from labrig.acquire import Plan, ProtocolModel, RigFile, plan, read_protocol, read_rig_file
from labrig.bench import open_bench
from labrig.errors import DiskError, UsageError
from labrig.execution import Watch, execute
from labrig.optics import read_camera
from labrig.quantity import duration_text
from labrig.record import RunFolder, read_run
from labrig.run_log import run_log
from labrig.yaml_file import yaml_text

#: Free disk space required besides the frames: journal, results, report.
SPARE_BYTES = 200e6


@dataclass(frozen=True)
class Recording:
    """A protocol validated for its rig, before anything is opened."""

    protocol: ProtocolModel
    rig: RigFile
    rig_source: Path
    runs: Path
    plan: Plan

    @classmethod
    def prepare(cls, protocol_path: Path, rig_path: Path, runs: Path) -> Self:
        """Read both files, lay out the plan, and refuse what cannot work.

        Raises
        ------
        UsageError
            A file is malformed, or the plan cannot work on this rig.
        DiskError
            The disk has no room for the frames.
        """
        requested = read_protocol(protocol_path)
        rig = read_rig_file(rig_path)
        protocol = requested.suited_to(rig)
        if rig.optics.camera is not None:
            read_camera(rig.optics.camera)  # a misspelt name is found now, not after the run
        run_plan = plan(protocol, rig, str(rig_path))
        free_bytes = shutil.disk_usage(_existing_parent(runs)).free
        if run_plan.size_bytes + SPARE_BYTES > free_bytes:
            raise DiskError(
                f"{runs}: {run_plan.frames} frames need {run_plan.size_bytes / 1e9:.2f} GB, "
                f"{free_bytes / 1e9:.2f} GB are free; free some space or give another --runs"
            )
        return cls(protocol, rig, rig_path, runs, run_plan)

    def summary(self) -> str:
        """Return the number of units, the duration, the frames and the bytes in one line."""
        return (
            f"{len(self.plan.units)} units, at most {duration_text(self.plan.duration_s)} of lab "
            f"time, {self.plan.frames} frames, {self.plan.size_bytes / 1e6:.0f} MB"
        )

    def notes(self) -> tuple[str, ...]:
        """Return notes for the user before the run, one line each."""
        return tuple(
            f"what {self.protocol.protocol} finds rests on {name}, of which the rig file names no "
            "run ('optics:'); frames will be kept: measure it, too, and name it to labrig process "
            "--optics"
            for name in self.protocol.unmeasured(self.rig)
        )

    def record(self, watch: Watch) -> Path:
        """Create a run folder, record into it and return its path.

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
                },
                bench.seed,
                bench.disk,
            )
            try:
                with folder, run_log(folder.path, self.rig.name, bench.clock):
                    execute(folder, self.protocol, bench, self.plan, watch)
            except BaseException:
                if not folder.read().attempts:  # no device was reached, nothing happened
                    folder.discard()
                raise
        return folder.path


def resume_run(path: Path, watch: Watch) -> Path:
    """Complete the run in `path` and return the path.

    Raises
    ------
    UsageError
        The path is not a run folder.
    """
    if not (path / "protocol.yaml").is_file():
        raise UsageError(f"{path}: expected a run folder with protocol.yaml in it; see --runs")
    protocol = read_protocol(path / "protocol.yaml")
    rig = read_rig_file(path / "rig.yaml")
    last_time = read_run(path).last_time if (path / "journal.jsonl").exists() else 0.0
    run_plan = plan(protocol, rig, str(path / "rig.yaml"))
    with (
        open_bench(rig, str(path / "rig.yaml"), not_before_s=last_time) as bench,
        RunFolder(path, bench.seed, bench.disk) as folder,
        run_log(path, rig.name, bench.clock),
    ):
        execute(folder, protocol, bench, run_plan, watch)
    return path


def _existing_parent(path: Path) -> Path:
    path = path.absolute()
    while not path.exists():
        path = path.parent
    return path
