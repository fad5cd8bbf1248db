"""Joint fits of decay and excitation: rates of all materials of Table 1, and whether σ is right.

    python -m tests.acceptance.excitation_rates [--seeds 40] [--material two-states]

Samples are charged by the simulated lamp and phosphor (a cooling filament) under the bare
lamp and through 12 windows of a linear variable filter; photographs flicker. First one fit of each
full material of Table 1: worst deviation in σ, worst of the bands that excite with 0.002 /s or
more in %. Then one material over many seeds: rms of deviation over σ (1 if σ is right), parameter
by parameter.
"""

import argparse

import numpy as np

from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.foundation.arrays import FloatArray
from labrig.material import Material, read_material
from labrig.results import FittedExcitation
from labrig.sim.lamp import WAVELENGTH_NM
from tests.fit.charged_samples import Bench, lvf_windows, two_states

TABLE_1 = ("blue", "green", "orange", "pink", "purple", "red", "white", "yellow")
CHARGES_S = (8, 16, 32, 64, 128, 256, 512)
LVF = lvf_windows(np.linspace(405, 695, 12))
STRONG_PER_S = 0.002
LAMP = 0.005


def run(material: Material, seed: int) -> tuple[FittedExcitation, Bench]:
    """One bench, measured and fitted."""
    bench = Bench(material, seed=seed)
    bare = bench.series(
        "bare lamp", np.ones((1, len(WAVELENGTH_NM))), [5400.0], shots=30, every_s=6.0
    )
    lvf = bench.series("through LVF", LVF, CHARGES_S)
    rates = np.array([state.k_r_per_s for state in material.states])
    uncertain = RelativeSigmas(bench.flicker, LAMP)
    return fit_excitation([bare, lvf], 1.1 * rates, bench.amplitudes(), uncertain), bench


def deviations(found: FittedExcitation, bench: Bench) -> FloatArray:
    """Return the deviations in σ of k_r, amplitude and k_e of every state in turn."""
    rows = []
    for state, truth, full in zip(
        found.states, bench.material.states, bench.amplitudes(), strict=True
    ):
        k_e = np.array(truth.k_e_per_s)
        rows += [
            (state.k_r_per_s - truth.k_r_per_s) / state.k_r_per_s_sigma,
            (state.amplitude - full) / state.amplitude_sigma,
            *((state.k_e_per_s - k_e) / state.k_e_per_s_sigma),
        ]
    return np.array(rows)


def table() -> None:
    """All materials, one seed."""
    print(
        f"{'material':<16}{'k_r / s':>10}{'σ':>10}{'r(0)':>8}{'σ':>8}{'max / σ':>9}{'k_e / %':>9}"
    )
    for name in TABLE_1:
        material = read_material(f"{name}-paint")
        found, bench = run(material, seed=1)
        (state,), (truth,) = found.states, material.states
        k_e = np.array(truth.k_e_per_s)
        strong = k_e >= STRONG_PER_S
        off = np.abs(state.k_e_per_s / np.where(strong, k_e, 1.0) - 1)[strong]
        worst = np.abs(deviations(found, bench)[: 2 + int(strong.sum())]).max()
        level = found.at_off[0]
        print(
            f"{name:<16}{state.k_r_per_s:>10.5f}{state.k_r_per_s_sigma:>10.5f}"
            f"{level.r0[0]:>8.3f}{level.r0_sigma[0]:>8.3f}{worst:>9.1f}{100 * off.max():>9.1f}"
        )


def main() -> None:
    """The tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--material", default="two-states")
    asked = parser.parse_args()
    table()
    material = two_states() if asked.material == "two-states" else read_material(asked.material)
    found = np.array([deviations(*run(material, seed)) for seed in range(asked.seeds)])
    print(f"\n{material.name}, {asked.seeds} seeds: rms and mean of deviation / σ")
    bands = len(material.bands_nm or ()) - 1
    names = ["k_r", "Λ", *(f"k_e {band}" for band in range(1, bands + 1))]
    for state in range(len(material.states)):
        of_state = found[:, state * len(names) : (state + 1) * len(names)]
        for name, column in zip(names, of_state.T, strict=True):
            print(
                f"state {state + 1}  {name:<8}{np.sqrt((column**2).mean()):>6.2f}"
                f"{column.mean():>+7.2f}"
            )


if __name__ == "__main__":
    main()
