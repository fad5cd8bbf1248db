"""All measured re-radiating matrices as samples on the simulated bench with LEDs, in one capture.

    python -m tests.acceptance.led_fluorescence_bench [FOLDER] [--seed N] [--calibrated]
        [--lamps daylight halogen] [--width 702]
    python -m tests.acceptance.led_fluorescence_bench [FOLDER] --patches 100

The bench is `sim-fluorescent`: lopsided LEDs that droop and are not where the rig file says, and
a camera whose curves are bent. From seed 2 on, other LEDs are drawn: peaks off by 1 nm rms as of
bins of 2 to 5 nm, widths by 10 %, asymmetries by 15 %; the seed also bends the curves. With
--calibrated, `led_brightness` runs first and gives spectra and brightnesses; without, the rig
file's data-sheet values count. With --lamps, photographs under these broadband lamps join the
estimate. ΔE2000 of the estimated matrix, of the thesis's method and of the sample without
fluorescence, against the matrix in the room; errors of colours over their σ.

FOLDER keeps the runs. The matrix in the room has no anti-Stokes side, where an instrument finds its
noise only.

With --patches, as many samples lie in one capture, each matrix again where there are more of them,
and the time that the estimates take is printed, in all and for one patch: processor time, and the
wall's, which is longer where other programs run.
"""

import argparse
import math
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.bench import Recording
from labrig.foundation import resources
from labrig.material import (
    ReradiationMatrix,
    appearance,
    compare_colours,
    matrix_files,
    read_reradiation,
)
from labrig.optics import read_light
from labrig.process import process_run
from labrig.protocols.led_fluorescence.analysis import analyse
from labrig.protocols.led_fluorescence.result import LedFluorescenceResult
from tests.acceptance.mixture_colours import FOLDER, MIN_FRACTION
from tests.analyse.recorded import part_of, quietly

LIGHTS = ("D65", "A")
#: Standard deviations of what is drawn: peaks in nm, logarithms of widths and asymmetries.
CENTRE_NM, WIDTH, ASYMMETRY = 1.0, 0.1, 0.15


def main() -> None:
    """Measure in the folder that is asked for, or in one that does not stay."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--calibrated", action="store_true")
    parser.add_argument("--patches", type=int)
    parser.add_argument("--lamps", nargs="*", default=[])
    parser.add_argument("--width", type=int, default=1404)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        measure(asked, asked.folder or Path(scratch))


def measure(asked: argparse.Namespace, folder: Path) -> None:
    """Record and process in a folder, compare, print."""
    files = [
        path
        for path in matrix_files(FOLDER)
        if read_reradiation(path).reradiated_fraction.max() > MIN_FRACTION
    ]
    count = len(files) if asked.patches is None else asked.patches
    true = {_name(files, number): files[number % len(files)] for number in range(count)}
    regions = {name: _region(number, count) for number, name in enumerate(true)}
    rig = yaml.safe_load((resources.folder("config") / "sim-fluorescent.yaml").read_text())
    rig["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
    rig["simulation"]["seed"] = asked.seed
    rig["simulation"]["sensor"] = {"width": asked.width, "height": asked.width * 2 // 3}
    rig["simulation"]["sample"] = [
        {"material": str(true[name]), "region": region} for name, region in regions.items()
    ]
    if asked.seed > 1:
        _draw_leds(rig["simulation"]["leds"], np.random.default_rng(asked.seed))
    folder.mkdir(parents=True, exist_ok=True)
    if asked.calibrated:
        run = _recorded(folder, rig, {"protocol": "led_brightness"})
        process_run(run)
        rig["optics"]["leds"] = str(run.resolve())
    patches = {name: _inside(region) for name, region in regions.items()}
    protocol = {"protocol": "led_fluorescence", "patches": patches, "lamps": asked.lamps}
    run = _recorded(folder, rig, protocol)
    start_s, start_cpu_s = time.perf_counter(), time.process_time()
    result = analyse(part_of(run))
    wall_s, cpu_s = time.perf_counter() - start_s, time.process_time() - start_cpu_s
    _compare(result, {name: _in_the_room(path) for name, path in true.items()})
    print(
        f"{len(true)} patches: processor {cpu_s:.0f} s, wall {wall_s:.0f} s; each "
        f"{cpu_s / len(true):.2f} s, {wall_s / len(true):.2f} s"
    )


def _draw_leds(leds: list[dict[str, Any]], rng: np.random.Generator) -> None:
    for led in leds:
        off, wider, skew = rng.standard_normal(3)
        led["centre"] += float(off) * CENTRE_NM
        led["fwhm"] *= math.exp(WIDTH * wider)
        led["asymmetry"] *= math.exp(ASYMMETRY * skew)


def _in_the_room(path: Path) -> ReradiationMatrix:
    matrix = read_reradiation(path)
    reradiation = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation), 0.0)
    return replace(matrix, reradiation=reradiation, reradiation_sigma=None)


def _name(files: list[Path], number: int) -> str:
    again, which = divmod(number, len(files))
    name = files[which].stem.lower()
    return f"{name} {again + 1}" if again else name


def _region(number: int, count: int) -> list[float]:
    columns = math.ceil(math.sqrt(1.4 * count))
    rows = math.ceil(count / columns)
    row, column = divmod(number, columns)
    return [column / columns, row / rows, 1 / columns, 1 / rows]


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
        matrices = (patch.matrix.named(name), patch.per_led.named(name), none)
        found = [compare_colours(matrix, reference, lights) for matrix in matrices]
        rows.append([each.delta_e for differences in found for each in differences])
        for colour in patch.colours[: len(LIGHTS)]:
            off = appearance(reference, read_light(colour.light)).lab - np.array(colour.lab)
            pulls.append(off / np.array(colour.lab_sigma))
        print(f"{name:12} {_told(rows[-1])}", flush=True)
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
