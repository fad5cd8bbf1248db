"""Are the figures of a lamp's fade as wrong as their σ says? Errors in σ over many lamps.

    python -m tests.acceptance.fade_pulls [--seeds 100]

Each seed is a run of the shipped protocol `fade`, of two passes, in a simulated room of 96 x 64
pixels with a lamp of its own, held against that lamp. The seed draws the camera's curves and all
noise; the filament's mass, how much of its heat is conducted, its heat capacity when cold, the
powers of the temperature with which it radiates and its resistance grows; by how much the
shutter's lag differs from that in the rig file (6 ms); and how much light a cold housing lacks,
and for how long.

Per time after the switch, in three bands: rms of error over σ (1 if σ is right), and median σ in
per cent of the steady light. Then the same of the light in each frame (σ in per cent of it), of the
wavelength's exponent (which is 1), and of what a cold housing lacks.
"""

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.process import process_run
from labrig.protocols.fade.result import SwitchedFrames
from labrig.sim import lamp as room_lamp
from labrig.sim.optics import bent_curves
from labrig.sim.room import CURVES_STREAM
from labrig.sim.simulation import LampSettings
from tests.analyse.recorded import record

PROTOCOL = {"protocol": "fade", "sample": {"name": "lamp"}, "passes": 2}
#: Times after the switch in ms at which the tables are looked at, and bands of theirs.
TIMES_MS = {"fade": (5, 20, 60, 120, 200), "rise": (20, 60, 120, 250, 400)}
BANDS = {410: 1, 550: 8, 690: 15}
LAG_S = 0.06
#: How late the room's shutter opens by its own clock, the relay's switching being early by its.
LATE_S = 5.3e-3


def drawn_lamp(rng: np.random.Generator) -> dict[str, Any]:
    """Return constants of the room's lamp."""
    return {
        "FILAMENT_S": room_lamp.FILAMENT_S * np.exp(0.2 * rng.standard_normal()),
        "CONDUCTED": rng.uniform(0.35, 0.75),
        "COLD_HEAT_CAPACITY": float(np.clip(rng.normal(0.58, 0.1), 0.4, 0.8)),
        "RADIATION_EXPONENT": rng.normal(5.0, 0.2),
        "RESISTANCE_EXPONENT": rng.normal(1.2, 0.1),
    }


def true_fractions(edges_nm: FloatArray, t_s: FloatArray, *, rises: bool) -> FloatArray:
    """Return the light of the room's lamp after a switch over that of the steady one, by band."""
    switched = room_lamp.Lamp.found(LampSettings(warm_up_deficit=0, drift_per_hour=0), not rises)
    light = switched.switched(rises, 10.0).irradiance(10.0 + t_s)
    nm = room_lamp.WAVELENGTH_NM
    inside = (edges_nm[:-1, np.newaxis] < nm) & (edges_nm[1:, np.newaxis] > nm)
    fractions: FloatArray = (light @ inside.T) / (inside @ room_lamp.BURNING_SPECTRUM)
    return fractions


def true_light_s(
    frames: SwitchedFrames, begin_s: FloatArray, curves: FloatArray, *, rises: bool
) -> FloatArray:
    """Return what exposures of that length from then on see of the lamp, over the steady lamp's."""
    found = room_lamp.Lamp.found(LampSettings(warm_up_deficit=0, drift_per_hour=0), not rises)
    switched = found.switched(rises, 10.0)
    spans = zip(10 + begin_s, 10 + begin_s + frames.exposure_s, strict=True)
    exposures = np.array([switched.exposure(begin, end) for begin, end in spans])
    light_s: FloatArray = exposures @ curves.T / (curves @ room_lamp.BURNING_SPECTRUM)
    return light_s


def errors(seed: int, folder: Path) -> Iterator[tuple[str, float, float]]:
    """Run one seed; yield names, errors over σ and σ."""
    rng = np.random.default_rng([seed, 2611])
    lag_s, deficit = LAG_S + 6e-3 * rng.standard_normal(), rng.uniform(0.015, 0.045)

    def of_seed(rig: dict[str, Any]) -> None:
        rig["simulation"]["seed"] = seed
        rig["devices"]["camera"]["shutter_lag"] = f"{1e3 * lag_s:.3f} ms"
        rig["simulation"]["lamp"] = {
            "warm_up_deficit": f"{100 * deficit:.4f} %",
            "warm_up": f"{150 * np.exp(0.4 * rng.standard_normal()):.1f} s",
        }

    curves = bent_curves(np.random.default_rng([seed, CURVES_STREAM])).sensitivity
    room_lamp._settling.cache_clear()
    with patch.multiple(room_lamp, **drawn_lamp(rng)):
        result: Any = process_run(record(folder, PROTOCOL, of_seed))
        file = result.calibration
        for role, table, change in (
            ("fade", file.fade, result.fade),
            ("rise", file.rise, result.rise),
        ):
            t_s = np.array(TIMES_MS[role]) / 1e3
            rises = role == "rise"
            truth = true_fractions(np.array(file.bands_nm), t_s, rises=rises)
            for nm, band in BANDS.items():
                fraction, sigma = (
                    np.interp(t_s, table.t_s, np.array(rows)[:, band], right=right)
                    for rows, right in ((table.fraction, float(rises)), (table.sigma, np.nan))
                )
                for k, t_ms in enumerate(TIMES_MS[role]):
                    if np.isfinite(sigma[k]):
                        off = (fraction[k] - truth[k, band]) / sigma[k]
                        yield f"{role} {t_ms} ms, {nm} nm", float(off), float(100 * sigma[k])
            begin_s = change.frames.start_s + LATE_S + LAG_S - lag_s
            light_s = true_light_s(change.frames, begin_s, curves, rises=rises)
            for off, sigma in zip(
                ((change.frames.light_s - light_s) / change.frames.light_sigma_s).ravel().tolist(),
                (change.frames.light_sigma_s / change.frames.light_s).ravel().tolist(),
                strict=True,
            ):
                yield f"{role}, single frames", off, 100 * sigma
            p = change.exponent
            yield f"{role} exponent", (p.value - 1) / p.sigma, p.sigma
        warming = file.warming
        off = (warming.deficit - deficit) / warming.deficit_sigma
        yield "cold housing", off, 100 * warming.deficit_sigma


def main() -> None:
    """Print a line for every quantity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    asked = parser.parse_args()
    pulls, sigmas = defaultdict[str, list[float]](list), defaultdict[str, list[float]](list)
    for seed in range(1, asked.seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            for name, off, sigma in errors(seed, Path(folder)):
                pulls[name].append(off)
                sigmas[name].append(sigma)
    print(f"{'':26}rms/σ   mean  median σ  runs")
    for name, all_off in pulls.items():
        print(
            f"{name:26}{_rms(all_off):5.2f}  {np.mean(all_off):+5.2f}"
            f"  {np.median(sigmas[name]):8.3f}  {len(all_off):4}"
        )
    for role in TIMES_MS:
        tables = [pulls[name] for name in pulls if name.startswith(role) and " ms" in name]
        everything = [one for table in tables for one in table]
        print(f"{role}, all of the above: {_rms(everything):.2f}")


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    main()
