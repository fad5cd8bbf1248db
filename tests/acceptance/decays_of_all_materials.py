"""Every shipped material through the whole simulated pipeline: are the rates what they were?

    python -m tests.acceptance.decays_of_all_materials [--seeds 1] [--protocol decay]

For each material: rates found against rates put in, in σ; the number of states chosen; the flag on
the power law. Then Table 1's eleven in one charge against one by one.
"""

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import yaml

from labrig import shipped
from labrig.cli.ending import guarded
from labrig.material import read_material

WITHOUT_TRUE_STATES = "power-law"


def fits(folder: Path, rig: dict[str, object], protocol: str) -> dict[str, dict[str, object]]:
    """Run `protocol` on `rig` in `folder`; fit.json by patch."""
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    if guarded(["run", protocol, "--rig", str(path), "--runs", str(folder / "runs")]):
        raise SystemExit(f"the run in {folder} failed")
    return {
        found.parent.name: json.loads(found.read_text())
        for found in sorted((folder / "runs").glob("*/result/**/fit.json"))
    }


def shipped_rig(name: str, **simulation: object) -> dict[str, object]:
    """A shipped simulated rig, changed as told."""
    rig: dict[str, dict[str, object]] = yaml.safe_load(
        (shipped.folder("config") / f"{name}.yaml").read_text()
    )
    fixed = {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig["simulation"] |= fixed | simulation
    return dict(rig)


def pulls(fit: dict[str, object], material: str) -> Iterator[float]:
    """(found − true) / σ of each rate, if the number of states is right."""
    true = sorted((state.k_r_per_s for state in read_material(material).states), reverse=True)
    for state, k_r_per_s in zip(fit["states"], true, strict=True):  # type: ignore[call-overload]
        yield (state["k_r_per_s"] - k_r_per_s) / state["k_r_sigma_per_s"]


def main() -> None:
    """Print a line per material and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--protocol", default="decay")
    asked = parser.parse_args()
    lines = []
    for seed in range(1, asked.seeds + 1):
        for name in shipped.names("config/materials"):
            with tempfile.TemporaryDirectory() as folder:
                rig = shipped_rig("sim", sample=name, seed=seed)
                (fit,) = fits(Path(folder), rig, asked.protocol).values()
            lines.append(f"{name:22} seed {seed}: {verdict(fit, name)}")
        with tempfile.TemporaryDirectory() as folder:
            together = fits(Path(folder), shipped_rig("sim-eleven", seed=seed), "decay-eleven")
        lines += [
            f"eleven: {name:14} seed {seed}: {verdict(fit, name)}" for name, fit in together.items()
        ]
    print("\n".join(lines))


def verdict(fit: dict[str, object], material: str) -> str:
    """What came out, in a line."""
    said = f"χ² {fit['reduced_chi2']:.2f}  ρ {fit['flicker']:.4f}  n {fit['n_states']}"
    if material == WITHOUT_TRUE_STATES:
        return f"{said}  {'flagged' if fit['better_rival'] else 'NOT FLAGGED'}  {fit['warnings']}"
    true = len(read_material(material).states)
    if fit["n_states"] != true:
        return f"{said}  WRONG n (true {true})  {fit['states']} {fit['warnings']}"
    rates = "  ".join(
        f"k {state['k_r_per_s']:.5f} ± {state['k_r_sigma_per_s']:.5f} ({pull:+.1f} σ)"
        for state, pull in zip(fit["states"], pulls(fit, material), strict=True)  # type: ignore[call-overload]
    )
    return f"{said}  {rates}  {fit['warnings'] or ''}"


if __name__ == "__main__":
    main()
