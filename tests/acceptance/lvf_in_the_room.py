"""The LVF calibrated in the simulated room, against what the room knows.

    python -m tests.acceptance.lvf_in_the_room [--width 702] [--seeds 3] [--filters 40] [--chosen N]
        [--shipped]

Every seed is a run of `labrig run lvf_calibration` and one of `irradiance`, with another camera,
whose curves are bent by as much as three laboratories disagree about one camera, and with filters
that are not quite as their files. Filters are real ones, Roscolux and Supergel of the shared data,
unless shipped ones are asked for; `--chosen` uses as many of them, those that tell
most. Of every position: the middle of its band and its width at half
maximum, read off the true and the calibrated curve alike; of irradiance, the sum over all bands.
"""

import argparse
import contextlib
import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from labrig.calibration import IRRADIANCE_KIND, LVF_KIND
from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.optics import read_curve_file
from tests.analyse.lvf_calibration.room_truth import (
    FINE_NM,
    bands_of,
    simulation_of,
    true_bands,
    true_irradiance,
)
from tests.real_data import SHARED

ROSCOLUX = SHARED / "filters/art_roscolux/roscolux_transmittance.csv"
#: The ends of the strip are told apart: there is little light.
INSIDE_NM = (420.0, 680.0)


def real_filters(folder: Path, count: int) -> list[str]:
    """Write some of the catalogue as files, evenly through it."""
    curves = read_curve_file(ROSCOLUX).curves
    names = list(curves)
    chosen = [names[k] for k in np.linspace(0, len(names) - 1, count).round().astype(int)]
    folder.mkdir(exist_ok=True)
    for name in chosen:
        rows = [f"{nm},{value}" for nm, value in zip(*curves[name][:2], strict=True)]
        text = "wavelength_nm,value\n" + "\n".join(rows) + "\n"
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
    return chosen


def labrig(*arguments: object) -> Path:
    """The folder of the run that this command line makes."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = guarded([str(argument) for argument in arguments])
    if code:
        raise SystemExit(err.getvalue().splitlines()[-1])
    return Path(out.getvalue().splitlines()[-1])


def measured(
    folder: Path, seed: int, width: int, filters: int, chosen: int | None, real: bool
) -> tuple[Path, Path]:
    """Runs of both protocols."""
    rig = yaml.safe_load((resources.folder("config") / "sim-phosphor.yaml").read_text())
    rig["simulation"] |= {
        "seed": seed,
        "sensor": {"width": width, "height": width * 2 // 3},
        "epoch": "2026-01-01T00:00:00Z",
        "initial": {"lamp": "off"},
    }
    protocol: dict[str, Any] = {"protocol": "lvf_calibration", "rising": True}
    if real:
        protocol["filters"] = real_filters(folder / "gels", filters)
        rig["optics"]["filters"] = rig["simulation"]["filters"] = str(folder / "gels")
    if chosen is not None:
        protocol["filters"] = chosen
    rig_path, protocol_path = folder / f"rig-{seed}.yaml", folder / "protocol.yaml"
    rig_path.write_text(yaml.safe_dump(rig))
    protocol_path.write_text(yaml.safe_dump(protocol))
    place = ("--yes", "--runs", folder / f"runs-{seed}")
    first = labrig("run", protocol_path, "--rig", rig_path, *place)
    rig["optics"]["lvf"] = str(first)
    rig_path.write_text(yaml.safe_dump(rig))
    return first, labrig("run", "irradiance", "--rig", rig_path, *place)


def report(name: str, off: FloatArray, sigma: FloatArray, within: NDArray[np.bool_]) -> None:
    """One line: errors inside and over all, in units of σ, too."""
    print(
        f"  {name:<22} {np.abs(off[within]).mean():7.3f} {np.abs(off[within]).max():7.3f}"
        f" {np.abs(off).max():7.3f}   {np.sqrt(np.mean((off / sigma) ** 2)):5.2f}"
        f" {np.abs(off / sigma).max():5.2f}"
    )


def main() -> None:
    """Print a table for every seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--width", type=int, default=702)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--filters", type=int, default=40)
    parser.add_argument("--chosen", type=int)
    parser.add_argument("--shipped", action="store_true")
    asked = parser.parse_args()
    low, high = INSIDE_NM
    print(f"  {'':<22}   mean     max  at ends   rms/σ  max/σ   ({low:.0f}-{high:.0f} nm, all)")
    for seed in range(1, asked.seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            calibration, irradiance = measured(
                Path(folder), seed, asked.width, asked.filters, asked.chosen, not asked.shipped
            )
            lvf = LVF_KIND.read(calibration / "result" / "lvf.yaml")
            light = IRRADIANCE_KIND.read(irradiance / "result" / "irradiance.yaml")
            simulation = simulation_of(calibration)
        assert lvf.before_camera is not None
        assert lvf.on_sample is not None
        print(f"seed {seed}, {asked.width} pixels wide")
        truth = true_bands(simulation, lvf.before_camera)
        found = bands_of(lvf.lvf.transmission(FINE_NM))
        sigma = lvf.sigma.bands()
        inside = (truth.centre_nm > low) & (truth.centre_nm < high)
        report("centre / nm", found.centre_nm - truth.centre_nm, sigma.centre_nm, inside)
        width_off = found.fwhm_nm / truth.fwhm_nm - 1
        report("width / 1", width_off, sigma.fwhm_nm / found.fwhm_nm, inside)
        there = true_bands(simulation, lvf.on_sample, on_sample=True)
        sensor = simulation.sensor
        at = np.array(lvf.on_sample.positions(sensor.width, sensor.height))
        read = np.interp(at, np.array(lvf.position), found.centre_nm)
        report("centre on sample / nm", read - there.centre_nm, sigma.centre_nm, inside)
        expected = true_irradiance(simulation, light.lvf_strip(), light.bands_nm).sum(axis=1)
        through = np.array(light.through).sum(axis=1)
        relative = np.array(light.ratio_sigma) / np.array(light.ratio)
        report("irradiance / 1", through / expected - 1, relative, inside)


if __name__ == "__main__":
    main()
