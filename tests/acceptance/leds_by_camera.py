"""The light of narrow LEDs by a camera alone: its deviations from the room's, and their coverage.

    python -m tests.acceptance.leds_by_camera [--seeds 12] [--first 200]

Every room has a camera of its own, whose curves differ from the published ones that the analysis
takes by 2 to 6 % of their peak, as those of three laboratories do; every fourth room has the curves
that another laboratory measured of the same model. LEDs are skewed, which the analysis knows not.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.process import process_run
from labrig.protocols.irradiance.result import IrradianceResult
from tests.analyse.lvf_calibration.room_truth import simulation_of
from tests.analyse.recorded import record
from tests.analyse.selected_lights import BANDS_NM, LED_NAMES, SITES, bench, true_light
from tests.real_data import SHARED

CURVES = SHARED / "camera_sensitivity"
ANOTHER_LABORATORY = CURVES / "ampas_rawtoaces_2017/canon_eos_5d_mark_ii_380_780_5.json"
KEYS = {
    "protocol": "irradiance",
    "select": {"leds": list(LED_NAMES)},
    "sites": list(SITES),
    "bands_nm": list(BANDS_NM),
    "rounds": 1,
    "repeats": 1,
    "longest": "4 s",
}


def deviations(folder: Path, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return the relative deviations of all lights in a room, and their σ."""
    sensor: dict[str, object] = {"width": 48, "height": 32}
    if seed % 4 == 0:
        sensor["curves"] = str(ANOTHER_LABORATORY)
    run = record(folder, KEYS, bench("leds", seed=seed, sensor=sensor))
    result = process_run(run)
    assert isinstance(result, IrradianceResult)
    file = result.calibration
    true = true_light("leds", simulation_of(run))
    found, expected = (np.array(each.through).sum(axis=1) for each in (file, true))
    sigma = np.array(file.ratio_sigma) / np.array(file.ratio)
    return found / expected - 1, sigma


def main() -> None:
    """Print the deviations of each light, and how often σ covers them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--first", type=int, default=200)
    options = parser.parse_args()
    rows = []
    for seed in range(options.first, options.first + options.seeds):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(deviations(Path(folder), seed))
    off, sigma = np.array(rows).transpose(1, 0, 2)
    pulls = off / sigma
    for number, name in enumerate(LED_NAMES):
        own, pull_rms = off[:, number], np.sqrt(np.mean(pulls[:, number] ** 2))
        print(
            f"{name}: off by {100 * np.sqrt(np.mean(own**2)):4.1f} % rms, "
            f"{100 * np.abs(own).max():4.1f} % at most, σ "
            f"{100 * np.median(sigma[:, number]):4.1f} %; pulls of rms {pull_rms:4.2f}"
        )
    print(
        f"all {off.size}: pulls of rms {np.sqrt(np.mean(pulls**2)):4.2f}, "
        f"{100 * np.mean(np.abs(pulls) < 1):.0f} % within 1 σ, "
        f"{100 * np.mean(np.abs(pulls) < 2):.0f} % within 2 σ, {np.abs(pulls).max():3.1f} σ at most"
    )


if __name__ == "__main__":
    main()
