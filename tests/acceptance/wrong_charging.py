"""Simulated rooms that break an assumption about charging, each measured by a short excitation run.

What is known of the lamp and of the light below the filter is the truth, so that nothing else is
wrong.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.calibration import FADE_KIND, IRRADIANCE_KIND, Change, FadeFile, Warming
from labrig.material import read_material
from labrig.protocols.excitation.result import ExcitationResult
from labrig.results import RunResult
from labrig.sim.lamp import BURNING_K, Lamp, filament_spectrum
from labrig.sim.phosphor import band_cells
from labrig.sim.simulation import LampSettings
from labrig.sim.truth import Truth
from tests.acceptance.decays_of_all_materials import shipped_rig
from tests.analyse.excitation.bench import HEIGHT, QUICK, WIDTH, true_irradiance

#: The room's usual lamp, in multiples of the irradiance to which Table 1's rates belong.
LAMP = 4.0
#: Relative σ of the lamp's transients, and of the deficit of a cold lamp.
FADE_SIGMA, DEFICIT_SIGMA = 0.005, 0.1
#: Frames enough after the last charge to tell the flicker.
PROTOCOL = QUICK | {"last_decay": "180 s"}


def true_fade() -> FadeFile:
    """Return what a fade run without error would find of the shipped rig's lamp."""
    settings = LampSettings()
    steady = settings.model_copy(update={"warm_up_deficit": 0.0})
    bands_nm = read_material("blue-paint").bands_nm
    assert bands_nm is not None
    cells = band_cells(bands_nm)
    full = cells @ filament_spectrum(BURNING_K)

    def change(on: bool, total_s: float) -> Change:
        lamp, times_s = Lamp.found(steady, on=not on).switched(on, 0.0), np.linspace(0, total_s, 65)
        light = np.array([cells @ lamp.irradiance(float(t_s)) for t_s in times_s]) / full
        rows = tuple(map(tuple, np.maximum(light, 0.0).tolist()))
        sigma = tuple(map(tuple, np.full(light.shape, FADE_SIGMA).tolist()))
        return Change(t_s=tuple(times_s.tolist()), fraction=rows, sigma=sigma)

    warming = Warming(
        deficit=settings.warm_up_deficit,
        deficit_sigma=DEFICIT_SIGMA * settings.warm_up_deficit,
        time_constant_s=settings.warm_up,
    )
    return FadeFile(
        bands_nm=bands_nm, fade=change(False, 0.5), rise=change(True, 1.0), warming=warming
    )


@dataclass(frozen=True)
class Charging:
    """A room with a broken assumption about the light, the filter or the sample.

    Attributes
    ----------
    assumption
        What labrig takes for granted and the room does not keep.
    simulation
        Keys of `simulation:`, beside those of the shipped rig for phosphors.
    kinetics
        Keys of `kinetics` of the sample; None: as in its file.
    lamp
        Light of the room's lamp in multiples of the irradiance to which Table 1's rates belong.
    """

    name: str
    assumption: str
    simulation: dict[str, Any] = field(default_factory=dict)
    kinetics: dict[str, Any] | None = None
    lamp: float = LAMP

    def material(self, seed: int) -> str:
        """Return the name of the sample's material, which is the same for all seeds."""
        del seed
        return "blue-paint"

    def write(self, seed: int, folder: Path) -> None:
        """Write `rig.yaml`, `protocol.yaml`, the irradiance and the fade into a folder."""
        IRRADIANCE_KIND.write(folder, true_irradiance())
        FADE_KIND.write(folder, true_fade())
        patch: dict[str, Any] = {"material": self.material(seed), "region": [0.03, 0.1, 0.94, 0.8]}
        if self.kinetics is not None:
            patch["kinetics"] = self.kinetics
        rig: dict[str, Any] = shipped_rig(
            "sim-phosphor",
            sample=[patch],
            sensor={"width": WIDTH, "height": HEIGHT},
            seed=1000 * (zlib.crc32(self.name.encode()) % 1_000_000) + seed,
        )
        rig["simulation"]["lamp"] = rig["simulation"].get("lamp", {}) | {"irradiance": self.lamp}
        for key, value in self.simulation.items():
            of_rig = rig["simulation"].get(key)
            rig["simulation"][key] = of_rig | value if isinstance(of_rig, dict) else value
        for kind in (IRRADIANCE_KIND, FADE_KIND):
            rig["optics"][kind.optics_key] = str(folder / kind.file_name)
        rig["devices"]["lamp"]["warm_up"] = "0 s"
        (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
        (folder / "protocol.yaml").write_text(yaml.safe_dump(PROTOCOL))

    def errors(
        self, result: RunResult, truth: Truth
    ) -> Iterator[tuple[str, tuple[float, float, float]]]:
        """Return error, σ and truth of rates, excitation rates and the level reached, by name."""
        assert isinstance(result, ExcitationResult)
        (patch,) = result.patches.values()
        states, true = patch.fit.states, truth.patches[0].states[0]
        for state in states[1:]:
            yield f"state of {state.k_r_per_s:.2g} /s", (np.inf, 1.0, 1.0)
        state = states[0]
        k = true.k_r_per_s
        yield "k_r", (state.k_r_per_s - k, state.k_r_per_s_sigma, k)
        k_e_per_s = read_material(self.material(0)).states[0].k_e_per_s
        assert k_e_per_s is not None
        for band, k_e in enumerate(k_e_per_s):
            found = state.k_e_per_s[band] / self.lamp
            sigma = state.k_e_per_s_sigma[band] / self.lamp
            yield f"k_e {band + 1}", (found - k_e, sigma, max(k_e_per_s))
        level, r0 = patch.fit.at_off[-1], true.concentration
        assert r0 is not None
        yield "r(0)", (level.r0[0] - r0, level.r0_sigma[0], r0)


CHARGES = [
    Charging("charging: clean", "none: every assumption holds"),
    Charging(
        "charging: offset 0.3",
        "an empty trap is filled as easily as any",
        kinetics={"charging_offset": 0.3},
    ),
    Charging("charging: density 1", "a layer is thin", kinetics={"optical_density": 1}),
    Charging(
        "charging: density 1, lamp 2", "a layer is thin", kinetics={"optical_density": 1}, lamp=2.0
    ),
    Charging(
        "charging: density 1, lamp 1", "a layer is thin", kinetics={"optical_density": 1}, lamp=1.0
    ),
    Charging("charging: density 4", "a layer is thin", kinetics={"optical_density": 4}),
    Charging(
        "charging: smooth", "excitation is even within a band", kinetics={"excitation": "smooth"}
    ),
    Charging(
        "charging: beyond 50 %",
        "nothing excites beyond the bands",
        kinetics={"excitation_beyond": 0.5},
    ),
    Charging(
        "charging: retrapping 0.1",
        "traps empty at one rate",
        kinetics={"model": "otor", "retrapping": 0.1},
    ),
    Charging(
        "charging: cooling 5 K/h", "the lamp keeps its colour", {"lamp": {"cooling_per_hour": 5}}
    ),
    Charging(
        "charging: spread 1 %", "the filter's light stays below it", {"lvf": {"spread": 0.01}}
    ),
    Charging(
        "charging: inter-reflection 2 %",
        "surfaces do not light one another",
        {"inter_reflection": 0.02},
    ),
    Charging("charging: glare 2 %", "the lens scatters nothing", {"imaging": {"glare": 0.02}}),
    Charging("charging: texture 5 %", "surfaces are even", {"imaging": {"texture": 0.05}}),
    Charging(
        "charging: non-linear 3 %", "the sensor is linear", {"sensor": {"nonlinearity": 0.03}}
    ),
]
