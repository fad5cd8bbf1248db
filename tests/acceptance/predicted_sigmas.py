"""Predicted uncertainties against simulated ones: do fits scatter as `plan --predict` says?

    python -m tests.acceptance.predicted_sigmas [--days 32] [--workers 2] [--only double-wide]

Of each material one pilot is run, and every protocol predicted from its result, as a person would.
Then each protocol is run on many days: the same camera, other noise. A line per rate: σ predicted,
scatter of the fitted rates, median of the fits' own σ; the chance predicted that all states are
told, and how often they were. The scatter over N days is itself known to 1/√(2(N − 1)): 13 % for
32.
"""

import argparse
import contextlib
import io
import json
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.acquire import read_run_protocol
from labrig.analyse import Overrides
from labrig.analyse.frames import intact_frames
from labrig.analyse.series_fit import fit_series
from labrig.cli.exit_codes import guarded
from labrig.foundation.errors import FitError
from labrig.record import read_run
from labrig.reduce import reduce_patches
from tests.acceptance.decays_of_all_materials import shipped_rig

PILOT_DAY = 0
PILOT = {"exposure": "grow", "repeats": 4, "for": "360 s"}


@dataclass(frozen=True)
class Case:
    """A material and the keys of a decay protocol."""

    material: str
    name: str
    states: int
    keys: dict[str, Any] = field(default_factory=dict)


CASES = [
    Case("blue-paint", "50 ms", 1, {"exposure": "50 ms"}),
    Case("blue-paint", "50 ms, repeats: 4", 1, {"exposure": "50 ms", "repeats": 4}),
    Case("blue-paint", "50 ms, iso: 1600", 1, {"exposure": "50 ms", "camera": {"iso": 1600}}),
    Case("blue-paint", "auto", 1),
    Case("blue-paint", "grow", 1, {"exposure": "grow"}),
    Case("blue-paint", "auto, for: 90 s", 1, {"for": "90 s"}),
    Case("green-paint", "auto", 1),
    Case("green-paint", "auto, every: 2.5 s", 1, {"every": "2.5 s"}),
    Case("double-wide", "auto", 2),
    Case("double-wide", "grow", 2, {"exposure": "grow"}),
    Case("double-wide", "auto, for: 6 min", 2, {"for": "6 min"}),
    Case("double-close-even", "auto", 2),
    Case("double-close-even", "grow", 2, {"exposure": "grow"}),
    Case("double-close-even", "grow, for: 6 min", 2, {"exposure": "grow", "for": "6 min"}),
    Case("double-close-even", "auto, repeats: 4", 2, {"repeats": 4}),
    Case("double-close-even", "5 ms, for: 60 s", 2, {"exposure": "5 ms", "for": "60 s"}),
]


@dataclass(frozen=True)
class Fitted:
    """Rates by falling rate and their own σ, and whether the fit chose as many states itself."""

    rates: list[float]
    sigmas: list[float]
    told: bool


def labrig(*arguments: object) -> str:
    """Run a command in this process; what it printed."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(io.StringIO()):
        code = guarded([str(argument) for argument in arguments])
    if code:
        raise SystemExit(f"labrig {' '.join(map(str, arguments))}: exit code {code}")
    return said.getvalue()


def written(folder: Path, case: Case, day: int) -> tuple[Path, Path]:
    """Protocol and rig of a case."""
    # Noise is drawn from the time: cases that share days must not share hours.
    hour = sum(map(ord, case.material + case.name)) % 24
    epoch = f"2026-{1 + day // 28:02}-{1 + day % 28:02}T{hour:02}:00:00Z"
    sensor = {"width": 96, "height": 64}
    rig = shipped_rig("sim", sample=case.material, epoch=epoch, sensor=sensor)
    protocol = {"protocol": "decay", "charge": "20 min", **case.keys}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol))
    return folder / "protocol.yaml", folder / "rig.yaml"


def run(folder: Path, case: Case, day: int, *more: str) -> Path:
    """Run a case in the simulated room; the run folder."""
    protocol, rig = written(folder, case, day)
    said = labrig("run", protocol, "--rig", rig, "--runs", folder / "runs", *more)
    return Path(said.splitlines()[-1])


def fitted(case: Case, day: int) -> Fitted:
    """Fit one day's frames with the true number of states, without the report's pictures."""
    with tempfile.TemporaryDirectory() as folder:
        made = run(Path(folder), case, day, "--no-process")
        patches = Overrides().patches(read_run_protocol(made))
        frames = intact_frames(read_run(made), Overrides())
        (series,) = reduce_patches(frames.decay, patches, frames.dark).values()
    try:
        fit = fit_series(series, case.states)
    except FitError:  # nothing stands out of the noise
        return Fitted([], [], told=False)
    return Fitted(
        [state.k_r_per_s for state in fit.states],
        [state.k_r_per_s_sigma for state in fit.states],
        fit_series(series).n_states == case.states,
    )


def predicted(folder: Path, case: Case, material: Path) -> dict[str, Any]:
    """Return the prediction of `plan --predict` for the case's only patch."""
    protocol, rig = written(folder, case, PILOT_DAY)
    said = json.loads(labrig("plan", protocol, "--rig", rig, "--predict", material, "--json"))
    (patch,) = said["patches"].values()
    return dict(patch)


def lines(case: Case, said: dict[str, Any], fits: list[Fitted]) -> list[str]:
    """One per rate."""
    complete = [fit for fit in fits if len(fit.rates) == case.states]
    told = sum(fit.told for fit in fits) / len(fits)
    made = []
    for i, state in enumerate(said["states"]):
        rates = np.array([fit.rates[i] for fit in complete])
        expected = state["rate_per_s_sigma"]
        enough = len(rates) > 2
        scatter = rates.std(ddof=1) if enough else np.nan
        own = np.median([fit.sigmas[i] for fit in complete]) if enough else np.nan
        made.append(
            f"{case.material:18}{case.name:20} k{i + 1} {state['rate_per_s']:.4f}"
            f" {expected:10.2e} {scatter:10.2e} × {scatter / expected:.2f}"
            f" {own:10.2e} × {own / expected:.2f}"
            f" {100 * said['chance_of_all_states']:5.0f} %{100 * told:5.0f} %"
        )
    return made


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=32)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", default="", help="materials that begin so")
    asked = parser.parse_args()
    materials: dict[str, Path] = {}
    print(f"{'':46} predicted    scatter  ratio      own σ  ratio   told: predicted, found")
    with tempfile.TemporaryDirectory() as place, ProcessPoolExecutor(asked.workers) as pool:
        for number, case in enumerate(CASES):
            if not case.material.startswith(asked.only):
                continue
            folder = Path(place) / str(number)
            folder.mkdir()
            if case.material not in materials:
                keys = {**PILOT, "states": case.states}
                pilot = Case(case.material, "pilot", case.states, keys)
                made = run(folder, pilot, PILOT_DAY)
                materials[case.material] = made / "result" / "material.yaml"
            said = predicted(folder, case, materials[case.material])
            fits = list(pool.map(partial(fitted, case), range(1, asked.days + 1)))
            print("\n".join(lines(case, said, fits)), flush=True)


if __name__ == "__main__":
    main()
