"""What the strip of a simulated room really lets through where labrig reads it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.region import region_pixels
from labrig.optics import Strip
from labrig.sim.lamp import BURNING_K, WAVELENGTH_NM, filament_spectrum
from labrig.sim.layout import Lvf, pieces
from labrig.sim.phosphor import band_cells
from labrig.sim.simulation import Simulation
from tests.quick_yaml import read_quickly

FINE_NM = np.arange(383.0, 730.0, 0.05)


@dataclass(frozen=True, eq=False)
class TrueBands:
    """Middle and width at half of the height above what leaks, (p,) each."""

    centre_nm: FloatArray
    fwhm_nm: FloatArray


def simulation_of(run: Path) -> Simulation:
    rig = read_quickly((run / "rig.yaml").read_text(encoding="utf-8"))
    return Simulation.model_validate(rig["simulation"])


def true_transmission(simulation: Simulation, strip: Strip, on_sample: bool) -> FloatArray:
    """(p, wavelengths) T on the room's own wavelengths, means over the pixels of every slice."""
    lvf, sensor = simulation.lvf, simulation.sensor
    assert lvf is not None
    placed = lvf.on_sample if on_sample else lvf.before_camera
    through = Lvf(lvf).seen(placed, turned=False)
    piece = pieces(placed, sensor.width, sensor.height)
    rows = []
    for region in strip.slices().values():
        x, y, wide, high = region_pixels(region, sensor.width, sensor.height)
        counts = np.bincount(piece[y : y + high, x : x + wide].ravel(), minlength=len(through))
        rows.append(counts @ through / counts.sum())
    return np.array(rows)


def true_bands(simulation: Simulation, strip: Strip, on_sample: bool = False) -> TrueBands:
    """Of every slice."""
    curves = true_transmission(simulation, strip, on_sample)
    return bands_of(PchipInterpolator(WAVELENGTH_NM, curves.T, axis=0)(FINE_NM).T)


def true_irradiance(
    simulation: Simulation, strip: Strip, bands_nm: tuple[float, ...]
) -> FloatArray:
    """(p, bands) E behind the strip on the sample; that of the lamp by itself has length 1."""
    lamp, cells = filament_spectrum(BURNING_K), band_cells(bands_nm)
    direct = np.linalg.norm(cells @ lamp)
    passed = true_transmission(simulation, strip, on_sample=True) * lamp
    return np.asarray(passed @ cells.T / direct)


def bands_of(transmission: FloatArray) -> TrueBands:
    """Of curves on `FINE_NM`."""
    centre, width = [], []
    for row in transmission:
        ground = np.median(row)
        inside = FINE_NM[row - ground > (row.max() - ground) / 2]
        centre.append((inside[0] + inside[-1]) / 2)
        width.append(inside[-1] - inside[0])
    return TrueBands(np.array(centre), np.array(width))
