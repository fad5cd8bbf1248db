"""Excitation rates by lights that are selected one after another, from irradiance to rates.

    python -m tests.acceptance.selected_lights [--seeds 3] [--kinds filters leds]

For each way of selecting lights and each seed the room runs `irradiance` on the card and then
`excitation` on the sample, with nothing told of what is true. Filters differ by 1 % from their
files, the monochromator is 0.3 nm off, LEDs are skewed, and droop. Monochromator and LEDs are read
by a spectrometer; `fine` are 15 bands of 20 nm by the monochromator with a band of 20 nm, `narrow`
with one of 8 nm. In half of the runs excitation
is a smooth function of the wavelength, which the fit with its bands does not assume.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import read_material
from labrig.process import process_run
from labrig.protocols.excitation.result import ExcitationResult
from labrig.protocols.irradiance.result import IrradianceResult
from labrig.sim.kinetics import KineticsSettings
from labrig.sim.lamp import BURNING_K, filament_spectrum
from labrig.sim.phosphor import band_cells, phosphor
from tests.analyse.recorded import record
from tests.analyse.selected_lights import (
    BANDS_NM,
    FINE_BANDS_NM,
    QUICK,
    SELECTIONS,
    SITES,
    bench,
    recorded,
)

#: The room's lamp is so many times as bright as the irradiance to which Table 1's rates belong.
LAMP = 4.0
#: Rates in 1/s that are large enough for a deviation in per cent.
LARGE = 0.005


def run(folder: Path, kind: str, seed: int, excitation: str) -> tuple[list[float], list[float]]:
    """Return relative deviations of the large rates and deviations of all in σ."""
    read = kind in ("monochromator", "fine", "narrow", "leds")
    bands_nm = FINE_BANDS_NM if kind in ("fine", "narrow") else BANDS_NM
    card = {
        "protocol": "irradiance",
        "select": SELECTIONS[kind],
        "sites": list(SITES),
        "bands_nm": list(bands_nm),
    }
    light = record(folder / "card", card, bench(kind, has_spectrometer=read, seed=seed))
    assert isinstance(process_run(light), IrradianceResult)
    sample: dict[str, object] = {"material": "blue-paint", "region": [0.03, 0.1, 0.94, 0.8]}
    sample["kinetics"] = {"excitation": excitation}
    glow = recorded(folder / "glow", kind, light, seed=seed + 1000, sample=[sample])
    result = process_run(glow)
    assert isinstance(result, ExcitationResult)
    (patch,) = result.patches.values()
    ((k_e, sigma),) = [(state.k_e_per_s, state.k_e_per_s_sigma) for state in patch.fit.states]
    truth = LAMP * true_means(bands_nm, excitation)
    large = truth > LARGE
    pulls = (k_e - truth) / np.maximum(sigma, 1e-300)
    for warning in result.warnings:
        print(f"  {kind} {seed}: {warning}")
    return (k_e[large] / truth[large] - 1).tolist(), pulls[large | (k_e > 0)].tolist()


def true_means(bands_nm: Sequence[float], excitation: str) -> FloatArray:
    """Return the mean excitation rate over each band in the room, in 1/s."""
    material = read_material(str(QUICK["sample"]["name"]))
    kinetics = KineticsSettings.model_validate({"excitation": excitation})
    ((row),) = phosphor([material], [None], 1.0, [kinetics]).excitation
    cells = band_cells(bands_nm)
    norm = float(np.linalg.norm(cells @ filament_spectrum(BURNING_K)))
    return np.asarray(norm * (cells @ row) / cells.sum(axis=1))


def main() -> None:
    """Print the deviations of each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--rooms", nargs="+", default=["steps", "smooth"])
    parser.add_argument("--kinds", nargs="+", default=list(SELECTIONS), choices=list(SELECTIONS))
    options = parser.parse_args()
    for kind in options.kinds:
        for excitation in options.rooms:
            off, pulls = [], []
            for seed in range(options.first, options.first + options.seeds):
                with tempfile.TemporaryDirectory() as folder:
                    of_run = run(Path(folder), kind, seed, excitation)
                off += of_run[0]
                pulls += of_run[1]
            off_rms, pull_rms = (np.sqrt(np.mean(np.square(each))) for each in (off, pulls))
            print(
                f"{kind:14} {excitation:6} k_e off by {100 * off_rms:4.1f} % rms, "
                f"{100 * np.abs(off).max():4.1f} % at most; {np.abs(pulls).max():3.1f} σ at most, "
                f"rms {pull_rms:4.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
