"""A sample on the shipped rig whose light is known without error, for excitation runs."""

from pathlib import Path
from typing import Any

import numpy as np

from labrig.calibration.irradiance_file import IrradianceFile
from labrig.material import read_material
from labrig.optics import SLICES, Strip
from labrig.sim.bench_settings import LvfSettings
from labrig.sim.lamp import BURNING_K, filament_spectrum
from labrig.sim.layout import Lvf
from labrig.sim.phosphor import band_cells
from tests.quick_yaml import read_quickly

#: Wide, so that a slice of the strip is ten pixels; low, so that it is fast.
WIDTH, HEIGHT = 384, 48

QUICK: dict[str, Any] = {
    "protocol": "excitation",
    "sample": {"name": "blue-paint"},
    "growth": "30 %",
    "at_most": 4,
    "refine": 1,
    "direct": ["10 s", "1 min", "4 min"],
    "for": "40 s",
    "last_decay": "60 s",
    "rest": {"at_least": "1 min", "at_most": "4 min"},
}

TILT = np.radians(1.0)


def true_irradiance(width: int = WIDTH, height: int = HEIGHT) -> IrradianceFile:
    """The result of an irradiance run without error on the shipped rig with such a sensor."""
    lvf_settings = read_quickly(Path("config/sim-phosphor.yaml").read_text(encoding="utf-8"))[
        "simulation"
    ]["lvf"]
    lvf = Lvf(LvfSettings.model_validate(lvf_settings))
    down = 0.42 * width / height * np.tan(TILT)
    strip = Strip(left=(0.08, 0.5 + down), right=(0.92, 0.5 - down), height=0.3, rising=False)
    bands_nm = read_material("blue-paint").bands_nm
    assert bands_nm is not None
    cells, lamp = band_cells(bands_nm), filament_spectrum(BURNING_K)
    position = np.array(strip.positions(width, height))
    about = np.linspace(-0.5, 0.5, 41) / SLICES
    passed = np.array([lvf.transmission(np.clip(u + about, 0, 1)).mean(axis=0) for u in position])
    norm = np.linalg.norm(cells @ lamp)
    through, direct = (passed * lamp) @ cells.T / norm, cells @ lamp / norm
    ratio = direct.sum() / through.sum(axis=1)
    return IrradianceFile(
        lamp="the room's own",
        bands_nm=bands_nm,
        direct=tuple(direct),
        direct_sigma=tuple(0.003 * direct),
        position=tuple(position),
        through=tuple(map(tuple, through)),
        through_sigma=tuple(map(tuple, 0.005 * through)),
        scale_sigma=0.005,
        ratio=tuple(ratio),
        ratio_sigma=tuple(0.005 * ratio),
        strip=strip,
    )
