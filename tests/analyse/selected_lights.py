"""A bench whose lights are selected one after another, and what is true of them there.

The room computes with its own spectra at every nanometre; the true irradiance of a band is their
sum over the band.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from labrig.calibration import IrradianceFile
from labrig.foundation.arrays import FloatArray
from labrig.material import read_material
from labrig.sim.filters import Filters, passed_by
from labrig.sim.lamp import BURNING_K, WAVELENGTH_NM, filament_spectrum
from labrig.sim.leds import led_spectrum
from labrig.sim.phosphor import band_cells
from labrig.sim.simulation import Simulation
from tests.analyse.recorded import record

WIDTH, HEIGHT = 96, 64
FILTERS = (
    "shortpass-430", "bandpass-450", "bandpass-500", "bandpass-525", "bandpass-580", "bandpass-610",
    "bandpass-640", "longpass-660",
)  # fmt: skip
#: In the middle of the bands of Table 1.
TUNED_NM = (420, 455, 495, 530, 570, 605, 645, 680)
PEAKS_NM = (415, 455, 495, 530, 565, 605, 640, 680)
LED_NAMES = tuple(f"{nm} nm" for nm in PEAKS_NM)
BANDS_NM = (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)
#: As narrow as a monochromator's own band.
FINE_NM = tuple(range(410, 700, 20))
FINE_BANDS_NM = tuple(float(nm) for nm in range(400, 720, 20))
SITES = (0.1, 0.2, 0.8, 0.6)

SELECTIONS: dict[str, dict[str, Any]] = {
    "filters": {"filters": list(FILTERS)},
    "wheel": {"filters": list(FILTERS)},
    "monochromator": {"monochromator": list(TUNED_NM)},
    "leds": {"leds": list(LED_NAMES)},
    "fine": {"monochromator": list(FINE_NM)},
    "narrow": {"monochromator": list(FINE_NM)},
}
QUICK: dict[str, Any] = {
    "protocol": "excitation",
    "sample": {"name": "blue-paint"},
    "charges": ["20 s", "3 min"],
    "direct": ["10 s", "1 min", "4 min"],
    "for": "40 s",
    "last_decay": "60 s",
    "rest": {"at_least": "1 min", "at_most": "4 min"},
    "sites": list(SITES),
}


def bench(
    kind: str, *, has_spectrometer: bool = False, **simulation: Any
) -> Callable[[dict[str, Any]], None]:
    """Change the shipped rig for phosphors into one that selects lights in that way."""

    def change(rig: dict[str, Any]) -> None:
        room = rig["simulation"]
        room["sensor"] = {"width": WIDTH, "height": HEIGHT}
        del room["lvf"]
        if kind == "wheel":
            slots = [None, *FILTERS[:5]]
            room["filter_wheel"] = {"filters": slots}
            rig["devices"]["filter_wheel"] = {
                "driver": "thorlabs_fw102c",
                "address": "sim://room/wheel",
                "filters": {name: number for number, name in enumerate(slots, 1) if name},
            }
        if kind in ("monochromator", "fine", "narrow"):
            fwhm_nm = 8 if kind == "narrow" else 20
            room["monochromator"] = {"fwhm": fwhm_nm, "off_nm": 0.3}
            rig["devices"]["monochromator"] = {
                "driver": "oriel_cornerstone",
                "address": "sim://room/monochromator",
                "fwhm": fwhm_nm,
                "wavelength_sigma": 0.5,
            }
        if kind == "leds":
            room["leds"] = [
                {"relay": n, "centre": nm, "fwhm": 22, "asymmetry": 1.15, "level": "8 %",
                 "droop": "1 %"}
                for n, nm in enumerate(PEAKS_NM, 1)
            ]  # fmt: skip
            room["led_board"] = "dc4100"
            rig["devices"]["leds"] = {
                "driver": "thorlabs_dc4100",
                "address": "sim://room/dc4100-1",
                "channels": {
                    name: {
                        "output": (n - 1) % 4 + 1,
                        "address": f"sim://room/dc4100-{1 + (n - 1) // 4}",
                        "centre": nm,
                        "fwhm": 22,
                    }
                    for n, (name, nm) in enumerate(zip(LED_NAMES, PEAKS_NM, strict=True), 1)
                },
            }
        if has_spectrometer:
            rig["devices"]["spectrometer"] = {
                "driver": "seabreeze_spectrometer",
                "address": "sim://room/spectrometer",
            }
        room |= simulation

    return change


def true_spectra(kind: str, room: Simulation) -> FloatArray:
    """The light of each in the room, on the scale of the lamp's, shape (lights, wavelengths)."""
    lamp = filament_spectrum(BURNING_K)
    if kind == "leds":
        return np.array([led_spectrum(led) for led in room.leds])
    if kind == "monochromator":
        assert room.monochromator is not None
        return np.array([lamp * passed_by(room.monochromator, nm) for nm in TUNED_NM])
    filters = Filters(room.filters, room.filters_bent, room.seed)
    return np.array([lamp * filters.transmission(name) for name in FILTERS])


def true_light(kind: str, room: Simulation, bands_nm: Sequence[float] = BANDS_NM) -> IrradianceFile:
    """What an irradiance run without error would find."""
    cells = band_cells(bands_nm)
    cells_nm = np.linspace(bands_nm[0], bands_nm[-1], 15 * (len(bands_nm) - 1) + 1)
    direct = cells @ filament_spectrum(BURNING_K)
    norm = np.linalg.norm(direct)
    spectra = true_spectra(kind, room)
    through = spectra @ cells.T / norm
    centre_nm = spectra @ WAVELENGTH_NM / spectra.sum(axis=1)
    about_nm = (WAVELENGTH_NM - centre_nm[:, None]) ** 2
    direct = direct / norm
    return IrradianceFile(
        lamp="the room's own",
        bands_nm=tuple(bands_nm),
        direct=tuple(direct),
        direct_sigma=tuple(0.003 * direct),
        lights=names(kind),
        centre_nm=tuple(centre_nm),
        width_nm=tuple(np.sqrt((spectra * about_nm).sum(axis=1) / spectra.sum(axis=1))),
        through=tuple(map(tuple, through)),
        through_sigma=tuple(map(tuple, 0.005 * through)),
        wavelength_sigma_nm=(0.0,) * len(through),
        cells_nm=tuple(cells_nm.tolist()),
        direct_cells=tuple(band_cells(cells_nm) @ filament_spectrum(BURNING_K) / norm),
        through_cells=tuple(map(tuple, spectra @ band_cells(cells_nm).T / norm)),
        scale_sigma=0.005,
        ratio=tuple(direct.sum() / through.sum(axis=1)),
        ratio_sigma=tuple(0.005 * direct.sum() / through.sum(axis=1)),
    )


def names(kind: str) -> tuple[str, ...]:
    """The names of the lights."""
    if kind == "monochromator":
        return tuple(f"{nm} nm" for nm in TUNED_NM)
    return LED_NAMES if kind == "leds" else FILTERS


def true_rates(material: str = "blue-paint") -> FloatArray:
    """Excitation rates of its states by band, in 1/s, shape (states, bands)."""
    return np.array([state.k_e_per_s for state in read_material(material).states], dtype=np.float64)


def recorded(folder: Path, kind: str, irradiance: Path, **simulation: Any) -> Path:
    """The folder of an excitation run by selected lights."""

    def change(rig: dict[str, Any]) -> None:
        bench(kind, **simulation)(rig)
        rig["devices"]["lamp"]["warm_up"] = "0 s"
        rig["optics"]["irradiance"] = str(irradiance)

    return record(folder, QUICK | {"select": SELECTIONS[kind]}, change)
