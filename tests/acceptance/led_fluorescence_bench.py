"""All measured re-radiating matrices as samples on the simulated bench with LEDs, in one capture.

    python -m tests.acceptance.led_fluorescence_bench FOLDER [--seed N] [--calibrated]
        [--lamps daylight halogen] [--width 702]

The bench is `sim-fluorescent`: lopsided LEDs that droop and are not where the rig file says, and
a camera whose curves are bent. With --calibrated, `led_brightness` runs first and gives spectra
and brightnesses; without, the rig file's data-sheet values count. With --lamps, photographs under
these broadband lamps join the estimate. ΔE2000 of the estimated matrix,
of the thesis's method and of the sample without fluorescence, against the matrix in the room;
errors of colours over their σ.
"""

import argparse
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig import resources
from labrig.material import (
    ReradiationMatrix,
    appearance,
    compare_colours,
    matrix_files,
    read_reradiation,
)
from labrig.optics import read_light
from labrig.process import process_run
from labrig.recording import Recording
from labrig.results import LedFluorescenceResult
from tests.acceptance.mixture_colours import FOLDER, LEAST_FRACTION
from tests.analyse.recorded import quietly

COLUMNS, ROWS = 8, 6
LIGHTS = ("D65", "A")


def main() -> None:
    """Record, process, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--lamps", nargs="*", default=[])
    parser.add_argument("--width", type=int, default=1404)
    asked = parser.parse_args()
    true = {
        path.stem.lower(): path
        for path in matrix_files(FOLDER)
        if read_reradiation(path).reradiated_fraction.max() > LEAST_FRACTION
    }
    regions = {name: _region(number) for number, name in enumerate(true)}
    rig = yaml.safe_load((resources.folder("config") / "sim-fluorescent.yaml").read_text())
    rig["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
    rig["simulation"]["seed"] = asked.seed
    rig["simulation"]["sensor"] = {"width": asked.width, "height": asked.width * 2 // 3}
    rig["simulation"]["sample"] = [
        {"material": str(true[name]), "region": region} for name, region in regions.items()
    ]
    asked.folder.mkdir(parents=True, exist_ok=True)
    if asked.calibrated:
        run = _recorded(asked.folder, rig, {"protocol": "led_brightness"})
        process_run(run)
        rig["optics"]["leds"] = str(run.resolve())
    patches = {name: _inside(region) for name, region in regions.items()}
    protocol = {"protocol": "led_fluorescence", "patches": patches, "lamps": asked.lamps}
    run = _recorded(asked.folder, rig, protocol)
    result = process_run(run)
    assert isinstance(result, LedFluorescenceResult)
    _compare(result, {name: read_reradiation(path) for name, path in true.items()})


def _region(number: int) -> list[float]:
    row, column = divmod(number, COLUMNS)
    return [column / COLUMNS, row / ROWS, 1 / COLUMNS, 1 / ROWS]


def _inside(region: list[float]) -> list[float]:
    x, y, width, height = region
    return [x + width / 5, y + height / 5, 3 * width / 5, 3 * height / 5]


def _recorded(folder: Path, rig: dict[str, Any], protocol: dict[str, Any]) -> Path:
    name = protocol["protocol"]
    paths = folder / f"{name}.yaml", folder / f"rig-{name}.yaml"
    for path, content in zip(paths, (protocol, rig), strict=True):
        path.write_text(yaml.safe_dump(content))
    return Recording.prepare(*paths, folder / "runs").record(quietly)


def _compare(result: LedFluorescenceResult, true: dict[str, ReradiationMatrix]) -> None:
    lights = [read_light(name) for name in LIGHTS]
    rows, pulls = [], []
    for name, patch in result.patches.items():
        reference = true[name]
        none = replace(reference, reradiation=np.zeros_like(reference.reradiation))
        assert patch.per_led is not None
        matrices = (patch.matrix.named(name), patch.per_led.named(name), none)
        found = [compare_colours(matrix, reference, lights) for matrix in matrices]
        rows.append([each.delta_e for differences in found for each in differences])
        for colour in patch.colours[: len(LIGHTS)]:
            off = appearance(reference, read_light(colour.light)).lab - np.array(colour.lab)
            pulls.append(off / np.array(colour.lab_sigma))
        print(f"{name:10} {_told(rows[-1])}", flush=True)
    print(f"{len(rows)} samples; ΔE2000 under {', '.join(LIGHTS)}:")
    print("estimate, one LED by itself, reflectance only")
    for quantile in (0.5, 0.9, 1.0):
        values = np.quantile(rows, quantile, axis=0)
        print(f"{100 * quantile:3.0f} %      {_told(values)}")
    each = np.array(pulls)
    rms, by_median = np.sqrt(np.mean(each**2)), np.median(np.abs(each)) / 0.6745
    print(f"errors over σ of L*, a*, b*: rms {rms:.2f}, by their median {by_median:.2f}")
    print(f"ultraviolet scale: {result.uv_scale}")


def _told(values: Iterable[float]) -> str:
    return " ".join(f"{value:6.2f}" for value in values)


if __name__ == "__main__":
    main()
