"""The simulated bench with a ColorChecker, its LVF calibrated without error."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig import resources
from labrig.bench import Recording
from labrig.calibration import LVF_KIND
from labrig.sim.bench_settings import LvfSettings
from labrig.sim.lamp import WAVELENGTH_NM as ROOM_NM
from labrig.sim.optics import bent_curves, measured_curves
from tests.analyse.recorded import quietly
from tests.analyse.spectral_bench import true_lvf_of
from tests.quick_yaml import read_quickly, write_quickly

FloatArray = NDArray[np.float64]
WIDTH, HEIGHT = 240, 160


def record(
    folder: Path,
    protocol: dict[str, Any],
    change: Callable[[dict[str, Any]], None] = lambda rig: None,
) -> Path:
    """The folder of a run of `protocol` on the shipped rig with a chart, as `change` leaves it."""
    rig = read_quickly((resources.folder("config") / "sim-chart.yaml").read_text())
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    rig["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}
    rig["devices"]["camera"].pop("warm_up")
    rig["devices"]["lamp"]["warm_up"] = "10 min"
    rig["optics"]["lvf"] = "lvf.yaml"
    # The filter was calibrated before anything changed.
    settings = LvfSettings.model_validate(rig["simulation"]["lvf"])
    change(rig)
    folder.mkdir(parents=True, exist_ok=True)
    LVF_KIND.write(folder, true_lvf_of(settings, WIDTH, HEIGHT))
    (folder / "rig.yaml").write_text(write_quickly(rig))
    (folder / "protocol.yaml").write_text(write_quickly(protocol))
    return Recording.prepare(folder / "protocol.yaml", folder / "rig.yaml", folder / "runs").record(
        quietly
    )


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
