"""Waiting times of labrig; with another labrig's times in the same run, turn by turn.

    python -m tests.acceptance.quickness [--before PYTHON] [--rounds 3] [--rows NAME ...]

PYTHON is the interpreter of an environment with the other labrig, such as that of an older clone.
Printed are the least wall time and the least CPU time of all rounds, child processes included.
All but the row of 21-megapixel frames are held on one core where the system allows that.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

RUNS = 5000
PATCHES = 50
#: Frames of the short decay, those of darkness, metering and looks included.
FRAMES = 38

FIT = """
import sys, time, labrig
series = labrig.read_series(sys.argv[1])[0]
labrig.fit_series(series)
times_s = []
for _ in range(20):
    start_s = time.perf_counter()
    labrig.fit_series(series)
    times_s.append(time.perf_counter() - start_s)
print(min(times_s))
"""


@dataclass(frozen=True)
class Times:
    """Wall time and CPU time of a command."""

    wall_s: float
    cpu_s: float


@dataclass(frozen=True)
class Labrig:
    """One labrig to be measured, with a folder of its own for each row."""

    python: str
    folder: Path
    cores: frozenset[int]

    def timed(self, *arguments: object) -> Times:
        """Run a command of labrig in its folder."""
        return self._timed([self.python, "-m", "labrig", *map(str, arguments)])[0]

    def shipped(self, kind: str) -> Path:
        """Return the folder of its shipped files of a kind."""
        code = f"from labrig.foundation import resources; print(resources.folder({kind!r}))"
        return Path(self._timed([self.python, "-c", code])[1])

    def fit(self, series: Path) -> Times:
        """Fit a series again and again in one process; the least time."""
        _, printed = self._timed([self.python, "-c", FIT, str(series)])
        return Times(float(printed), float(printed))

    def _timed(self, command: list[str]) -> tuple[Times, str]:
        start_s, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        if self.cores and hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, self.cores)
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True)
        wall_s, after = time.perf_counter() - start_s, resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            sys.exit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stderr}")
        cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return Times(wall_s, cpu_s), done.stdout.strip()


Run = Callable[[Labrig], Times]


def nothing(labrig: Labrig) -> None:
    """Prepare nothing."""


@dataclass(frozen=True)
class Row:
    """Something that people wait for.

    Attributes
    ----------
    prepare
        Makes what `run` needs in the folder of a labrig, untimed; rows that have it in common go on
        in one folder.
    rounds
        Most rounds; what changes its own input can be done once only.
    """

    name: str
    run: Run
    prepare: Callable[[Labrig], object] = nothing
    rounds: int = 100
    one_core: bool = True


def record(labrig: Labrig, protocol: str, rig: str, protocol_changes: Mapping[str, object],
           simulation: Mapping[str, object]) -> None:  # fmt: skip
    """Record a run on a shipped rig with changes, in the folder `runs`, without processing it."""
    for kind, name, changes in (
        ("protocols", protocol, protocol_changes),
        ("config", rig, {}),
    ):
        content = yaml.safe_load(next(labrig.shipped(kind).rglob(f"{name}.yaml")).read_text())
        if kind == "config":
            # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
            content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
            content["simulation"] |= simulation
        path = labrig.folder / f"{kind}.yaml"
        path.write_text(yaml.safe_dump(content | changes))
    labrig.timed("run", "protocols.yaml", "--rig", "config.yaml", "--yes", "--no-process")


def record_phosphor(labrig: Labrig) -> None:
    """Record a whole phosphor."""
    record(labrig, "phosphor", "sim-phosphor", {}, {})


def record_many_patches(labrig: Labrig) -> None:
    """Record a decay of 50 patches."""
    patches = {
        f"patch {n}": [0.05 + 0.09 * (n % 10), 0.1 + 0.15 * (n // 10), 0.06, 0.1]
        for n in range(PATCHES)
    }
    record(labrig, "decay", "sim", {"patches": patches}, {})


def record_large_frames(labrig: Labrig) -> None:
    """Record a short decay with a sensor of 21 megapixels."""
    changes = {"for": "80 s", "charge": "5 min"}
    record(labrig, "decay", "sim", changes, {"sensor": {"width": 5616, "height": 3744}})


def make_many_runs(labrig: Labrig) -> None:
    """Make 5000 processed runs, without frames and pages, of one."""
    record(
        labrig,
        "decay",
        "sim",
        {"charge": "5 min", "for": "30 s"},
        {"sensor": {"width": 96, "height": 64}},
    )
    labrig.timed("process", "last")
    (made,) = (labrig.folder / "runs").iterdir()
    left_out = shutil.ignore_patterns("frames", "figures", "*.html", "*.nxs", "*.pdf")
    for n in range(1, RUNS):
        shutil.copytree(made, made.with_name(f"{made.name}-{n}"), ignore=left_out)


def process_last(labrig: Labrig) -> Times:
    """Process the run."""
    return labrig.timed("process", "last")


def make_series(labrig: Labrig) -> None:
    """Make the series of the shipped decay."""
    record(labrig, "decay", "sim", {}, {})
    labrig.timed("process", "last")


def fit_series(labrig: Labrig) -> Times:
    """Fit the series of the run."""
    (series,) = (labrig.folder / "runs").glob("*/result/series.csv")
    return labrig.fit(series)


def process_again(labrig: Labrig) -> Times:
    """Process the run with another number of states."""
    return labrig.timed("process", "last", "--states", 1)


ROWS = (
    Row("runs list, no run", lambda labrig: labrig.timed("runs", "list"),
        lambda labrig: (labrig.folder / "runs").mkdir()),
    Row(f"runs list, {RUNS} runs", lambda labrig: labrig.timed("runs", "list"), make_many_runs),
    Row("plan decay", lambda labrig: labrig.timed("plan", "decay", "--rig", "sim")),
    Row("run decay", lambda labrig: labrig.timed("run", "decay", "--rig", "sim")),
    Row("fit of a decay", fit_series, make_series),
    Row(f"process {PATCHES} patches", process_last, record_many_patches, rounds=1),
    Row(f"process {PATCHES} patches again", process_again, record_many_patches, rounds=1),
    Row(f"process {FRAMES} frames of 21 megapixels", process_last, record_large_frames,
        one_core=False, rounds=1),
    Row(f"process {FRAMES} frames of 21 megapixels again", process_again, record_large_frames,
        one_core=False, rounds=1),
    Row("process a phosphor", process_last, record_phosphor, rounds=1),
)  # fmt: skip


def main() -> None:
    """Print a line for each row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", metavar="PYTHON")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rows", nargs="*", default=[row.name for row in ROWS])
    asked = parser.parse_args()
    pythons = {"before": asked.before, "now": sys.executable}
    contenders = {name: python for name, python in pythons.items() if python}
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    print(f"{'wall (CPU) time':50}" + "".join(f"{name:>20}" for name in contenders))
    with tempfile.TemporaryDirectory() as scratch:
        folders: dict[object, Path] = {}
        for row in (row for row in ROWS if row.name in asked.rows):
            allowed = frozenset(sorted(cores)[-1:] if row.one_core else cores)
            if row.prepare not in folders:
                folders[row.prepare] = Path(scratch) / str(len(folders))
                for name, python in contenders.items():
                    (folders[row.prepare] / name).mkdir(parents=True)
                    row.prepare(Labrig(python, folders[row.prepare] / name, allowed))
            all_times: dict[str, list[Times]] = {name: [] for name in contenders}
            for _ in range(min(asked.rounds, row.rounds)):
                for name, python in contenders.items():
                    labrig = Labrig(python, folders[row.prepare] / name, allowed)
                    all_times[name].append(row.run(labrig))
            texts = (
                f"{_text(min(t.wall_s for t in times))} ({_text(min(t.cpu_s for t in times))})"
                for times in all_times.values()
            )
            print(f"{row.name:50}" + "".join(f"{text:>20}" for text in texts), flush=True)


def _text(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 0.1 else f"{1e3 * seconds:.1f} ms"


if __name__ == "__main__":
    main()
