"""Trap models against what an excitation run on the simulated rig predicts of charge and decay.

    python -m tests.acceptance.trap_models [NAME ...] [--keep DIR] [--orders auto 1]

Samples whose traps obey other laws than the rate equation are measured by the protocol `excitation`
on the shipped simulated rig, with the light on the sample known and the lamp's fade measured. From
the material file alone, charging under the white lamp from the dark and the decay after 15 minutes
of it are predicted, relative to the glow 1 s after that charge, and compared with the room's own
traps: predicted over true − 1 in %, and in σ of the prediction. `told` says whether the run warns.
A row is `good` if all of its numbers are within 2 % or 3 σ and the run does not warn, `doubted` if
it warns, and else, or if an infinite σ makes numbers good, `told` if the run warns. Each material
is processed with the order that the data choose and with the first order held.
"""

import argparse
import json
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labrig.analyse import Overrides
from labrig.calibration import FADE_KIND, Change, FadeFile, Warming
from labrig.calibration.irradiance_file import IRRADIANCE_KIND
from labrig.foundation.arrays import FloatArray
from labrig.material import (
    Material,
    dark_concentration,
    lit_concentration,
    mean_emission,
    read_material,
)
from labrig.process import process_and_report
from labrig.protocols.excitation.result import ExcitationResult
from labrig.sim.kinetics import KineticsSettings
from labrig.sim.lamp import BURNING_K, Lamp, filament_spectrum
from labrig.sim.phosphor import band_cells, phosphor
from labrig.sim.simulation import LampSettings
from tests.analyse.excitation.bench import HEIGHT, true_irradiance
from tests.analyse.recorded import record

WIDTH = 384
PROTOCOL: dict[str, Any] = {
    "protocol": "excitation",
    "growth": "10 %",
    "at_most": 6,
    "refine": 1,
    "direct": ["3 s", "10 s", "1 min", "15 min"],
    "last_decay": "180 s",
    "rest": {"at_least": "1 min", "at_most": "10 min"},
}
#: Brightness of the room's lamp in multiples of the irradiance to which a material's rates belong.
LAMP = 4.0
#: Relative σ of the lamp from one charge to the next, as the analysis takes it.
LAMP_SIGMA = 0.01
FULL_CHARGE_S = 900.0
CHARGES_S = (5.0, 30.0, 120.0)
DECAYS_S = (5.0, 30.0, 90.0, 180.0)
#: Start of a photograph after lamp off, and its length, in seconds.
FIRST_S, EXPOSURE_S = 1.0, 0.5
PERCENT, SIGMAS = 2.0, 3.0
STEP = 1e-4
#: Steps of the lamp's transients.
STEPS = 64


@dataclass(frozen=True)
class Case:
    """A material whose traps obey a law."""

    name: str
    material: str
    kinetics: dict[str, Any] | None
    seed: int


CASES = (
    Case("first-order", "blue-paint", None, 11),
    Case("two-states", "double-medium-bright", None, 12),
    Case("order-1.5", "blue-paint", {"model": "general_order", "order": 1.5}, 13),
    Case("order-2", "green-paint", {"model": "general_order", "order": 2.0}, 14),
    Case("two-of-1.5", "double-medium-bright", {"model": "general_order", "order": 1.5}, 15),
    Case("otor-0.5", "blue-paint", {"model": "otor", "retrapping": 0.5}, 16),
    Case("otor-0.05", "blue-paint", {"model": "otor", "retrapping": 0.05}, 17),
    Case(
        "gaussian-depths",
        "blue-paint",
        {"model": "trap_depths", "shape": "gaussian", "width_ev": 0.03},
        18,
    ),
    Case(
        "exponential-depths",
        "blue-paint",
        {"model": "trap_depths", "shape": "exponential", "width_ev": 0.03},
        19,
    ),
)


@dataclass(frozen=True)
class SteadyLamp:
    """The room's lamp as it burns, switched without any transient."""

    off_s: float

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the time of lamp off if it lies within."""
        return [self.off_s] if start_s < self.off_s < end_s else []

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether the lamp is off."""
        return start_s >= self.off_s

    def irradiance(self, time_s: FloatArray) -> FloatArray:
        """Return the spectrum at every time."""
        return np.outer(time_s < self.off_s, filament_spectrum(BURNING_K))


def true_fade() -> FadeFile:
    """Return what a fade run without error would find on the shipped rig."""
    bands_nm = read_material("blue-paint").bands_nm
    assert bands_nm is not None
    cells, lamp = band_cells(bands_nm), LampSettings()
    steady = cells @ filament_spectrum(BURNING_K)

    def change(on: bool, end_s: float) -> Change:
        t_s = np.linspace(0.0, end_s, STEPS + 1)
        cold = lamp.model_copy(update={"warm_up_deficit": 0.0})
        switched = Lamp.found(cold, on=not on).switched(on, 0.0)
        rows = [tuple(cells @ switched.irradiance(t) / steady) for t in t_s]
        return Change(
            t_s=tuple(t_s), fraction=tuple(rows), sigma=(len(steady) * (0.0,),) * len(t_s)
        )

    warming = Warming(
        deficit=lamp.warm_up_deficit, deficit_sigma=0.002, time_constant_s=lamp.warm_up
    )
    return FadeFile(
        bands_nm=bands_nm, fade=change(False, 0.5), rise=change(True, 1.0), warming=warming
    )


def true_glow(case: Case, charge_s: float, dark_s: float) -> float:
    """Return the glow of the room's traps after a charge from empty, mean over a photograph."""
    material = read_material(case.material)
    settings = None if case.kinetics is None else KineticsSettings.model_validate(case.kinetics)
    traps = phosphor([material], [None], LAMP, [settings])
    lamp, begin_s = SteadyLamp(charge_s), charge_s + dark_s
    empty = np.zeros(len(traps.k_r_per_s))
    level, _ = traps.evolve(empty, 0.0, charge_s, lamp)
    level, _ = traps.evolve(level, charge_s, begin_s, lamp)
    _, exposure_s = traps.evolve(level, begin_s, begin_s + EXPOSURE_S, lamp)
    state, share = np.arange(len(empty)), np.ones(len(empty))
    if traps.traps is not None:
        state, share = traps.traps.state, traps.traps.share
    radiated = np.array([sum(each.reradiation or (1.0,)) for each in material.states])
    return float((radiated[state] * share * traps.k_r_per_s) @ exposure_s)


POINTS = [(charge_s, FIRST_S) for charge_s in CHARGES_S] + [
    (FULL_CHARGE_S, dark_s) for dark_s in DECAYS_S
]


def true_ratios(case: Case) -> FloatArray:
    """Return the true glow of all points over that after the full charge."""
    full = true_glow(case, FULL_CHARGE_S, FIRST_S)
    return np.array([true_glow(case, *point) for point in POINTS]) / full


def predicted_ratios(material: Material, fit: dict[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Return the glow of all points over that after the full charge, and its relative σ."""
    direct = np.array(true_irradiance(WIDTH).direct)
    n, b = len(material.states), len(direct)
    order = np.array([state.kinetic_order for state in material.states])
    k_e = np.array([state.k_e_per_s for state in material.states])
    full = np.array([state["amplitude_at_full_charge"] for state in fit["states"]])
    k_r = np.array([state.k_r_per_s for state in material.states])
    covariance = np.array(fit["covariance"], dtype=np.float64)
    is_fitted = len(covariance) > n * (2 + b)

    def glow(theta: FloatArray, charge_s: float, dark_s: float) -> float:
        rate, amplitude = theta[:n], theta[n : 2 * n]
        own = theta[-1 - n : -1] if is_fitted else order
        kappa = theta[2 * n : n * (2 + b)].reshape(n, b) @ direct * np.exp(theta[-1])
        level = lit_concentration(0.0, np.maximum(kappa, 1e-12), rate, own, charge_s)
        begin = dark_concentration(level, rate, own, dark_s)
        return float(amplitude @ mean_emission(begin, rate, own, EXPOSURE_S).value)

    def log_ratios(theta: FloatArray) -> FloatArray:
        whole = glow(theta, FULL_CHARGE_S, FIRST_S)
        return np.log([glow(theta, *point) / whole for point in POINTS])

    theta = np.concatenate([k_r, full, k_e.ravel(), order if is_fitted else [], [0.0]])
    steps = np.diag(np.maximum(STEP * np.abs(theta), 1e-9))
    slopes = np.array(
        [(log_ratios(theta + h) - log_ratios(theta - h)) / (2 * h.sum()) for h in steps]
    )
    variance = np.einsum("ip,ij,jp->p", slopes[:-1], covariance, slopes[:-1])
    return np.exp(log_ratios(theta)), np.sqrt(variance + (LAMP_SIGMA * slopes[-1]) ** 2)


def recorded(case: Case, folder: Path) -> Path:
    """Return the folder of the case's run, recorded unless it is there."""
    runs = folder / case.name / "runs"
    if runs.is_dir():
        return next(runs.iterdir())
    place = folder / case.name
    place.mkdir(parents=True)
    IRRADIANCE_KIND.write(place, true_irradiance(WIDTH))
    FADE_KIND.write(place, true_fade())

    def change(rig: dict[str, Any]) -> None:
        sample: dict[str, Any] = {"material": case.material, "region": [0.03, 0.1, 0.94, 0.8]}
        if case.kinetics is not None:
            sample["kinetics"] = case.kinetics
        rig["optics"]["irradiance"] = str(place / "irradiance.yaml")
        rig["optics"]["fade"] = str(place / "fade.yaml")
        rig["simulation"] |= {
            "sample": [sample],
            "seed": case.seed,
            "sensor": {"width": WIDTH, "height": HEIGHT},
        }
        rig["devices"]["lamp"]["warm_up"] = "0 s"

    return record(place, PROTOCOL | {"sample": {"name": case.material}}, change)


def row(case: Case, run: Path, order: str) -> bool:
    """Print one material's deviations; return whether they are right."""
    began = time.monotonic()
    done = process_and_report(run, Overrides(options={"order": order}))
    assert isinstance(done.result, ExcitationResult)
    (patch,) = done.result.patches.values()
    fit = json.loads((run / "result" / "excitation.json").read_text())
    predicted, sigma = predicted_ratios(read_material(run / "result" / "material.yaml"), fit)
    off = predicted / true_ratios(case) - 1
    pulls = off / sigma
    closure = patch.closure
    told = len(patch.fit.warnings) + (closure is not None and closure.rms_sigma > SIGMAS)
    is_good = bool(np.all((np.abs(off) < PERCENT / 100) | (np.abs(pulls) < SIGMAS)))
    orders = ", ".join(f"{state.kinetic_order:.2f}" for state in patch.fit.states)
    cells = " ".join(f"{100 * o:+7.1f} ({p:+5.1f})" for o, p in zip(off, pulls, strict=True))
    is_known = bool(np.all(np.isfinite(sigma) & (sigma < 1)))
    if is_good and is_known:
        verdict = "doubted" if told else "good"
    else:
        verdict = "told" if told else "WRONG"
    print(
        f"{case.name:19}{order:5} b {orders:11} χ² {patch.fit.reduced_chi2:6.2f} {cells}  "
        f"told {told}  {verdict}  {time.monotonic() - began:.0f} s",
        flush=True,
    )
    for line in patch.fit.warnings:
        print(f"    ! {line}")
    return verdict != "WRONG"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="of the cases; all by default")
    parser.add_argument("--keep", type=Path, help="folder of the runs, which are used again")
    parser.add_argument("--orders", nargs="*", default=["auto", "1"])
    asked = parser.parse_args()
    folder = asked.keep or Path(tempfile.mkdtemp())
    heads = [f"charge {s:g} s" for s in CHARGES_S] + [f"decay {s:g} s" for s in DECAYS_S]
    print(f"predicted over true − 1 in % (in σ): {', '.join(heads)}")
    right = [
        row(case, recorded(case, folder.resolve()), order)
        for case in CASES
        if not asked.names or case.name in asked.names
        for order in asked.orders
    ]
    print(f"{sum(right)} of {len(right)} rows are right")


if __name__ == "__main__":
    main()
