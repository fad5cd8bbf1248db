"""Pictures through a variable filter, made for tests: real lights, real curves of cameras."""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    CameraResponse,
    Lvf,
    Spectrum,
    WavelengthMap,
    nominal_lvf,
    read_camera,
    read_curve_file,
    read_spectrum,
    signal_through,
)
from tests.real_data import SHARED

CAMERAS = SHARED / "camera_sensitivity"

GRID_NM = np.arange(400.0, 701.0, 10.0)
EDGES_NM = np.arange(395.0, 706.0, 10.0)
KNOTS_NM = np.arange(380.0, 721.0, 5.0)
MERCURY_NM = (404.6565, 407.7837, 435.8335, 546.0750, 576.9610, 579.0670)
MERCURY_HEIGHTS = np.array([0.45, 0.05, 1.0, 0.9, 0.22, 0.25])


def curved_lvf() -> Lvf:
    """31 bands of 25 nm on a strip of 1000 pixels whose wavelength is not quite linear."""
    wavelengths = WavelengthMap(np.array([550.0, 170.0, 6.0]), (0.0, 1000.0))
    return nominal_lvf(wavelengths, GRID_NM, leakage=0.001)


def of_the_house() -> CameraResponse:
    """The curves that the fit has."""
    return read_camera("canon_eos_5d_mark_ii")


def of_another_laboratory() -> CameraResponse:
    """The same camera, measured elsewhere."""
    return read_camera(CAMERAS / "ampas_rawtoaces_2017/canon_eos_5d_mark_ii_380_780_5.json")


@dataclass(frozen=True, eq=False)
class Picture:
    """What was read off it, shape (positions · channels,), and its σ."""

    value: FloatArray
    sigma: FloatArray


def photographed(
    light: Spectrum, lvf: Lvf, camera: CameraResponse, rng: np.random.Generator, snr: float = 300.0
) -> Picture:
    """Photon noise, `snr` where it is brightest, and a floor as of read noise."""
    seen = signal_through(lvf, camera, light)
    sigma = np.sqrt(seen * seen.max() + (0.02 * seen.max()) ** 2) / snr
    return Picture((seen + sigma * rng.standard_normal(seen.shape)).ravel(), sigma.ravel())


def fluorophores(count: int, seed: int = 1) -> list[Spectrum]:
    """Emission of real dyes with their peak from 430 to 660 nm."""
    file = SHARED / "fluorophores/mcnamara_boswell_emission.csv"
    curves = read_curve_file(file).curves
    peaks = {name: c.wavelength_nm[c.value.argmax()] for name, c in curves.items()}
    names = [name for name, peak_nm in peaks.items() if 430 < peak_nm < 660]
    chosen = np.random.default_rng(seed).choice(names, count, replace=False)
    return [Spectrum(str(name), *curves[str(name)]) for name in chosen]


def narrow_leds(count: int) -> list[Spectrum]:
    """LEDs with their peak from 420 to 670 nm."""
    curves = read_curve_file(SHARED / "light_sources/photobiology/leds.csv").curves
    peaks = {name: c.wavelength_nm[c.value.argmax()] for name, c in curves.items()}
    names = [name for name, peak_nm in peaks.items() if 420 < peak_nm < 670]
    return [Spectrum(name, *curves[name]) for name in names[:count]]


def mercury_lamp(rng: np.random.Generator, continuum: float = 1e-4) -> Spectrum:
    """Lines half a nanometre wide, heights about those of a pencil lamp, over a faint continuum."""
    heights = MERCURY_HEIGHTS * rng.uniform(0.8, 1.25, len(MERCURY_NM))
    return lines(dict(zip(MERCURY_NM, heights.tolist(), strict=True)), continuum)


def lines(heights: dict[float, float], continuum: float) -> Spectrum:
    """Triangles of the given heights."""
    feet = [[nm - 0.5, nm, nm + 0.5] for nm in heights]
    wavelength_nm = np.unique(np.concatenate([[300.0, 900.0], *feet]))
    value = np.full(len(wavelength_nm), float(continuum))
    for nm, height in heights.items():
        value[wavelength_nm == nm] += height
    return Spectrum("mercury", wavelength_nm, value)


def halogen_lamp() -> Spectrum:
    """A halogen spot, as measured."""
    return read_spectrum(
        SHARED / "light_sources/photobiology/lamps.csv", "Philips.Inc.50W.spot.halogen"
    )


def colour_checker(lamp: Spectrum) -> list[Spectrum]:
    """The 24 patches under a lamp."""
    patches = read_curve_file(SHARED / "reflectances/art_macbeth_colourchecker.csv").curves
    return [lit(name, lamp, Spectrum(name, *curve)) for name, curve in patches.items()]


def lit(name: str, lamp: Spectrum, reflectance: Spectrum) -> Spectrum:
    """The light that comes back from a surface, 1 nm apart."""
    fine = np.arange(380.0, 775.1, 1.0)
    return Spectrum(name, fine, lamp.at(fine) * reflectance.at(fine))
