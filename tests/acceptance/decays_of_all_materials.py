"""Every shipped material through the whole simulated pipeline: are the rates what they were?

    python -m tests.acceptance.decays_of_all_materials [--seeds 1] [--protocol decay]
        [--material NAME ...] [--sensor 1404x936]

For each material: rates found against rates put in, in σ; the number of states chosen; the flag on
the power law. Then Table 1's eleven in one charge against one by one, unless materials are named.
With several seeds, a summary: how many rates lie within 1 and 2 σ (68.3 and 95.4 % if σ is right),
mean and scatter of the errors in σ (0 and 1).
"""

import argparse
import contextlib
import io
import json
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.material import read_material
from labrig.results import EXPONENTIALS

WITHOUT_TRUE_STATES = "power-law"


def fits(folder: Path, rig: dict[str, object], protocol: str) -> dict[str, dict[str, object]]:
    """Run `protocol` on `rig` in `folder`; fit.json by patch."""
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = guarded(["run", protocol, "--rig", str(path), "--runs", str(folder / "runs")])
    if code:
        raise SystemExit(f"the run ended with {code}: {said.getvalue()}")
    return {
        found.parent.name: json.loads(found.read_text())
        for found in sorted((folder / "runs").glob("*/result/**/fit.json"))
    }


def shipped_rig(name: str, **simulation: object) -> dict[str, object]:
    """A shipped simulated rig, changed as told."""
    rig: dict[str, dict[str, object]] = yaml.safe_load(
        (resources.folder("config") / f"{name}.yaml").read_text()
    )
    fixed = {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig["simulation"] |= fixed | simulation
    return dict(rig)


def pulls(fit: dict[str, object], material: str) -> Iterator[float]:
    """(found − true) / σ of each rate, if the number of states is right."""
    true = sorted((state.k_r_per_s for state in read_material(material).states), reverse=True)
    for state, k_r_per_s in zip(fit["states"], true, strict=True):  # type: ignore[call-overload]
        yield (state["k_r_per_s"] - k_r_per_s) / state["k_r_per_s_sigma"]


def main() -> None:
    """Print a line per material and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--protocol", default="decay")
    parser.add_argument("--material", nargs="*", help="all")
    parser.add_argument("--sensor", default="1404x936")
    asked = parser.parse_args()
    width, height = map(int, asked.sensor.split("x"))
    sensor = {"width": width, "height": height}
    of_material: dict[str, list[list[float]]] = defaultdict(list)
    for seed in range(1, asked.seeds + 1):
        for name in asked.material or resources.names("config/materials"):
            with tempfile.TemporaryDirectory() as folder:
                rig = shipped_rig("sim", sample=name, seed=seed, sensor=sensor)
                (fit,) = fits(Path(folder), rig, asked.protocol).values()
            print(f"{name:22} seed {seed}: {assessment(fit, name)}", flush=True)
            if name != WITHOUT_TRUE_STATES and has_true_number_of_states(fit, name):
                of_material[name].append(list(pulls(fit, name)))
        if asked.material:
            continue
        with tempfile.TemporaryDirectory() as folder:
            rig = shipped_rig("sim-eleven", seed=seed, sensor=sensor)
            together = fits(Path(folder), rig, "decay-eleven")
        for name, fit in together.items():
            print(f"eleven: {name:14} seed {seed}: {assessment(fit, name)}", flush=True)
    if asked.seeds > 1:
        for name, errors in of_material.items():
            print(summary(name, np.array(errors), asked.seeds))


def summary(name: str, errors: NDArray[np.float64], seeds: int) -> str:
    """Errors of one material in σ, of shape (fits with the true number of states, states)."""
    one, two = (100 * np.mean(np.abs(errors) < sigmas, axis=0) for sigmas in (1, 2))
    with np.printoptions(precision=2, suppress=True):
        return (
            f"{name:22} right n {len(errors)} of {seeds}  1 σ {one.round(1)} %  2 σ "
            f"{two.round(1)} %  mean {errors.mean(axis=0)}  scatter {errors.std(axis=0)}"
        )


def has_true_number_of_states(fit: dict[str, object], material: str) -> bool:
    """Whether the fit chose as many as there are."""
    return fit["n_states"] == len(read_material(material).states)


def assessment(fit: dict[str, object], material: str) -> str:
    """Return one line with the outcome."""
    said = f"χ² {fit['reduced_chi2']:.2f}  ρ {fit['flicker']:.4f}  n {fit['n_states']}"
    if material == WITHOUT_TRUE_STATES:
        verdict = "NOT FLAGGED" if fit["law"] == EXPONENTIALS else f"flagged ({fit['law']})"
        return f"{said}  {verdict}  {fit['warnings']}"
    if not has_true_number_of_states(fit, material):
        true = len(read_material(material).states)
        return f"{said}  WRONG n (true {true})  {fit['states']} {fit['warnings']}"
    rates = "  ".join(
        f"k {state['k_r_per_s']:.5f} ± {state['k_r_per_s_sigma']:.5f} ({pull:+.1f} σ)"
        for state, pull in zip(fit["states"], pulls(fit, material), strict=True)  # type: ignore[call-overload]
    )
    return f"{said}  {rates}  {fit['warnings'] or ''}"


if __name__ == "__main__":
    main()
