"""The simulated bench with LEDs and a spectrometer, its scale and its grey card known exactly."""

from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.material import read_any_material
from labrig.optics import band_integrals, edges_from_centres
from labrig.sim.bench_settings import LedSettings
from labrig.sim.cards import reflectances
from labrig.sim.lamp import WAVELENGTH_NM as ROOM_NM
from labrig.sim.leds import Leds
from labrig.sim.opening import PIXEL_STREAM
from labrig.sim.spectrometer import Detector
from labrig.sim.surfaces import Surfaces
from tests.analyse.recorded import recorded, shipped_rig
from tests.quick_yaml import read_quickly, write_quickly

MATERIALS = ("yellow-textile", "orange-textile", "white-paper", "grey-felt")
#: Outputs of the shipped rig's LEDs, by their names.
RELAYS = {"365 nm": 1, "405 nm": 2, "430 nm": 3, "455 nm": 4, "490 nm": 5, "530 nm": 6,
          "565 nm": 7, "590 nm": 8, "625 nm": 9}  # fmt: skip
#: When a light is read that has burnt for two minutes.
SETTLED_S = 125.0


def write_bench(folder: Path, seed: int = 1, **simulation: Any) -> Path:
    """The shipped rig without a camera, changed as told."""
    path = folder / "rig.yaml"
    path.write_text(write_quickly(bench(folder, seed, **simulation)))
    return path


def bench(folder: Path, seed: int = 1, **simulation: Any) -> dict[str, Any]:
    """The content of that rig file; the files that it names are written into `folder`."""
    content = shipped_rig("sim-fluorescent")
    content["simulation"] |= {"seed": seed} | simulation
    del content["devices"]["camera"]
    content["devices"]["lamp"] = {
        "driver": "numato", "address": "sim://room/relays", "relay": 0, "warm_up": "15 min",
    }  # fmt: skip
    detector = Detector(np.random.default_rng([seed, PIXEL_STREAM]))
    _write_curve(folder / "scale.csv", detector.wavelength_nm, detector.irradiance_per_count_rate())
    _write_curve(folder / "card.csv", ROOM_NM, reflectances("grey card", 0.18)[1])
    content["devices"]["spectrometer"]["calibration"] = "./scale.csv"
    content["optics"]["grey_card"] = "./card.csv"
    return content


def _write_curve(path: Path, nm: FloatArray, values: FloatArray) -> None:
    rows = [f"{at!r},{value!r}" for at, value in zip(nm.tolist(), values.tolist(), strict=True)
            if np.isfinite(value)]  # fmt: skip
    path.write_text("\n".join(["wavelength_nm,value", *rows]) + "\n", encoding="utf-8")


def record(folder: Path, protocol: dict[str, Any], seed: int = 1, **simulation: Any) -> Path:
    """The folder of a run of that protocol."""
    keys = {"protocol": "direct_bispectral"} | protocol
    return recorded(folder, keys, bench(folder, seed, **simulation))


def shipped_leds() -> tuple[LedSettings, ...]:
    content = read_quickly((resources.folder("config") / "sim-fluorescent.yaml").read_text())
    return tuple(LedSettings.model_validate(led) for led in content["simulation"]["leds"])


def true_light(name: str) -> FloatArray:
    """A settled LED's irradiance on the room's grid."""
    bank = Leds(shipped_leds()).switched(RELAYS[name], on=True, at_s=0.0)
    return bank.irradiance(SETTLED_S)


def true_column(
    material: str, light: FloatArray, output_nm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Light that comes back in each band over the light's power: all, and what is re-radiated."""
    surfaces = Surfaces([read_any_material(material)], 0.0)
    (back,) = surfaces.thrown_back(light, np.array([1]))
    edges_nm = edges_from_centres(output_nm)
    power = band_integrals(ROOM_NM, light, [ROOM_NM[0], ROOM_NM[-1]])
    reflected = band_integrals(ROOM_NM, grey(material) * light, edges_nm) / power
    all_of_it = band_integrals(ROOM_NM, back, edges_nm) / power
    return all_of_it, all_of_it - reflected


def grey(material: str) -> FloatArray:
    """A sample's reflectance on the room's grid: what comes back of light of each cell alone there.

    Re-radiated light comes back in other cells.
    """
    surfaces = Surfaces([read_any_material(material)], 0.0)
    each = np.eye(len(ROOM_NM))
    return np.diag(surfaces.thrown_back(each, np.ones(len(ROOM_NM), dtype=np.intp)))


def true_reflectance(material: str, output_nm: FloatArray) -> FloatArray:
    return np.interp(output_nm, ROOM_NM, grey(material))
