"""The simulated bench with a ColorChecker, its LVF calibrated without error."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from labrig.calibration import LVF_KIND
from labrig.foundation.arrays import FloatArray
from labrig.sim.bench_settings import LvfSettings
from labrig.sim.lamp import WAVELENGTH_NM as ROOM_NM
from labrig.sim.optics import bent_curves, measured_curves
from tests.analyse.recorded import recorded, shipped_rig
from tests.analyse.spectral_bench import true_lvf_of

WIDTH, HEIGHT = 240, 160


def record(
    folder: Path,
    protocol: dict[str, Any],
    change: Callable[[dict[str, Any]], None] = lambda rig: None,
) -> Path:
    """The folder of a run of `protocol` on the shipped rig with a chart, as `change` leaves it."""
    rig = shipped_rig("sim-chart", WIDTH, HEIGHT)
    rig["devices"]["camera"].pop("warm_up")
    rig["devices"]["lamp"]["warm_up"] = "10 min"
    rig["optics"]["lvf"] = "lvf.yaml"
    # The filter was calibrated before anything changed.
    settings = LvfSettings.model_validate(rig["simulation"]["lvf"])
    change(rig)
    folder.mkdir(parents=True, exist_ok=True)
    LVF_KIND.write(folder, true_lvf_of(settings, WIDTH, HEIGHT))
    return recorded(folder, protocol, rig)


def with_camera(name: str) -> Callable[[dict[str, Any]], None]:
    """The room's camera has the curves of another model, and still calls itself a Canon."""

    def change(rig: dict[str, Any]) -> None:
        rig["simulation"]["sensor"]["curves"] = name

    return change


def true_curves(name: str | None = None, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Wavelengths and curves, shape (n, 3), of the room's camera."""
    if name is not None:
        return ROOM_NM, measured_curves(name).sensitivity.T
    return ROOM_NM, bent_curves(np.random.default_rng([seed, 0])).sensitivity.T
