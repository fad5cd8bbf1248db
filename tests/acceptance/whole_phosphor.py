"""`labrig run phosphor` on the simulated rig, from camera calibration to material, against truth.

    python -m tests.acceptance.whole_phosphor [MATERIAL ...] [--seeds 1] [--first 1] [--keep DIR]

Everything is calibrated in the run itself, in a room whose camera curves are bent as laboratories
disagree and whose filters are 1 % off their files. Per state: k_r and r(0) in σ from the truth;
k_e of bands of 0.002 /s or more, furthest in % and in σ; of the weaker ones, how many times their
95 % limit the truth is (≤ 1 is right); Λ, up to one factor, furthest in σ; wall time.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import yaml

from labrig import shipped
from labrig.material import Material, read_material
from labrig.record import read_run
from sim.lamp import BURNING_K, filament_spectrum
from sim.optics import emission
from sim.phosphor import band_cells

PAINTS = ("blue", "green", "orange", "pink", "purple", "red", "white", "yellow")
#: Of the room's lamp, in multiples of the irradiance to which Table 1's rates belong.
LAMP = 4.0
MEASURABLE_PER_S = 0.002


def rig_file(folder: Path, material: str, seed: int, width: int) -> Path:
    """The shipped rig for phosphors with another sample, seed and sensor."""
    rig = yaml.safe_load((shipped.folder("config") / "sim-phosphor.yaml").read_text())
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    rig["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig["simulation"]["sample"] = [{"material": material, "region": [0.03, 0.1, 0.94, 0.8]}]
    rig["simulation"] |= {"seed": seed, "sensor": {"width": width, "height": 64}}
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


def protocol_file(folder: Path, material: str) -> Path:
    """The shipped chain for another sample."""
    protocol = yaml.safe_load((shipped.folder("protocols") / "phosphor.yaml").read_text())
    path = folder / "phosphor.yaml"
    path.write_text(yaml.safe_dump(protocol | {"sample": {"name": material}}))
    return path


def run(folder: Path, material: str, seed: int, width: int) -> tuple[Material | str, float]:
    """What came out, or what was said instead, and how long it took."""
    began = time.monotonic()
    ended = subprocess.run(
        [
            sys.executable, "-m", "labrig", "run", protocol_file(folder, material),
            "--rig", rig_file(folder, material, seed, width), "--runs", folder / "runs", "--yes",
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    took_s = time.monotonic() - began
    if ended.returncode:
        return ended.stderr.strip().splitlines()[-1], took_s
    made = Path(ended.stdout.strip().splitlines()[-1]) / "result" / "material.yaml"
    return (read_material(made) if made.is_file() else "no material"), took_s


def brightness(run: Path) -> float:
    """Of the room's lamp in the last charge: it loses 0.2 % an hour."""
    (off,) = [
        action
        for action in list(read_run(run).completed().values())[-1].actions
        if action.device == "lamp" and action.action == "off"
    ]
    hours = (off.start_time - datetime(2026, 1, 1, tzinfo=UTC).timestamp()) / 3600
    return 1 - 0.002 * hours


def compared(found: Material, true: Material, brightness: float) -> str:
    """One line for every state; `brightness` of the lamp in the last charge."""
    if len(found.states) != len(true.states):
        return f"{len(found.states)} states instead of {len(true.states)}"
    assert true.bands_nm is not None
    cells, lamp = band_cells(true.bands_nm), filament_spectrum(BURNING_K)
    direct = cells @ lamp / np.linalg.norm(cells @ lamp)
    pairs = list(zip(found.states, true.states, strict=True))
    ours = np.array([state.reradiation for state, _ in pairs])
    theirs = emission(true) @ cells.T / cells.sum(axis=1)
    factor = (ours * theirs).sum() / (ours**2).sum()
    lines = []
    for number, (state, truth) in enumerate(pairs):
        k_e, sigma = (np.array(x) / LAMP for x in (state.k_e_per_s, state.k_e_per_s_sigma))
        # What was found belongs to the lamp as it was.
        wanted = brightness * np.array(truth.k_e_per_s)
        strong = np.array(truth.k_e_per_s) >= MEASURABLE_PER_S
        percent = 100 * (k_e / np.where(strong, wanted, 1.0) - 1)[strong]
        pulls = ((k_e - wanted) / np.maximum(sigma, 1e-12))[strong]
        weak = (wanted / np.maximum(k_e + 1.645 * sigma, 1e-12))[~strong]
        false = ((k_e - wanted) / np.maximum(sigma, 1e-12))[~strong]
        kappa = LAMP * float(wanted @ direct)
        r0 = kappa / (kappa + truth.k_r_per_s)
        own = np.array(state.reradiation_sigma) * factor
        radiated = (factor * ours[number] - theirs[number]) / np.maximum(own, 1e-12)
        bright = theirs[number] > 0.02 * theirs[number].max()
        lines.append(
            f"k_r {_pull(state.k_r_per_s, state.k_r_per_s_sigma, truth.k_r_per_s):+5.1f} σ  "
            f"r(0) {state.r0:.3f} ({r0:.3f}) {_pull(state.r0, state.r0_sigma, r0):+5.1f} σ  "
            f"k_e {_furthest(percent):+6.1f} % {_furthest(pulls):+5.1f} σ  "
            f"weak {max(weak, default=0.0):4.1f} {_furthest(false):+5.1f} σ  "
            f"Λ {_furthest(radiated[bright]):+5.1f} σ"
        )
    return "; ".join(lines)


def _pull(value: float | None, sigma: float | None, truth: float) -> float:
    assert value is not None
    assert sigma is not None
    return (value - truth) / sigma


def _furthest(numbers: np.ndarray) -> float:
    return float(numbers[np.argmax(np.abs(numbers))]) if len(numbers) else 0.0


def main(arguments: Sequence[str]) -> None:
    """Print a line for each material and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("materials", nargs="*", default=[f"{name}-paint" for name in PAINTS])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--width", type=int, default=384)
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args(arguments)
    for material in asked.materials:
        for seed in range(asked.first, asked.first + asked.seeds):
            folder = Path(tempfile.mkdtemp(prefix=f"{material}-{seed}-", dir=asked.keep))
            found, took_s = run(folder, material, seed, asked.width)
            said = found
            if not isinstance(found, str):
                true = read_material(material)
                said = compared(found, true, brightness(next(folder.glob("runs/*"))))
            print(f"{material:13} {seed:3} {took_s:5.0f} s  {said}", flush=True)
            if asked.keep is None:
                shutil.rmtree(folder)


if __name__ == "__main__":
    main(sys.argv[1:])
