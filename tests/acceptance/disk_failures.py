"""An I/O error at every write, fsync, close, rename … of a run: what was acknowledged is kept.

    python -m tests.acceptance.disk_failures [--every 1] [--bytes 100] [--mounted 20]
        [--kind lost|done|dead|read-only|full] [--keep DIR]

A short decay is recorded, and processed, in a process whose disk fails at the n-th call that
changes something in the run folder; n goes from the first call to the last. `failing_disk.c` says
in which ways it fails; it is full after a random number of bytes, of which there are `--bytes`.
With `--mounted`, for root alone, disks of the system itself fail: a tmpfs that somebody else fills
but for a random number of pages, and an ext4 that turns read-only at a random write. Then the power
goes, and `labrig resume` (or, for a result, `labrig process`) is started on a sound disk. Wanted:
exit code 5 and one line, or 0 where the failure was of no account; then exit code 0, all units
complete, all that was acknowledged as it was, and no more than one unit done twice. Needs Linux and
a C compiler.
"""

import argparse
import ctypes
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from hashlib import sha256
from io import StringIO
from pathlib import Path
from typing import BinaryIO

import yaml

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.foundation.errors import LabrigError
from labrig.foundation.output_file import RealDisk
from labrig.record import read_run
from tests.forked import forked

KINDS = {"lost": 0, "done": 1, "dead": 2, "read-only": 3, "full": 4}
#: Disks of the system that fail, with `--mounted`.
MOUNTED = "tmpfs full", "ext4 read-only"
DISK_BYTES, PAGE_BYTES = 24_000_000, 4096
#: Frames and journal lines of the run, about.
WRITES = 80
PROTOCOL = {
    "protocol": "decay",
    "sample": {"name": "test"},
    "charge": "30 s",
    "for": "15 s",
    "exposure": "1/4 s",
    "repeats": 2,
}
#: Told once a frame is acknowledged.
_ACKNOWLEDGED = re.compile(r"frame \d+ of \d+: ")


@dataclass(frozen=True)
class Ended:
    """End of a process: exit code, messages, and its changes of the disk, by calls and bytes."""

    code: int
    lines: list[str]
    calls: int
    written_bytes: int

    @property
    def complaints(self) -> list[str]:
        """Return its messages beside its progress."""
        return [line for line in self.lines if not line.startswith("[")]

    @property
    def acknowledged(self) -> int:
        """Frames of which it said that they are kept."""
        return sum(bool(_ACKNOWLEDGED.search(line)) for line in self.lines)


@dataclass
class Tally:
    """All trials of one kind."""

    trials: int = 0
    codes: Counter[int] = field(default_factory=Counter)
    acknowledged: int = 0
    redone: int = 0
    wrong: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Bench:
    """A run, and its result on a sound disk."""

    protocol: Path
    rig: Path
    units: list[str]
    run: Path
    recording: Ended
    processing: Ended

    @classmethod
    def set_up(cls, folder: Path) -> "Bench":
        """Write the files, run them undisturbed."""
        folder.mkdir()
        protocol, rig = folder / "protocol.yaml", folder / "rig.yaml"
        protocol.write_text(yaml.safe_dump(PROTOCOL))
        content = yaml.safe_load((resources.folder("config") / "sim.yaml").read_text())
        content["simulation"] |= {
            "sensor": {"width": 96, "height": 64},
            "epoch": "2026-01-01T00:00:00Z",
            "initial": {"lamp": "off"},
        }
        rig.write_text(yaml.safe_dump(content))
        # Once here, so that all is imported: a forked process begins at once.
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            guarded(["run", str(protocol), "--rig", str(rig), "--runs", str(folder / "first")])
        runs = folder / "runs"
        recording = labrig(["run", protocol, "--rig", rig, "--runs", runs, "--no-process"], folder)
        (run,) = runs.iterdir()
        processing = labrig(["process", run], folder)
        if (recording.code, processing.code) != (0, 0):
            sys.exit(f"on a sound disk: {recording}, {processing}")
        units = list(read_run(run).completed())
        return cls(protocol, rig, units, run, recording, processing)


def record(bench: Bench, place: Path, kind: str, at: int, tally: Tally) -> None:
    """One run whose disk fails at one call or byte, resumed on a sound one."""
    place.mkdir(exist_ok=True)

    def require(right: bool, what: str) -> None:
        if not right:
            tally.wrong.append(f"{kind} at call {at} of a run: {what}")

    runs = place / "runs"
    command = ["run", bench.protocol, "--rig", bench.rig, "--runs", runs, "--no-process"]
    ended = labrig(command, place, kind, at)
    tally.trials += 1
    tally.codes[ended.code] += 1
    tally.acknowledged += ended.acknowledged
    _judge(ended, require)
    if kind in MOUNTED:
        _mend(place, kind)
    found = [path.parent for path in runs.glob("*/protocol.yaml")]
    kept = {}
    if found and (found[0] / "journal.jsonl").is_file():
        before = read_run(found[0])
        kept = {unit: attempt.uid for unit, attempt in before.completed().items()}
        require(_intact(found[0]) >= ended.acknowledged, "an acknowledged frame is lost")
    else:
        require(ended.acknowledged == 0, "acknowledged frames are lost with their run")
    again = labrig(["resume", found[0], "--no-process"] if found else command, place)
    require(again.code == 0, f"resume: exit code {again.code}, {again.complaints}")
    found = found or [path.parent for path in runs.glob("*/protocol.yaml")]
    record = read_run(found[0])
    now = {unit: attempt.uid for unit, attempt in record.completed().items()}
    require(list(now) == bench.units, f"completed {list(now)}")
    require(kept.items() <= now.items(), "a complete unit was not kept")
    require(_intact(found[0]) >= ended.acknowledged, "an acknowledged frame is lost at resume")
    redone = len(record.attempts) - len(now)
    require(redone <= 1, f"{redone} units were done twice")
    tally.redone += redone


def process(bench: Bench, place: Path, kind: str, at: int, tally: Tally) -> None:
    """A result worked out while the disk fails at one call, and again on a sound one."""
    place.mkdir()

    def require(right: bool, what: str) -> None:
        if not right:
            tally.wrong.append(f"{kind} at call {at} of a result: {what}")

    run = place / bench.run.name
    shutil.copytree(bench.run, run, ignore=shutil.ignore_patterns("result*"))
    ended = labrig(["process", run], place, kind, at)
    tally.trials += 1
    tally.codes[ended.code] += 1
    _judge(ended, require)
    again = labrig(["process", run], place)
    require(again.code == 0, f"again: exit code {again.code}, {again.complaints}")
    wanted = (bench.run / "result" / "fit.json").read_bytes()
    require((run / "result" / "fit.json").read_bytes() == wanted, "another result")
    require(_intact(run) == _intact(bench.run), "a frame is lost")


def _judge(ended: Ended, require: Callable[[bool, str], None]) -> None:
    said = ended.complaints
    require(ended.code in (0, 5), f"exit code {ended.code}, {said}")
    errors = [line for line in said if not line.startswith(("warning:", "note:"))]
    require(len(errors) == (ended.code != 0), f"exit code {ended.code}, {said}")


def _intact(run: Path) -> int:
    """Frames that the journal tells of, as it tells of them."""
    return sum(
        frame.path.is_file() and sha256(frame.path.read_bytes()).hexdigest() == frame.sha256
        for attempt in read_run(run).attempts
        for frame in attempt.frames
    )


def labrig(arguments: Sequence[object], place: Path, kind: str = "lost", at: int = 0) -> Ended:
    """`labrig ARGUMENTS` in a process whose disk fails below `place` at call `at`; 0: at none."""
    said, told = place.parent / "said.txt", place.parent / "calls.txt"

    def run() -> int:
        disk = ctypes.CDLL(None)
        disk.arm(str(place).encode(), ctypes.c_long(at if kind in KINDS else 0), KINDS.get(kind, 0))
        if kind in MOUNTED and at:
            _fail_at_write(place, kind, at)
        code = guarded([str(argument) for argument in arguments])
        told.write_text(f"{disk.cut_power()} {disk.written_bytes()}")
        return code

    _, status = os.waitpid(forked(run, said), 0)
    calls, written_bytes = map(int, told.read_text().split())
    lines = said.read_text().splitlines()
    return Ended(os.waitstatus_to_exitcode(status), lines, calls, written_bytes)


def _fail_at_write(place: Path, kind: str, at: int) -> None:
    """Have the mounted disk fail: full but for `at` bytes, or read-only at the `at`-th write."""
    whole, writes = RealDisk.write, 0

    def write(disk: RealDisk, file: BinaryIO, data: bytes) -> None:
        nonlocal writes
        writes += 1
        if kind == "tmpfs full" and writes == 1:
            left_bytes = shutil.disk_usage(place).free - at
            (place / "of somebody else").write_bytes(bytes(left_bytes))
        elif kind == "ext4 read-only" and writes == at:
            _mount("-o", "remount,abort", place)
        whole(disk, file, data)

    RealDisk.write = write  # type: ignore[method-assign, assignment]


@contextmanager
def _mounted(place: Path, kind: str) -> Iterator[None]:
    """Mount an empty disk of a kind at `place`."""
    place.mkdir()
    if kind == "tmpfs full":
        _mount("-t", "tmpfs", "-o", f"size={DISK_BYTES}", "none", place)
    else:
        image = place.with_suffix(".img")
        with image.open("wb") as file:
            file.truncate(DISK_BYTES)
        subprocess.run(["mkfs.ext4", "-q", image], check=True)
        _mount("-o", "loop,errors=remount-ro", image, place)
    try:
        yield
    finally:
        subprocess.run(["umount", place], check=True)


def _mend(place: Path, kind: str) -> None:
    """Make room, or have the file system checked and mounted again."""
    if kind == "tmpfs full":
        (place / "of somebody else").unlink(missing_ok=True)
        return
    image = place.with_suffix(".img")
    subprocess.run(["umount", place], check=True)
    subprocess.run(["e2fsck", "-fy", image], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _mount("-o", "loop,errors=remount-ro", image, place)


def _mount(*arguments: str | Path) -> None:
    subprocess.run(["mount", *arguments], check=True)


def campaign(
    folder: Path, kinds: Sequence[str], every: int, n_bytes: int, n_mounted: int
) -> dict[str, Tally]:
    """All trials; each in a folder of its own, which goes if all was well."""
    bench = Bench.set_up(folder / "bench")
    tallies: dict[str, Tally] = {}
    rng = random.Random("disk failures")
    for what, trial, peace in (
        ("run", record, bench.recording),
        ("result", process, bench.processing),
    ):
        for kind in kinds:
            tally = tallies[f"{what}, {kind}"] = Tally()
            moments = list(range(1, peace.calls + 1, every))
            if kind == "full":
                moments = sorted(rng.sample(range(1, peace.written_bytes), n_bytes))
            for at in moments:
                place, wrong = folder / f"{what}-{kind}-{at}", len(tally.wrong)
                try:
                    trial(bench, place, kind, at, tally)
                except (LabrigError, OSError) as error:
                    tally.wrong.append(f"{place.name}: {error!r}")
                if len(tally.wrong) == wrong:
                    shutil.rmtree(place)
    for kind in MOUNTED if n_mounted else ():
        tally = tallies[f"run, {kind}"] = Tally()
        for number in range(n_mounted):
            at = rng.randint(1, WRITES)
            if kind == "tmpfs full":
                at = rng.randint(PAGE_BYTES, bench.recording.written_bytes)
            place = folder / f"{kind} {number}".replace(" ", "-")
            with _mounted(place, kind):
                record(bench, place, kind, at, tally)
    return tallies


def main() -> None:
    """Print a table: what came of the failures, by what was done and how it failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="only every so manieth call")
    parser.add_argument("--bytes", type=int, default=20, help="full disks, of a run and a result")
    parser.add_argument("--mounted", type=int, default=0, help="disks of each kind; needs root")
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--keep", type=Path, help="where trials that went wrong stay")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        _preload(Path(scratch))
        place = asked.keep or Path(scratch)
        tallies = campaign(
            place.resolve(), asked.kind or list(KINDS), asked.every, asked.bytes, asked.mounted
        )
    print(
        f"{'failed':20}{'calls':>6}{'frames kept':>13}{'units redone':>14}{'wrong':>7}  exit codes"
    )
    for name, tally in tallies.items():
        codes = ", ".join(f"{code}: {count}" for code, count in sorted(tally.codes.items()))
        print(
            f"{name:20}{tally.trials:6}{tally.acknowledged:13}{tally.redone:14}"
            f"{len(tally.wrong):7}  {codes}"
        )
    wrong = [said for tally in tallies.values() for said in tally.wrong]
    print(f"{len(wrong)} went wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


def _preload(scratch: Path) -> None:
    """Compile the failing disk and begin anew behind it; nothing to do the second time."""
    if "LD_PRELOAD" in os.environ:
        return
    library = scratch / "failing_disk.so"
    source = Path(__file__).with_name("failing_disk.c")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    command = [sys.executable, "-m", "tests.acceptance.disk_failures", *sys.argv[1:]]
    code = subprocess.run(command, env={**os.environ, "LD_PRELOAD": str(library)}).returncode
    sys.exit(code)


if __name__ == "__main__":
    main()
