"""`labrig run phosphor` on the simulated rig, from camera calibration to material, against truth.

    python -m tests.acceptance.whole_phosphor [MATERIAL ...] [--seeds 1] [--first 1] [--keep DIR]
    python -m tests.acceptance.whole_phosphor --again DIR

Everything is calibrated in the run itself, in a room whose camera curves are bent as laboratories
disagree and whose filters are 1 % off their files. Every run has a seed of its own, hence another
camera and other filters: runs of one seed share one error of the calibration. Per state: k_r and
r(0) in σ from the truth; k_e of bands of 0.002 /s or more, furthest in % and in σ; of the weaker
ones, how many times their 95 % limit the truth is (≤ 1 is right); Λ, up to one factor, furthest in
σ; wall time. At the end
the root mean squares over all of them, and the means of the k_e's errors of each run, by which all
its bands are off: σ are right where the root mean square of errors in σ is 1. `--again`
processes runs that were kept by the code as it is now.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.material import Material, read_material
from labrig.process import process_run
from labrig.record import read_run
from labrig.sim.lamp import BURNING_K, Lamp, filament_spectrum
from labrig.sim.optics import emission
from labrig.sim.phosphor import band_cells
from labrig.sim.simulation import LampSettings

PAINTS = ("blue", "green", "orange", "pink", "purple", "red", "white", "yellow")
#: Of the room's lamp, in multiples of the irradiance to which Table 1's rates belong.
LAMP = 4.0
MEASURABLE_PER_S = 0.002


def rig_file(folder: Path, material: str, seed: int, width: int) -> Path:
    """The shipped rig for phosphors with another sample, seed and sensor."""
    rig = yaml.safe_load((resources.folder("config") / "sim-phosphor.yaml").read_text())
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    rig["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig["simulation"]["sample"] = [{"material": material, "region": [0.03, 0.1, 0.94, 0.8]}]
    rig["simulation"] |= {"seed": seed, "sensor": {"width": width, "height": 64}}
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


def protocol_file(folder: Path, material: str) -> Path:
    """The shipped chain for another sample."""
    protocol = yaml.safe_load(resources.find("protocols", "protocol", "phosphor").read_text())
    path = folder / "phosphor.yaml"
    path.write_text(yaml.safe_dump(protocol | {"sample": {"name": material}}))
    return path


def run(folder: Path, material: str, seed: int, width: int) -> tuple[Material | str, float]:
    """Return the material, or the message of a failure, and the time that it took."""
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
    """Return the brightness of the room's lamp in the last charge: it loses 0.2 % an hour."""
    (off,) = [
        action
        for action in list(read_run(run).completed().values())[-1].actions
        if action.device == "lamp" and action.action == "off"
    ]
    hours = (off.start_time - datetime(2026, 1, 1, tzinfo=UTC).timestamp()) / 3600
    return 1 - 0.002 * hours


def lamp_before_off(run: Path) -> Callable[[float], float]:
    """Return the light of the last charge over a warm lamp's, so many seconds before its end.

    The housing warms during the charge: r(0) is that of the lamp as the sample remembers it.
    """
    lamp, off_s = Lamp.found(LampSettings(), on=False), 0.0
    actions = [
        action
        for attempt in read_run(run).completed().values()
        for action in attempt.actions
        if action.device == "lamp" and action.action in ("on", "off")
    ]
    for action in sorted(actions, key=lambda action: action.start_time):
        at_s = action.start_time - datetime(2026, 1, 1, tzinfo=UTC).timestamp()
        lamp = lamp.switched(action.action == "on", at_s)
        off_s = off_s if lamp.on else at_s
    warm = filament_spectrum(BURNING_K)
    return lambda before_s: float((lamp.irradiance(off_s - before_s) / warm)[0])


class Errors(NamedTuple):
    """Errors of one state in σ, unless said otherwise.

    Attributes
    ----------
    k_e_percent, k_e
        Of the bands that are to be measured.
    limit
        Truth over the 95 % limit, of the weaker bands.
    """

    r0: tuple[float, float]
    k_r: float
    r0_off: float
    k_e_percent: FloatArray
    k_e: FloatArray
    limit: FloatArray
    weak: FloatArray
    radiated: FloatArray

    def line(self) -> str:
        """Return a line for the terminal."""
        return (
            f"k_r {self.k_r:+5.1f} σ  r(0) {self.r0[0]:.3f} ({self.r0[1]:.3f}) "
            f"{self.r0_off:+5.1f} σ  k_e {_furthest(self.k_e_percent):+6.1f} % "
            f"{_furthest(self.k_e):+5.1f} σ  weak {max(self.limit, default=0.0):4.1f} "
            f"{_furthest(self.weak):+5.1f} σ  Λ {_furthest(self.radiated):+5.1f} σ"
        )


def errors(
    found: Material,
    true: Material,
    brightness: float,
    before_off: Callable[[float], float] | None = None,
) -> list[Errors]:
    """Return the errors of every state.

    `brightness` is the warm lamp's at the time of the last charge, `before_off` as of
    `lamp_before_off`; without it that lamp was warm.
    """
    assert true.bands_nm is not None
    cells, lamp = band_cells(true.bands_nm), filament_spectrum(BURNING_K)
    direct = cells @ lamp / np.linalg.norm(cells @ lamp)
    pairs = list(zip(found.states, true.states, strict=True))
    ours = np.array([state.reradiation for state, _ in pairs])
    theirs = emission(true) @ cells.T / cells.sum(axis=1)
    factor = (ours * theirs).sum() / (ours**2).sum()
    every = []
    for number, (state, truth) in enumerate(pairs):
        k_e, sigma = (np.array(x) / LAMP for x in (state.k_e_per_s, state.k_e_per_s_sigma))
        # What was found belongs to the lamp as it was.
        wanted = brightness * np.array(truth.k_e_per_s)
        strong = np.array(truth.k_e_per_s) >= MEASURABLE_PER_S
        pulls = (k_e - wanted) / np.maximum(sigma, 1e-12)
        kappa = LAMP * float(wanted @ direct)
        if before_off is not None:
            # A sample follows a light that changes slowly by its own time.
            kappa *= before_off(1 / (kappa + truth.k_r_per_s)) / brightness
        r0 = kappa / (kappa + truth.k_r_per_s)
        own = np.array(state.reradiation_sigma) * factor
        radiated = (factor * ours[number] - theirs[number]) / np.maximum(own, 1e-12)
        every.append(
            Errors(
                r0=(float(state.r0 or 0.0), r0),
                k_r=_pull(state.k_r_per_s, state.k_r_per_s_sigma, truth.k_r_per_s),
                r0_off=_pull(state.r0, state.r0_sigma, r0),
                k_e_percent=100 * (k_e[strong] / wanted[strong] - 1),
                k_e=pulls[strong],
                limit=(wanted / np.maximum(k_e + 1.645 * sigma, 1e-12))[~strong],
                weak=pulls[~strong],
                radiated=radiated[theirs[number] > 0.02 * theirs[number].max()],
            )
        )
    return every


def summary(every: Sequence[Errors]) -> str:
    """Root mean squares over all states of all runs."""
    names = {"k_r": "σ", "r0_off": "σ", "k_e": "σ", "k_e_percent": "%", "radiated": "σ"}
    parts = []
    for name, unit in names.items():
        numbers = np.concatenate([np.atleast_1d(getattr(one, name)) for one in every])
        parts.append(f"{name} {np.sqrt(np.mean(numbers**2)):.2f} {unit}")
    common = [float(np.mean(one.k_e_percent)) for one in every if len(one.k_e_percent)]
    standard_error = np.std(common, ddof=min(1, len(common) - 1)) / np.sqrt(len(common))
    return (
        f"root mean squares of {len(every)} states: {', '.join(parts)}\n"
        f"k_e of a state, mean over its bands: {np.mean(common):+.1f} ± {standard_error:.1f} % "
        f"over all states, furthest {_furthest(np.array(common)):+.1f} %"
    )


def _pull(value: float | None, sigma: float | None, truth: float) -> float:
    assert value is not None
    assert sigma is not None
    return (value - truth) / sigma


def _furthest(numbers: FloatArray) -> float:
    return float(numbers[np.argmax(np.abs(numbers))]) if len(numbers) else 0.0


def main(arguments: Sequence[str]) -> None:
    """Print a line for each material and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("materials", nargs="*", default=[f"{name}-paint" for name in PAINTS])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--width", type=int, default=384)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--again", type=Path)
    asked = parser.parse_args(arguments)
    every: list[Errors] = []
    if asked.again:
        for kept in sorted(asked.again.glob("*/runs/*")):
            material, seed, _ = kept.parents[1].name.rsplit("-", 2)
            began = time.monotonic()
            process_run(kept)
            found = read_material(kept / "result" / "material.yaml")
            every += _told(material, int(seed), time.monotonic() - began, found, kept)
    else:
        for number, material in enumerate(asked.materials):
            first = asked.first + number * asked.seeds
            for seed in range(first, first + asked.seeds):
                folder = Path(tempfile.mkdtemp(prefix=f"{material}-{seed}-", dir=asked.keep))
                made, took_s = run(folder, material, seed, asked.width)
                every += _told(material, seed, took_s, made, next(folder.glob("runs/*"), folder))
                if asked.keep is None:
                    shutil.rmtree(folder)
    if every:
        print(summary(every))


def _told(
    material: str, seed: int, took_s: float, found: Material | str, run: Path
) -> list[Errors]:
    """Print the errors of one run."""
    every: list[Errors] = []
    true = read_material(material)
    if isinstance(found, str):
        said = found
    elif len(found.states) != len(true.states):
        said = f"{len(found.states)} states instead of {len(true.states)}"
    else:
        every = errors(found, true, brightness(run), lamp_before_off(run))
        said = "; ".join(one.line() for one in every)
    print(f"{material:13} {seed:3} {took_s:5.0f} s  {said}", flush=True)
    return every


if __name__ == "__main__":
    main(sys.argv[1:])
