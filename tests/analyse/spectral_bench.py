"""The simulated bench for spectra, its LVF calibrated without error."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from labrig.calibration import LVF_KIND, LvfFile
from labrig.calibration.lvf_file import BandColumns, WavelengthColumns
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.region import region_pixels
from labrig.material import read_material
from labrig.optics import Bands, Strip
from labrig.optics.piecewise import band_means, edges_from_centres
from labrig.results.emission_spectrum import WAVELENGTH_NM
from labrig.sim.bench_settings import LvfSettings
from labrig.sim.lamp import WAVELENGTH_NM as ROOM_NM
from labrig.sim.layout import PIECES, Lvf, pieces
from labrig.sim.optics import emission
from tests.analyse.recorded import recorded, shipped_rig
from tests.quick_yaml import read_quickly, write_quickly

#: Left out at the strip's long sides, as a fraction of its height.
MARGIN = 0.12
WIDTH, HEIGHT = 96, 64


def write_bench(folder: Path, name: str = "rig.yaml", **simulation: Any) -> Path:
    """The shipped rig for phosphors, changed as told, with its true LVF beside it."""
    path = folder / name
    path.write_text(write_quickly(bench(folder, **simulation)))
    return path


def bench(folder: Path, **simulation: Any) -> dict[str, Any]:
    """The content of that rig file; the LVF's is written into `folder`."""
    content = shipped_rig("sim-phosphor", 384, 64)
    content["simulation"] |= simulation
    for device in content["devices"].values():
        device.pop("warm_up", None)
    content["optics"]["lvf"] = "lvf.yaml"
    LVF_KIND.write(folder, true_lvf_file())
    return content


@cache
def true_lvf_file(width: int = WIDTH, height: int = HEIGHT) -> LvfFile:
    """What a calibration without error would find of the shipped rig's LVF before the camera."""
    content = read_quickly((resources.folder("config") / "sim-phosphor.yaml").read_text())
    return true_lvf_of(LvfSettings.model_validate(content["simulation"]["lvf"]), width, height)


def true_lvf_of(settings: LvfSettings, width: int, height: int) -> LvfFile:
    """Return what a calibration without error would find of an LVF before the camera."""
    x, y, wide, high = settings.before_camera.region
    strip = Strip(
        left=(x, y + high / 2), right=(x + wide, y + high / 2), height=high * (1 - 2 * MARGIN),
        rising=settings.before_camera.rising,
    )  # fmt: skip
    of_piece = Lvf(settings).seen(settings.before_camera, turned=False)
    piece = pieces(settings.before_camera, width, height)
    passed = []
    for region in strip.slices().values():
        left, top, across, down = region_pixels(region, width, height)
        passed.append(of_piece[piece[top : top + down, left : left + across]].mean(axis=(0, 1)))
    transmission = np.array(passed)
    position = np.array(strip.positions(width, height))
    centre = Lvf(settings).centre_nm(position)
    even = np.ones_like(centre)
    peak = transmission.max(axis=1)
    leakage = even * settings.leakage
    bands = Bands(centre, even * settings.fwhm_nm, 0 * even, peak, leakage)
    sigma = Bands(0.3 * even, 0.6 * even, 0 * even, 0.005 * peak, 0 * even)
    remainder = (transmission - bands.transmission(ROOM_NM))[:, ::2]
    fine = (np.arange(PIECES) + 0.5) / PIECES
    slope, start = np.polyfit(fine, Lvf(settings).centre_nm(fine), 1)
    return LvfFile(
        position=tuple(position.tolist()),
        bands=BandColumns.of(bands),
        sigma=BandColumns.of(sigma),
        remainder_nm=tuple(ROOM_NM[::2].tolist()),
        remainder=tuple(tuple(row) for row in remainder.tolist()),
        wavelengths=WavelengthColumns(
            coefficients=(float(start + slope / 2), float(slope / 2)),
            span=(0.0, 1.0),
            covariance=((0.0, 0.0), (0.0, 0.0)),
        ),
        before_camera=strip,
        source="the simulated room's truth",
    )


def record(folder: Path, protocol: dict[str, Any], **simulation: Any) -> Path:
    """The folder of a run of that protocol on `write_bench`'s rig."""
    return recorded(folder, {"sample": {"name": "test"}} | protocol, bench(folder, **simulation))


def emitted(material: str) -> FloatArray:
    """A shipped or written material's emission in the bands of `WAVELENGTH_NM`, of sum 1."""
    light = emission(read_material(material)).sum(axis=0)
    means = band_means(ROOM_NM, light, edges_from_centres(WAVELENGTH_NM))
    return np.asarray(means / means.sum())
