"""Outputs that pages of the manual show of labrig's commands, on simulated benches.

    python -m tests.acceptance.manual_examples PAGE ...

Prints the commands, their warnings, and what they print.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.material import write_reradiation
from tests.material.reradiation.formats.matrices import two_dyes
from tests.real_data import SHARED

#: Without it a terminal's width would be in the outputs.
ENVIRONMENT = {**os.environ, "COLUMNS": "80", "PYTHONUTF8": "1"}
#: A sensor on which two days are photographed within seconds.
SMALL_SENSOR = {"width": 702, "height": 468}


@dataclass(frozen=True)
class Example:
    """What a page shows.

    Attributes
    ----------
    commands
        Arguments of `labrig`, one command after another.
    lay_out
        Function that writes the files of the reader into the working directory.
    reported
        Pattern of what the last report says; it has " | " between the cells of a table.
    refused
        Arguments of commands that labrig refuses.
    """

    commands: tuple[str, ...]
    lay_out: Callable[[Path], None] = lambda folder: None
    reported: str = ""
    refused: tuple[str, ...] = ()

    def show(self) -> None:
        """Run the commands in a folder of their own and print what the page shows of them."""
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            self.lay_out(folder)
            for command in self.commands:
                _run(command, folder, 0)
            if self.reported:
                print(_in_last_report(self.reported, folder / "runs"), end="\n\n")
            for command in self.refused:
                _run(command, folder, UsageError.exit_code)


def _run(command: str, folder: Path, expected: int) -> None:
    print("$ labrig", command, flush=True)
    done = subprocess.run(
        [sys.executable, "-m", "labrig", *shlex.split(command)],
        cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip
    # The rest of it is progress.
    said = re.findall(r"^(?:warning|labrig): .*$", done.stderr, re.M)
    print(*said, *map(str.rstrip, done.stdout.splitlines()), "", sep="\n", flush=True)
    if done.returncode != expected:
        sys.exit(f"exit code {done.returncode}, expected {expected}: {command}")


def _in_last_report(pattern: str, runs: Path) -> str:
    page = max(runs.glob("*/result/report.html"), key=lambda path: path.stat().st_mtime)
    text = re.sub(r"(?:\s*<[^>]*>\s*)+", " | ", page.read_text(encoding="utf-8"))
    found = re.search(pattern, unescape(text))
    if found is None:
        sys.exit(f"not in the report: {pattern}")
    return found[0]


def _shipped(kind: str, name: str) -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load(resources.find(kind, kind, name).read_text())
    return content


def _write(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(yaml.safe_dump(content), encoding="utf-8")


def _bench(shipped: str, **changed: object) -> dict[str, Any]:
    rig = _shipped("config", shipped)
    # YAML has a truth value for the word `off`, which is the default.
    rig["simulation"].pop("initial", None)
    rig["simulation"].update(changed)
    return rig


def two_days(folder: Path) -> None:
    """Write a decay of two patches, and rig files of the same samples and camera on two days.

    Without `curves` another seed would be another camera.
    """
    protocol = _shipped("protocols", "decay")
    protocol["patches"] = {"sample": [0.05, 0.3, 0.4, 0.4], "reference": [0.55, 0.3, 0.4, 0.4]}
    _write(folder / "my-decay.yaml", protocol)
    samples = [
        {"material": "blue-paint", "region": [0.03, 0.25, 0.45, 0.5]},
        {"material": "green-paint", "region": [0.52, 0.25, 0.45, 0.5]},
    ]
    curves = resources.folder("config") / "optics/cameras/canon_eos_5d_mark_ii.json"
    sensor = {**SMALL_SENSOR, "curves": str(curves)}
    for day in (1, 2):
        epoch = f"2026-01-0{day}T00:00:00Z"
        rig = _bench("sim", sample=samples, sensor=sensor, seed=day, epoch=epoch)
        _write(folder / f"day-{day}.yaml", rig)


def leak_and_afterglow(folder: Path) -> None:
    """Write rig files of a room that leaks and of a lamp that glows on, and a hasty protocol."""
    _write(folder / "leak.yaml", _bench("sim-phosphor", ambient="0.001 %"))
    afterglow = {"afterglow": "0.01 %", "afterglow_fades": "60 s"}
    _write(folder / "afterglow.yaml", _bench("sim-phosphor", lamp=afterglow))
    hasty = {**_shipped("protocols", "decay"), "first": "500 ms", "daylight": False}
    _write(folder / "my-decay.yaml", hasty)


def autofocus(folder: Path) -> None:
    """Write the rig file of a camera whose lens is on autofocus."""
    _write(folder / "my-rig.yaml", _bench("sim", camera={"autofocus": True}))


def luminances(folder: Path) -> None:
    """Write readings of a luminance meter, of general order 1.9 and rounded, and a protocol."""
    minutes = np.geomspace(1, 600, 60)
    noise = 1 + 0.005 * np.random.default_rng(1).standard_normal(len(minutes))
    readings = 290 * (1 + minutes) ** -1.1 * noise
    rows = (f"{t:.3g};{light:.4g}" for t, light in zip(minutes, readings, strict=True))
    protocol = {
        "protocol": "luminance",
        "sample": {"name": "paint", "thickness": "0.4 mm"},
        "excitation": {"preset": "DIN 67510-1", "rested": "50 h"},
        "emission": "power-law",
        "colours": "K-W",
        "require": ["20 mcd/m2 at 10 min"],
    }
    _write(folder / "my-luminance.yaml", protocol)
    text = "\n".join(["time / min;L / mcd/m2", *rows])
    (folder / "log.csv").write_text(f"{text}\n", encoding="utf-8")
    print(*text.splitlines()[:3], sep="\n", end="\n\n")


def matrices(folder: Path) -> None:
    """Write a re-radiation matrix as an instrument measures it, and a real one."""
    write_reradiation(folder / "paper.BFC", two_dyes())
    shutil.copy(SHARED / "bispectral/art_postit/fluorescent_yellow.csv", folder / "yellow.csv")


#: Name of a run of the fluorescent bench, by protocol.
_FLUORESCENT_RUN = "runs/2026-01-01T00-00-00_{}_sample"
EXAMPLES = {
    "refit": Example(
        (
            "run decay --rig sim",
            "process last --roi sample=500,300,300,200 --exclude 20",
        )
    ),
    "compare_days": Example(
        (
            "run ./my-decay.yaml --rig ./day-1.yaml",
            "run ./my-decay.yaml --rig ./day-2.yaml",
            "runs list",
            "runs compare 2026-01-01 2026-01-02",
            "runs compare 2026-01-01 2026-01-02 --reference reference",
            "reproduce last",
            "reproduce last --material sample=blue-paint",
            "process last --states 2",
            "runs show last",
        ),
        two_days,
    ),
    "dark_room": Example(
        (
            "run blank --rig ./leak.yaml --yes",
            "run fade --rig sim-phosphor --yes",
            "run fade --rig ./afterglow.yaml --yes",
            "run blank --rig sim-phosphor --yes",
        ),
        leak_and_afterglow,
        reported=r"Begun after its planned time[^|]*",
        refused=("plan ./my-decay.yaml --rig sim-phosphor",),
    ),
    "own_camera": Example(
        (
            "rig check sim",
            "optics show canon_eos_5d_mark_ii",
            "run camera_calibration --rig sim-phosphor --yes",
        ),
        autofocus,
        refused=("rig check ./my-rig.yaml",),
    ),
    "luminance": Example(
        (
            "fit luminance log.csv --scale-sigma '4 %' --require '20 mcd/m2 at 10 min' "
            "--colours K-W --excitation 'xenon, 1000 lx, 5 min'",
            "run ./my-luminance.yaml --rig sim-luminance --yes",
        ),
        luminances,
    ),
    "matrices": Example(
        (
            "material show paper.BFC",
            "material convert paper.BFC paper.yaml --corrected",
            "material compare paper.BFC paper.yaml",
            "fit mixture yellow.csv --components 3 --threshold 0.004",
        ),
        matrices,
    ),
    "fluorescent": Example(
        (
            "run led_brightness --rig sim-fluorescent --yes",
            "run direct_bispectral --rig sim-fluorescent --yes",
            "run validate_illuminants --rig sim-fluorescent --yes",
            "run angular_fluorescence --rig sim-fluorescent --yes",
            "run led_fluorescence --rig sim-fluorescent --yes",
            f"process last --optics leds={_FLUORESCENT_RUN.format('led_brightness')} "
            f"--optics direct={_FLUORESCENT_RUN.format('direct_bispectral')}",
        ),
        reported=r"all LEDs together – spectrometer [^a-z]*one LED by itself – spectrometer[^a-z]*",
    ),
}


def main(pages: list[str]) -> None:
    """Show the examples of pages."""
    if not pages or not set(pages) <= EXAMPLES.keys():
        print(__doc__, "Pages:", *EXAMPLES, sep="\n")
        sys.exit(2)
    for page in pages:
        EXAMPLES[page].show()


if __name__ == "__main__":
    main(sys.argv[1:])
