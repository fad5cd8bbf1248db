"""Are luminances of a run as wrong as their σ says? Errors in σ over many seeds.

    python -m tests.acceptance.luminance_pulls [--seeds 50]

Each seed is a run of the protocol `luminance` in a simulated room of 64 x 48 pixels, from the lamp
to the marking, held against the luminances of the room. The seed draws the camera's curves and all
noise, the error of the luxmeter's reading (3 %) and of the card's reflectance (1 %), and the
emission: a band between 490 and 550 nm, 60 to 100 nm wide, which every second run knows. The traps
obey in turn: forty exponentials, general order 1.5 and 2.5, one trap with retrapping, an
exponential distribution of depths; the analysis assumes none of these laws.

Per quantity: rms of error over σ (1 if σ is right), mean of it, median relative σ, and how many
runs have it.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from labrig.acquire import read_rig_file
from labrig.protocols.luminance.analysis import analyse
from labrig.results import VISIBLE_MCD_PER_M2
from tests.analyse.luminance_bench import (
    QUICK,
    luminance_after,
    record,
    true_luminance,
    write_glow,
    write_rig,
)
from tests.analyse.recorded import part_of

#: Laws of the traps; None: the forty exponentials of the shipped power law.
LAWS: tuple[dict[str, Any] | None, ...] = (
    None,
    {"model": "general_order", "order": 1.5},
    {"model": "general_order", "order": 2.5},
    {"model": "otor", "retrapping": 0.5},
    {"model": "trap_depths", "shape": "exponential", "width_ev": 0.04},
)
READING, CARD = 0.03, 0.01
#: Luminance at 60 min that every sample has, in mcd/m².
AT_60_MIN = 0.7
HOUR_S = 3600.0
EVERYWHERE = [0.0, 0.0, 1.0, 1.0]


def campaign_run(seed: int, folder: Path) -> Iterator[tuple[str, float, float]]:
    """Run one seed; yield name, error over σ and relative σ of every quantity that it measured."""
    rng = np.random.default_rng([seed, 2026])
    law = LAWS[seed % len(LAWS)]
    band_nm = (rng.uniform(490, 550), rng.uniform(60, 100))
    known = seed % 2 == 0
    one = {"region": EVERYWHERE} | ({} if law is None else {"kinetics": law})
    glow = write_glow(folder, 1.0, band_nm, one_trap=law is not None)
    rig = write_rig(folder, sample=[one | {"material": str(glow)}])
    unit = luminance_after(read_rig_file(rig), [HOUR_S], 0.0, 600.0, 300.0)[0, 0]
    write_glow(folder, AT_60_MIN / unit, band_nm, one_trap=law is not None)
    run = record(
        folder,
        QUICK | {"longest": "30 s"} | ({"emission": str(glow)} if known else {}),
        reading={"value": f"{1000 * (1 + READING * rng.standard_normal()):.6g} lx"},
        sample=[one | {"material": str(glow)}],
        seed=seed,
        grey_card=0.18 * (1 + CARD * rng.standard_normal()),
    )
    result = analyse(part_of(run))
    (patch,) = result.patches.values()
    decay = patch.decay
    measured = {entry.t_s: entry.luminance for entry in decay.at}
    about_s = 1.0 if decay.visible_s is None else decay.visible_s.value
    times_s = sorted([600.0, HOUR_S, *(about_s * np.geomspace(0.7, 1.4, 15))])
    true = true_luminance(run)(times_s)[:, 0]
    logs = np.log(true)
    for name, t_s in (("L10", 600.0), ("L60", HOUR_S)):
        light = measured[t_s]
        if light is not None:
            exact = float(np.exp(np.interp(np.log(t_s), np.log(times_s), logs)))
            yield name, (light.value - exact) / light.sigma, light.sigma / light.value
    if decay.visible_s is not None:
        falling = -np.log(VISIBLE_MCD_PER_M2)
        end_s = float(np.exp(np.interp(falling, -logs, np.log(times_s))))
        sigma = decay.visible_s.sigma
        yield "t0.3", (decay.visible_s.value - end_s) / sigma, sigma / end_s
    for line in result.warnings:
        print(f"seed {seed}: {line}", flush=True)
    laws = "forty exponentials" if law is None else str(law["model"])
    kind = "known" if known else "estimated"
    print(f"seed {seed}: {laws}, {kind}, {decay.marking}", flush=True)


def main() -> None:
    """Print the pulls."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    pulls: dict[str, list[tuple[float, float]]] = {}
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        with tempfile.TemporaryDirectory() as folder:
            for name, pull, sigma in campaign_run(seed, Path(folder)):
                pulls.setdefault(name, []).append((pull, sigma))
                kind = "emission known" if seed % 2 == 0 else "emission estimated"
                pulls.setdefault(f"{name}, {kind}", []).append((pull, sigma))
    print("\nquantity                     rms   mean  median σ  runs")
    for name in sorted(pulls):
        pull, sigma = np.array(pulls[name]).T
        rms = np.sqrt(np.mean(np.square(pull)))
        print(f"{name:26}{rms:6.2f} {pull.mean():6.2f} {np.median(sigma):9.2%} {len(pull):5}")


if __name__ == "__main__":
    main()
