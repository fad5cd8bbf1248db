"""One calibration of the simulated bench, then a whole phosphor of each paint with it.

    python -m tests.acceptance.reused_calibration [MATERIAL ...] [--seed 1] [--keep DIR]
        [--part excitation --keys '{at_most: 6}']

The bench is calibrated once (`labrig run calibration`); every material is then measured by `labrig
run phosphor`, which finds that calibration by itself. First what `labrig plan` says of both at the
size of a 21-megapixel camera's frames. Then a line for each material, as of
`tests.acceptance.whole_phosphor`, and the ΔE2000 of its photographs from the glow in the colour of
its measured spectrum (`labrig reproduce`), mean and largest, with the mean that noise alone makes;
then the root mean squares over all of them. `--keys` changes keys of one part of the chain, to see
what they cost.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from labrig.foundation import resources
from labrig.foundation.quantity import duration_text
from labrig.material import read_material
from labrig.record import size_text
from tests.acceptance.whole_phosphor import PAINTS, Errors, errors, rig_file, summary

#: Size of a frame of a camera of 21 megapixels in bytes, of its RAW format.
FRAME_BYTES = 25_000_000


def labrig(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run labrig."""
    command = [sys.executable, "-m", "labrig", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def protocol_file(folder: Path, material: str, part: str, keys: dict[str, Any]) -> Path:
    """The shipped chain for another sample, with other keys of one part."""
    content = yaml.safe_load(resources.find("protocols", "protocol", "phosphor").read_text())
    parts = [one | keys if one["protocol"] == part else one for one in content["parts"]]
    path = folder / f"{material}.yaml"
    path.write_text(yaml.safe_dump(content | {"sample": {"name": material}, "parts": parts}))
    return path


def planned(protocol: object, rig: Path, runs: Path) -> str:
    """Return what `labrig plan` says, with frames of 21 megapixels."""
    ended = labrig("plan", protocol, "--rig", rig, "--runs", runs, "--json")
    plan = json.loads(ended.stdout)
    size_bytes = plan["size_bytes"] - plan["frames_bytes"] + plan["frames"] * FRAME_BYTES
    return (
        f"at most {duration_text(plan['duration_s'])}, {plan['manual_steps']} steps by hand, "
        f"{plan['frames']} frames, {size_text(size_bytes)}"
    )


def measured(
    folder: Path, protocol: Path, material: str, seed: int, width: int
) -> tuple[list[Errors], str]:
    """Errors of one material measured with the calibration in `folder`, and a line on them."""
    rig = rig_file(folder, material, seed, width)
    began = time.monotonic()
    ended = labrig("run", protocol, "--rig", rig, "--runs", folder / "runs", "--yes")
    took = f"{material:13} {time.monotonic() - began:4.0f} s"
    if ended.returncode:
        return [], f"{took}  {ended.stderr.strip().splitlines()[-1]}"
    run = Path(ended.stdout.strip().splitlines()[-1])
    found = read_material(run / "result" / "material.yaml")
    true = read_material(material)
    if len(found.states) != len(true.states):
        return [], f"{took}  {len(found.states)} states instead of {len(true.states)}"
    every = errors(found, true, brightness=1.0)
    return every, f"{took}  {'; '.join(one.line() for one in every)}  {colours(run)}"


def colours(run: Path) -> str:
    """Return the colour differences of a run with one patch, as `labrig reproduce` tells them."""
    (glow,) = json.loads(labrig("reproduce", run, "--json").stdout)["glow"].values()
    own = "1 state"
    return f"ΔE {glow['mean'][own]:.2f} ({glow['max'][own]:.2f}), noise {glow['noise']:.2f}"


def main(arguments: Sequence[str]) -> None:
    """Print the plans, then a line for each material."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("materials", nargs="*", default=[f"{name}-paint" for name in PAINTS])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--width", type=int, default=384)
    parser.add_argument("--keep", type=Path, help="folder that may have the calibration already")
    parser.add_argument("--part", default="excitation")
    parser.add_argument("--keys", type=yaml.safe_load, default={})
    asked = parser.parse_args(arguments)
    folder = asked.keep or Path(tempfile.mkdtemp(prefix="reused-calibration-"))
    folder.mkdir(parents=True, exist_ok=True)
    rig, runs = rig_file(folder, asked.materials[0], asked.seed, asked.width), folder / "runs"
    print(f"whole chain   {planned('phosphor', rig, folder / 'nothing')}")
    print(f"calibration   {planned('calibration', rig, folder / 'nothing')}", flush=True)
    if not (runs / "calibrations").is_dir():
        ended = labrig("run", "calibration", "--rig", rig, "--runs", runs, "--yes")
        if ended.returncode:
            raise SystemExit(ended.stderr.strip().splitlines()[-1])
    every: list[Errors] = []
    for material in asked.materials:
        protocol = protocol_file(folder, material, asked.part, asked.keys)
        if material == asked.materials[0]:
            print(f"each sample   {planned(protocol, rig, runs)}", flush=True)
        one, line = measured(folder, protocol, material, asked.seed, asked.width)
        every += one
        print(line, flush=True)
    if every:
        print(summary(every))
    if asked.keep is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main(sys.argv[1:])
