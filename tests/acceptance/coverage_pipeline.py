"""Do the uncertainties of `labrig run` mean what they say? From lamp to fit, over many seeds.

    python -m tests.acceptance.coverage_pipeline [--seeds 500] [--jobs 2] [--scenario NAME ...]
        [--keep FOLDER]

Each seed is a run of the command line in a simulated dark room of 96 x 64 pixels with several
samples in one charge: room, RAW files over the simulated USB, journal, reduction; each sample is
then fitted as if it were alone. The seed draws camera curves, hot pixels and all noise. Runs kept
in a folder are not made again. Waiting for the disk takes most of the time: TMPDIR=/dev/shm helps.

Per scenario and state: share of rates within 1 and 2 σ (68.3 and 95.4 % if σ is right), bias,
rms(σ)/rms(error), rms(error) over the Cramér–Rao bound of the true noise, wrong numbers of states.
"""

import argparse
import contextlib
import io
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.analyse import Overrides, fit_series
from labrig.analyse.frames import intact_frames
from labrig.cli.exit_codes import guarded
from labrig.fit import DecayFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.region import Region
from labrig.material import read_material
from labrig.record import RunRecord, read_run
from labrig.reduce import reduce_patches
from labrig.results import Series
from tests.acceptance.cramer_rao import Noise, rate_bound
from tests.acceptance.decays_of_all_materials import shipped_rig
from tests.real_data import SHARED

SENSOR = {"width": 96, "height": 64}
OTHER_CURVES = (
    SHARED / "camera_sensitivity/ampas_rawtoaces_2017/canon_eos_5d_mark_ii_380_780_5.json"
)
#: Where samples lie, and what of them is measured.
PLACES: tuple[Region, ...] = tuple(
    (x, y, 0.46, 0.44) for x, y in ((0.02, 0.03), (0.52, 0.03), (0.02, 0.53))
)
PATCHES: tuple[Region, ...] = tuple((x + 0.04, y + 0.04, 0.38, 0.36) for x, y, _, _ in PLACES)
EXPONENTIAL = ("blue-paint", "double-medium-bright", "double-close-even")


@dataclass(frozen=True)
class Scenario:
    """The samples in the room, and the faults of its devices."""

    name: str
    sensor: dict[str, Any] = field(default_factory=dict)
    lamp: dict[str, Any] = field(default_factory=dict)
    protocol: dict[str, Any] = field(default_factory=dict)
    samples: tuple[str, ...] = EXPONENTIAL
    brightness: float = 1.0

    @property
    def noise(self) -> Noise:
        """Return the sensor's noise, for the bound."""
        known = {one.name for one in fields(Noise)}
        told = {key: value for key, value in self.sensor.items() if key in known}
        return Noise(**SENSOR, **told)

    @property
    def patches(self) -> dict[str, Region]:
        """Return the region of each sample."""
        return dict(zip(self.samples, PATCHES, strict=False))


SCENARIOS = [
    Scenario("baseline, flicker 0.7 %"),
    Scenario("flicker 2 %", {"flicker": 0.02}),
    Scenario("steady light", {"flicker": 0.0}),
    Scenario(
        "lamp drifts by 3 %/h, two decays",
        lamp={"drift_per_hour": 0.03, "warm_up_deficit": 0.1},
        protocol={"repeats": 2},
    ),
    Scenario("crosstalk 3 %", {"crosstalk": 0.03}),
    Scenario("rows share 0.3 read noise", {"row_noise": 0.3}),
    Scenario(
        "all of it: flicker, drift, crosstalk, rows",
        {"crosstalk": 0.03, "row_noise": 0.3},
        {"drift_per_hour": 0.03, "warm_up_deficit": 0.1},
        {"repeats": 2},
    ),
    Scenario("another laboratory's curves", {"curves": str(OTHER_CURVES)}),
    Scenario("power law", samples=("power-law",)),
    Scenario("faint", brightness=0.03),
    Scenario("cut off at black", {"subtracts_black": True}),
    Scenario("cut off at black, faint", {"subtracts_black": True}, brightness=0.03),
]


@dataclass(frozen=True)
class Outcome:
    """A sample's series and fit (None: refused), and the bound on each rate."""

    fit: DecayFit | None
    bound: FloatArray
    series: Series


def measured(scenario: Scenario, keep: Path | None, seed: int) -> dict[str, Outcome]:
    """One run, kept in a folder if there is one for it, and its fits, by sample.

    Raises
    ------
    RuntimeError
        The run failed.
    """
    if keep is not None:
        return fitted(scenario, recorded(scenario, seed, keep / scenario.name / str(seed)))
    with tempfile.TemporaryDirectory() as folder:
        return fitted(scenario, recorded(scenario, seed, Path(folder)))


def recorded(scenario: Scenario, seed: int, folder: Path) -> RunRecord:
    """The run in `folder`, made if it is not there."""
    done = folder / "runs"
    if not done.exists():
        made = folder / "made"
        shutil.rmtree(made, ignore_errors=True)  # of a seed that was interrupted
        made.mkdir(parents=True)
        _run(scenario, seed, made)
        (made / "runs").rename(done)
    (run,) = map(read_run, done.iterdir())
    return run


def _run(scenario: Scenario, seed: int, folder: Path) -> None:
    rig = shipped_rig(
        "sim",
        sample=[
            {"material": sample, "region": list(place), "brightness": scenario.brightness}
            for sample, place in zip(scenario.samples, PLACES, strict=False)
        ],
        sensor=SENSOR | scenario.sensor,
        lamp=scenario.lamp,
        seed=seed,
    )
    protocol = {"protocol": "decay", "sample": {"name": "samples"}, "exposure": "auto"}
    protocol["patches"] = {key: list(region) for key, region in scenario.patches.items()}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol | scenario.protocol))
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = guarded(
            ["run", f"{folder}/protocol.yaml", "--rig", f"{folder}/rig.yaml",
             "--runs", f"{folder}/runs", "--no-process"]
        )  # fmt: skip
    if code:
        raise RuntimeError(f"seed {seed} ended with {code}: {said.getvalue()}")


def fitted(scenario: Scenario, run: RunRecord) -> dict[str, Outcome]:
    """The run's fits, by sample."""
    frames = intact_frames(run, Overrides())
    darks_s = [dark.exposure_s for dark in frames.dark]
    series = reduce_patches(frames.decay, scenario.patches, frames.dark)
    return {
        sample: Outcome(
            _fit(one),
            rate_bound(one, darks_s, true_rates(sample), scenario.noise, scenario.patches[sample])
            if sample in EXPONENTIAL
            else np.zeros(0),
            one,
        )
        for sample, one in series.items()
    }


def _fit(series: Series) -> DecayFit | None:
    try:
        return fit_series(series)
    except FitError:
        return None


def true_rates(sample: str) -> list[float]:
    """Return the true rates in 1/s, the fastest first."""
    return sorted((state.k_r_per_s for state in read_material(sample).states), reverse=True)


def lines(sample: str, outcomes: Sequence[Outcome]) -> Iterator[str]:
    """A line per state."""
    true = np.array(true_rates(sample))
    right = [one for one in outcomes if one.fit is not None and one.fit.n_states == len(true)]
    wrong = len(outcomes) - len(right)
    fits = [one.fit for one in right if one.fit is not None]
    found = np.array([[state.k_r_per_s for state in fit.states] for fit in fits])
    sigma = np.array([[state.k_r_per_s_sigma for state in fit.states] for fit in fits])
    bound = np.array([one.bound for one in right])
    error = found - true
    pull = error / sigma
    n = len(fits)

    def fraction(k: int, sigmas: float) -> str:
        inside = float(np.mean(np.abs(pull[:, k]) < sigmas))
        return f"{100 * inside:5.1f} ± {100 * np.sqrt(inside * (1 - inside) / n):.1f}"

    for k, rate in enumerate(true):
        rms = float(np.sqrt(np.mean(error[:, k] ** 2)))
        yield (
            f"{sample:21} {rate:<6g} {wrong:4d}  {fraction(k, 1)}  {fraction(k, 2)}  "
            f"{pull[:, k].mean():+.2f} ± {pull[:, k].std() / np.sqrt(n):.2f}  "
            f"{100 * error[:, k].mean() / rate:+6.3f}  {100 * rms / rate:6.2f}  "
            f"{np.sqrt(np.mean(sigma[:, k] ** 2)) / rms:5.2f}  "
            f"{rms / np.sqrt(np.mean(bound[:, k] ** 2)):5.2f}  {np.abs(pull[:, k]).max():4.1f}"
        )


HEAD = (
    f"{'sample':21} {'k /s':6} {'n≠':>4}  {'1 σ / %':>11}  {'2 σ / %':>11}  {'bias / σ':>12}  "
    f"{'/ %':>6}  {'rms/%':>6}  {'σ/rms':>5}  {'/CRB':>5}  max"
)


def report(scenario: Scenario, outcomes: Sequence[dict[str, Outcome]]) -> Iterator[str]:
    """The scenario's table."""
    yield f"\n{scenario.name}: {len(outcomes)} seeds"
    if scenario.samples == EXPONENTIAL:
        yield HEAD
    for sample in scenario.samples:
        of_sample = [one[sample] for one in outcomes]
        fits = [one.fit for one in of_sample if one.fit is not None]
        if sample in EXPONENTIAL:
            yield from lines(sample, of_sample)
            chi2 = np.mean([fit.reduced_chi2 for fit in fits])
            rho = 100 * np.array([fit.flicker for fit in fits])
            warned = 100 * np.mean([bool(fit.warnings) for fit in fits])
            yield (
                f"{'':21} reduced χ² {chi2:.3f}, ρ {rho.mean():.3f} ± {rho.std():.3f} %, "
                f"warned {warned:.1f} %"
            )
        else:
            law = sample.replace("-", " ")
            flagged = sum(
                warning.code == "rates-descriptive" and law in warning.values["law"]
                for fit in fits
                for warning in fit.warnings
            )
            yield f"{sample:21} flagged as such {flagged} of {len(outcomes)}"


def main() -> None:
    """Run what is asked, print as it comes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scenario", nargs="*", help="the beginning of their names; all")
    parser.add_argument("--keep", type=Path, help="where runs are kept, and looked for")
    asked = parser.parse_args()
    with ProcessPoolExecutor(asked.jobs) as pool:
        for scenario in SCENARIOS:
            if asked.scenario and not scenario.name.startswith(tuple(asked.scenario)):
                continue
            seeds = range(1, asked.seeds + 1)
            outcomes = list(pool.map(partial(measured, scenario, asked.keep), seeds, chunksize=4))
            print(*report(scenario, outcomes), sep="\n", flush=True)


if __name__ == "__main__":
    main()
