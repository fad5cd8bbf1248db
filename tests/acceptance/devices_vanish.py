"""A cable that is pulled in each unit of every protocol: safe state, exit code, one line, resumed.

    python -m tests.acceptance.devices_vanish [PROTOCOL ...] [--seed 1] [--every 1] [--keep DIR]

Each protocol, shortened, is recorded once undisturbed, which says when its units begin and end.
Then, for each unit and each device that it may use, the device's cable is pulled at a random moment
of the unit: for good, or for half a minute. Wanted: exit code 3 and one line, or 0 where the cable
came back or nothing needed the device; no light that burns without a line that says so; after a
resume on a sound bench all units are complete, those kept that were, and all frames as recorded.
"""

import argparse
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import RunRecord, read_run
from tests.acceptance.labrig_process import Ended, forked_labrig
from tests.acceptance.short_protocols import KNOWN, SHORTER, Case, with_what_they_need

#: Faults of the USB devices; a board's names the board.
USB = {"camera": "camera_unplugged", "spectrometer": "spectrometer_unplugged"}
BACK_AFTER = "30 s"
#: Messages that a light may burn, or that nobody can say whether it does.
BY_HAND = ("switch off by hand", "pull its plug", "cannot open the serial port")


@dataclass
class Tally:
    """All trials of one protocol."""

    units: int = 0
    codes: Counter[int] = field(default_factory=Counter)
    redone: int = 0
    lit: int = 0
    wrong: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Undisturbed:
    """The run in which nothing vanished, and what is on its bench."""

    record: RunRecord
    devices: tuple[str, ...]
    epoch_s: float

    @classmethod
    def of(cls, case: Case) -> "Undisturbed":
        """Record it."""
        ended = forked_labrig(case.folder, _run(case, case.folder))
        if ended.code:
            sys.exit(f"{case.protocol}: {ended.complaints}")
        (folder,) = (case.folder / "runs").iterdir()
        rig = read_yaml(case.rig)
        devices = {name for device in rig["devices"].values() for name in _addresses(device)}
        record = read_run(folder)
        begins = min(attempt.start["time"] for attempt in record.attempts)
        epoch_s = datetime.fromisoformat(rig["simulation"]["epoch"]).timestamp()
        assert epoch_s <= begins
        return cls(record, tuple(sorted(devices)), epoch_s)

    def moments(self, rng: random.Random) -> Iterator[tuple[str, float]]:
        """Return each unit and a random moment in it, in seconds after the epoch."""
        starts = [attempt.start["time"] for attempt in self.record.attempts]
        ends = [*starts[1:], self.record.last_time]
        for attempt, start, end in zip(self.record.attempts, starts, ends, strict=True):
            yield attempt.unit, rng.uniform(start, end) - self.epoch_s


def _addresses(device: Any) -> Iterator[str]:
    """Return the names of the simulated devices at all addresses below a key of the rig file."""
    if isinstance(device, dict):
        for value in device.values():
            yield from _addresses(value)
    elif isinstance(device, str) and device.startswith("sim://"):
        yield device.rpartition("/")[2]


def trial(
    case: Case, peace: Undisturbed, folder: Path, fault: dict[str, Any], tally: Tally
) -> None:
    """One run with a fault, resumed without; what is wrong goes into the tally."""
    folder.mkdir()

    def require(right: bool, what: str) -> None:
        if not right:
            tally.wrong.append(f"{folder.name} {fault}: {what}")

    rig = read_yaml(case.rig)
    rig["simulation"]["faults"] = [fault]
    (folder / "rig.yaml").write_text(yaml_text(rig), encoding="utf-8")
    faulty = Case(folder, case.protocol, folder / "rig.yaml")
    ended = forked_labrig(folder, _run(faulty, folder))
    tally.codes[ended.code] += 1
    _judge(ended, tally, require)
    runs = list((folder / "runs").iterdir()) if (folder / "runs").exists() else []
    kept = {}
    if runs:
        (run,) = runs
        kept = {unit: one.uid for unit, one in read_run(run).completed().items()}
        rig["simulation"] |= {"faults": []}
        lamp = "on" if ended.bench.get("lamp_on") else "off"
        rig["simulation"]["initial"] = rig["simulation"].get("initial", {}) | {"lamp": lamp}
        (run / "rig.yaml").write_text(yaml_text(rig), encoding="utf-8")
        again = forked_labrig(folder, ["resume", run, "--yes", "--no-process", "--edited"])
    else:
        again = forked_labrig(folder, _run(case, folder))
        (run,) = (folder / "runs").iterdir()
    require(again.code == 0, f"resume: exit code {again.code}, {again.complaints}")
    require(not again.bench.get("lamp_on") and not again.bench.get("leds_lit"), "a light burns")
    record = read_run(run)
    now = {unit: one.uid for unit, one in record.completed().items()}
    require(kept.items() <= now.items(), "a complete unit was not kept")
    require(set(now) == set(peace.record.completed()), f"completed {list(now)}")
    require(
        all(frame.path.is_file() for one in record.attempts for frame in one.files),
        "an acknowledged frame is lost",
    )
    tally.redone += len(record.attempts) - len(now)


def _judge(ended: Ended, tally: Tally, require: Any) -> None:
    said = " ".join(ended.complaints)
    require(ended.code in (0, 3), f"exit code {ended.code}, {said}")
    require(len(ended.complaints) == (ended.code != 0), f"exit code {ended.code}, {said}")
    require("Traceback" not in said and "fault in labrig" not in said, said)
    if ended.bench.get("lamp_on") or ended.bench.get("leds_lit"):
        tally.lit += 1
        require(any(text in said for text in BY_HAND), f"a light burns: {said}")


def _run(case: Case, folder: Path) -> list[object]:
    return [
        *("run", case.protocol, "--rig", case.rig, "--runs", folder / "runs"),
        *("--yes", "--no-process"),
    ]


def _fault(rng: random.Random, device: str, at_s: float) -> dict[str, Any]:
    when: dict[str, Any] = {"at": f"{at_s:.4f} s"}
    if rng.random() < 0.5:
        when["for"] = BACK_AFTER
    if device in USB:
        return {USB[device]: when}
    return {"board_unplugged": {"board": device, **when}}


def main() -> None:
    """Print a line for each protocol."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", default=list(SHORTER))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=int, default=1, help="only every so manieth trial")
    parser.add_argument("--keep", type=Path, help="where trials that went wrong stay")
    asked = parser.parse_args()
    print(
        f"{'protocol':28}{'units':>6}{'devices':>9}{'trials':>8}{'redone':>8}{'lit, told':>11}"
        f"{'wrong':>7}  exit codes"
    )
    wrong: list[str] = []
    done: dict[str, Path] = {}
    number = trials = 0
    with tempfile.TemporaryDirectory() as scratch:
        place = asked.keep or Path(scratch)
        place.mkdir(exist_ok=True)
        for name in with_what_they_need(asked.protocols):
            case = Case.write(place / name, name, done)
            peace, tally = Undisturbed.of(case), Tally()
            done[name] = peace.record.folder
            if name in KNOWN.values():
                forked_labrig(case.folder, ["process", peace.record.folder])
            if name not in asked.protocols:
                continue
            rng = random.Random(f"{asked.seed} {name}")
            for unit, at_s in peace.moments(rng):
                tally.units += 1
                for device in peace.devices:
                    fault, number = _fault(rng, device, at_s), number + 1
                    if number % asked.every:
                        continue
                    folder = case.folder / f"{tally.codes.total()}-{device}"
                    failures = len(tally.wrong)
                    trial(case, peace, folder, fault, tally)
                    tally.wrong[failures:] = [
                        f"{name} {unit} {each}" for each in tally.wrong[failures:]
                    ]
                    if len(tally.wrong) == failures:
                        shutil.rmtree(folder)
            codes = ", ".join(f"{code}: {count}" for code, count in sorted(tally.codes.items()))
            print(
                f"{name:28}{tally.units:6}{len(peace.devices):9}{tally.codes.total():8}"
                f"{tally.redone:8}{tally.lit:11}{len(tally.wrong):7}  {codes}",
                flush=True,
            )
            wrong += tally.wrong
            trials += tally.codes.total()
    print(f"{len(wrong)} of {trials} went wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
