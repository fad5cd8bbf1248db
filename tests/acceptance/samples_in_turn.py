"""Several phosphors on a sample changer, one resting in the dark while another is measured.

    python -m tests.acceptance.samples_in_turn [MATERIAL ...] [--seed 1] [--keep DIR]

First the longest lab times that `labrig plan` gives for the samples in turn and one after the
other, with the rests of the shipped chain and with those of the protocol `excitation` by itself,
after which nothing of a charge is left. Then the simulated bench is calibrated once, and all
samples are measured in one run with the shipped chain: a line for each, as of
`tests.acceptance.whole_phosphor`, and the root mean squares over all of them.
"""

import argparse
import shutil
import sys
import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml

from labrig.acquire import plan, read_protocol, read_rig_file
from labrig.bench.found_calibrations import find_calibrations
from labrig.foundation import resources
from labrig.foundation.quantity import duration_text
from labrig.material import read_material
from labrig.record import read_run
from tests.acceptance.reused_calibration import labrig
from tests.acceptance.whole_phosphor import PAINTS, Errors, errors, summary

#: Rests of the shipped chain, and those after which hardly anything is left of a charge.
RESTS: dict[str, dict[str, str]] = {
    "rests of the chain": {},
    "long rests": {"below": "2 %", "at_least": "1 min", "at_most": "15 min"},
}


def rig_file(folder: Path, materials: Sequence[str], seed: int, width: int) -> Path:
    """The shipped rig with a changer that has these samples."""
    rig = yaml.safe_load((resources.folder("config") / "sim-samples.yaml").read_text())
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    rig["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig["simulation"] |= {"seed": seed, "sensor": {"width": width, "height": 64}}
    pulses = {name: f"{1100 + 100 * number} us" for number, name in enumerate(materials)}
    rig["devices"]["sample_changer"]["samples"] = pulses
    rig["simulation"]["sample_changer"]["places"] = [
        {"pulse": pulse, "sample": [{"material": name, "region": [0.03, 0.1, 0.94, 0.8]}]}
        for name, pulse in pulses.items()
    ]
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


def protocol_file(folder: Path, materials: Sequence[str], **keys: Any) -> Path:
    """The shipped chain for these samples; `rest` are keys of the excitation's rests."""
    content = yaml.safe_load(resources.find("protocols", "protocol", "phosphor").read_text())
    del content["sample"]
    rest = keys.pop("rest", {})
    for part in content["parts"]:
        if part["protocol"] == "excitation":
            part["rest"] = part["rest"] | rest
    path = folder / "phosphor.yaml"
    path.write_text(yaml.safe_dump(content | {"samples": list(materials)} | keys))
    return path


def planned(folder: Path, rig: Path, materials: Sequence[str], rest: dict[str, str]) -> str:
    """Return the longest lab time in turn and one after the other."""
    found = find_calibrations(read_rig_file(rig), [folder / "runs"], 0.0).rig
    times = []
    for rests in ("shared", "apart"):
        protocol = read_protocol(protocol_file(folder, materials, rest=rest, rests=rests))
        times.append(duration_text(plan(protocol, found, str(rig)).duration_s))
    return f"in turn at most {times[0]}, one after the other {times[1]}"


def brightness(run: Path, sample: str) -> float:
    """Return the brightness of the room's lamp in a sample's last charge of the excitation.

    It loses 0.2 % an hour of the room's clock.
    """
    part = read_run(run).part(f"{sample}/excitation")
    off_s = max(
        action.start_time
        for attempt in part.attempts
        for action in attempt.actions
        if action.device == "lamp" and action.action == "off"
    )
    return 1 - 0.002 * (off_s - datetime(2026, 1, 1, tzinfo=UTC).timestamp()) / 3600


def main(arguments: Sequence[str]) -> None:
    """Print the plans, then a line for each material."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("materials", nargs="*", default=[f"{name}-paint" for name in PAINTS])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--width", type=int, default=384)
    parser.add_argument("--keep", type=Path, help="folder that may have the calibration already")
    asked = parser.parse_args(arguments)
    folder = asked.keep or Path(tempfile.mkdtemp(prefix="samples-in-turn-"))
    folder.mkdir(parents=True, exist_ok=True)
    rig, runs = rig_file(folder, asked.materials, asked.seed, asked.width), folder / "runs"
    if not (runs / "calibrations").is_dir():
        ended = labrig("run", "calibration", "--rig", rig, "--runs", runs, "--yes")
        if ended.returncode:
            raise SystemExit(ended.stderr.strip().splitlines()[-1])
    for count in sorted({2, 4, len(asked.materials)}):
        for name, rest in RESTS.items():
            lab_times = planned(folder, rig, asked.materials[:count], rest)
            print(f"{count} samples, {name:18}  {lab_times}", flush=True)
    protocol = protocol_file(folder, asked.materials)
    ended = labrig("run", protocol, "--rig", rig, "--runs", runs, "--yes")
    if ended.returncode:
        raise SystemExit(ended.stderr.strip().splitlines()[-1])
    run = Path(ended.stdout.strip().splitlines()[-1])
    every: list[Errors] = []
    for material in asked.materials:
        found = read_material(run / "result" / material / "material.yaml")
        true = read_material(material)
        if len(found.states) != len(true.states):
            print(f"{material:13}  {len(found.states)} states instead of {len(true.states)}")
            continue
        own = errors(found, true, brightness(run, material))
        print(f"{material:13}  {'; '.join(one.line() for one in own)}")
        every += own
    if every:
        print(summary(every))
    if asked.keep is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main(sys.argv[1:])
