"""The dark room rendered from the files of simulated runs, beside their photographs.

    python -m tests.acceptance.dark_room [NAME ...] [--keep DIR]

Every case is a whole `labrig run phosphor` with `reflectance` in the simulated room, whose traps
are integrated as they stand; the runs in DIR are used again. Per rendering: mean and largest ΔE2000
with L* = 50 of every photograph, mean with one factor of each channel for all times, mean with one
exposure for all; glow over reflected light, rendered over photographed − 1, mean and furthest in %
and furthest in σ. A case is right where the run's own material is within 3 % in the mean over all
times and within 3 σ at each, and its mean ΔE is 2 or less; of a material with several states or
another order the single state must be off by twice as much.

Figure 10 of Nalbach, Seidel and Ritschel, a prediction beside photographs, are the cases of another
run: the material is that of one run, the photographs are those of the other, on a bench without a
door. Both sides of glow over reflected light are printed, at the first and the last photograph.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from labrig.analyse import fit_series
from labrig.compare import RenderedPatch, compare_rendered
from labrig.fit import DecayFit
from labrig.foundation import resources
from labrig.material import Albedo, read_material, write_material
from labrig.results import Series
from tests.quick_yaml import read_quickly, write_quickly

#: Albedo of all samples: a blue paint's.
BLUE = {300: 0.35, 420: 0.45, 460: 0.6, 500: 0.35, 560: 0.15, 620: 0.12, 680: 0.2, 780: 0.4}
MAX_PERCENT, MAX_SIGMAS, MAX_DELTA_E, WORSE = 3.0, 3.0, 2.0, 2.0


@dataclass(frozen=True)
class Case:
    """A sample and its room.

    Attributes
    ----------
    of
        Name of the case whose run measured the sample, where this is another run of it: a decay on
        a bench without a door, where the camera also sees the sample under the lamp.
    """

    name: str
    material: str
    seed: int
    kinetics: Mapping[str, Any] = field(default_factory=dict)
    sensor: Mapping[str, Any] = field(default_factory=dict)
    of: str | None = None
    is_one_state: bool = False


CASES = (
    Case("two-states", "double-medium-bright", 141),
    Case("two-states-wide", "double-wide", 142),
    Case("two-states-no-door", "double-medium-bright", 141, of="two-states"),
    Case("wide-no-door", "double-wide", 142, of="two-states-wide"),
    Case("blue-paint", "blue-paint", 145, is_one_state=True),
    Case("order-1.5", "blue-paint", 146, {"model": "general_order", "order": 1.5}),
    Case("otor-0.5", "blue-paint", 147, {"model": "otor", "retrapping": 0.5}),
    Case("two-states-slow", "double-wide-slow", 149),
    Case("two-states-faint", "double-medium-faint", 150),
    Case("known-camera", "double-medium-bright", 148, sensor={"curves": "canon_eos_5d_mark_ii"}),
)


def recorded(case: Case, folder: Path) -> Path:
    """Return the folder of the case's run, recorded and processed unless it is there."""
    place = folder / case.name
    if not (place / "runs").is_dir():
        place.mkdir(parents=True, exist_ok=True)
        command = [
            sys.executable, "-m", "labrig", "run", str(_protocol_file(place, case)),
            "--rig", str(_rig_file(folder, case)), "--runs", str(place / "runs"), "--yes",
        ]  # fmt: skip
        subprocess.run(command, check=True, capture_output=True)
    return next((place / "runs").iterdir())


def _rig_file(folder: Path, case: Case) -> Path:
    place = folder / case.name
    known = Albedo(wavelength_nm=tuple(map(float, BLUE)), value=tuple(BLUE.values()))
    coloured = read_material(case.material).model_copy(update={"albedo": known})
    write_material(place / "sample.yaml", coloured)
    rig = read_quickly((resources.folder("config") / "sim-phosphor.yaml").read_text())
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    rig["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    sample: dict[str, Any] = {
        "material": str(place / "sample.yaml"),
        "region": [0.03, 0.1, 0.94, 0.8],
    }
    if case.kinetics:
        sample["kinetics"] = dict(case.kinetics)
    rig["simulation"] |= {"sample": [sample], "seed": case.seed}
    rig["simulation"]["sensor"] |= dict(case.sensor)
    if case.of is not None:
        for name in ("door", "shield", "servo"):
            rig["devices"].pop(name, None)
            rig["simulation"].pop(name, None)
        calibrated = str(next((folder / case.of / "runs").iterdir()))
        keys = ("camera_file", "lvf", "fade", "irradiance")
        rig["optics"] |= dict.fromkeys(keys, calibrated)
    path = place / "rig.yaml"
    path.write_text(write_quickly(rig))
    return path


def _protocol_file(place: Path, case: Case) -> Path:
    """Write the shipped chain with the sample's albedo, or a decay and a photograph in light."""
    path = place / "protocol.yaml"
    if case.of is not None:
        decay = {"protocol": "decay", "charge": "10 min", "daylight": True}
        path.write_text(write_quickly(decay | {"sample": {"name": case.name}}))
        return path
    chain = read_quickly(resources.find("protocols", "protocol", "phosphor").read_text())
    chain["parts"].append({"protocol": "reflectance"})
    path.write_text(write_quickly(chain | {"sample": {"name": case.name}}))
    return path


def refit(series: Series, states: int, flicker: float) -> DecayFit:
    """Fit a series as `labrig reproduce` does."""
    return fit_series(series, states, flicker=flicker)


def is_right(case: Case, patch: RenderedPatch) -> bool:
    """Return whether a case's own material looks as it was photographed."""
    off = 100 * abs(patch.ratio.excess("measured").mean())
    sigmas = np.abs(patch.ratio.in_sigma("measured")).max()
    mean = patch.each.mean("measured")
    is_better = case.is_one_state or patch.each.mean("1 state") >= WORSE * mean
    return bool(off <= MAX_PERCENT and sigmas <= MAX_SIGMAS and mean <= MAX_DELTA_E and is_better)


def told(case: Case, folder: Path) -> bool:
    """Print the comparison of a case; return whether it is right."""
    for other in CASES:
        if other.name == case.of:
            recorded(other, folder)
    run = recorded(case, folder)
    measured_in = folder / (case.of or case.name) / "runs"
    material = next(measured_in.iterdir()) / "result" / "material.yaml"
    compared = compare_rendered(run, refit, [] if case.of is None else [str(material)])
    (patch,) = compared.patches
    right, ratio = is_right(case, patch), patch.ratio
    states = read_material(material).states
    orders = ", ".join(f"{state.kinetic_order:.2f}" for state in states)
    print(
        f"{case.name}: {case.material}, order {orders}, seed {case.seed}, light reflected by "
        f"{ratio.reflected_by}, {ratio.photographed[0]:.3g} to {ratio.photographed[-1]:.3g} in "
        f"{ratio.channel}; noise alone ΔE {patch.each.mean_noise:.2f}: "
        f"{'right' if right else 'WRONG'}"
    )
    for name in patch.each.delta_e:
        excess, pull = 100 * ratio.excess(name), ratio.in_sigma(name)
        furthest = int(np.argmax(np.abs(excess)))
        print(
            f"    {name:10} ΔE {patch.each.mean(name):5.2f} ({patch.each.most(name):5.2f})  "
            f"colour matched {patch.matched.mean(name):5.2f}  one exposure "
            f"{patch.common.mean(name):5.2f}  ratio {excess.mean():+6.2f} %, furthest "
            f"{excess[furthest]:+6.2f} %, {pull[np.argmax(np.abs(pull))]:+6.2f} σ",
            flush=True,
        )
    seen, shown = ratio.photographed, ratio.photographed * (1 + ratio.excess("measured"))
    print(
        f"    glow over reflected light in {ratio.channel}: photographed {seen[0]:.5f} and "
        f"{seen[-1]:.6f}, rendered {shown[0]:.5f} and {shown[-1]:.6f}"
    )
    for line in (*compared.notes, *compared.left_out, *compared.warnings):
        print(f"    {line}")
    return right


def main(arguments: Sequence[str]) -> None:
    """Print all cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="of the cases; all by default")
    parser.add_argument("--keep", type=Path, help="folder of the runs, which are used again")
    asked = parser.parse_args(arguments)
    folder = (asked.keep or Path(tempfile.mkdtemp())).resolve()
    right = []
    for case in CASES:
        if not asked.names or case.name in asked.names:
            right.append(told(case, folder))
    print(f"{sum(right)} of {len(right)} cases are right")


if __name__ == "__main__":
    main(sys.argv[1:])
