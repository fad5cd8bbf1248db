"""Lamps of a scene in its bands, and where they are; the light of the bench."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import beside
from labrig.optics import absolute_irradiance, read_light
from labrig.reproduce.scene.lamp_entry import STRENGTHS, LampEntry
from labrig.reproduce.scene.scene_file import SceneFile
from labrig.reproduce.surface.bands import Bands
from labrig.reproduce.surface.surface_material import BenchLight
from labrig.reproduce.transport.lamp import Lamp

#: Part of a lamp's brightest band by which noise may make another negative.
NOISE_OF_LAMP = 0.01


def bench_light(file: SceneFile, folder: Path) -> BenchLight:
    """Return the light by which phosphors of a scene were measured."""
    light = file.bench_light
    spectrum = read_light(beside(light.spectrum, folder))
    return BenchLight(absolute_irradiance(light.illuminance_lux, spectrum))


def placed_lamp(name: str, entry: LampEntry, bands: Bands, folder: Path, t_s: float) -> Lamp:
    """Return a lamp at a time in s, at its full strength."""
    of_eye, of_watt = STRENGTHS[entry.kind]
    strength = getattr(entry, of_eye)
    is_to_eye = strength is not None
    unit = _unit_light(beside(entry.spectrum, folder), bands, is_to_eye)
    if unit.min() < -NOISE_OF_LAMP * unit.max():
        worst = bands.centre_nm[int(np.argmin(unit))]
        raise UsageError(
            f"lamp {name}: expected a spectrum ≥ 0, got a negative one at {worst:g} nm in "
            f"'{entry.spectrum}'"
        )
    unit = np.maximum(unit, 0.0)
    light = unit * (strength if is_to_eye else getattr(entry, of_watt))
    if not light.any() and strength != 0:
        raise UsageError(
            f"lamp {name}: expected light between {bands.edges_nm[0]:g} and "
            f"{bands.edges_nm[-1]:g} nm, got none in '{entry.spectrum}'"
        )
    vector = entry.position_m or (0.0, 0.0, 1.0)
    if entry.path is not None:
        times = [point.at_s for point in entry.path]
        places = np.array([point.position_m for point in entry.path])
        x, y, z = (float(np.interp(t_s, times, column)) for column in places.T)
        vector = x, y, z
    if entry.towards is not None:
        x, y, z = (np.array(entry.towards) / np.linalg.norm(entry.towards)).tolist()
        vector = x, y, z
    return Lamp(name, entry.kind, light, vector)


@lru_cache(maxsize=64)
def _unit_light(named: str, bands: Bands, is_to_eye: bool) -> FloatArray:
    """Return a spectrum in the bands of one scene, of 1 lm or of 1 W; read once for all times."""
    spectrum = read_light(named)
    if is_to_eye:
        return absolute_irradiance(1.0, spectrum).in_bands(bands.edges_nm)
    whole = float(np.trapezoid(spectrum.value, spectrum.wavelength_nm))
    if not whole > 0:
        raise UsageError(f"{named}: expected the spectrum of a lamp, got one without light")
    return np.asarray(bands.means(spectrum) / whole)
