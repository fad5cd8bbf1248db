"""Angular runs on a small simulated bench with two LEDs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from labrig.calibration import CameraFile
from labrig.optics import Flat
from labrig.record import read_run
from labrig.sim.optics import vignetting
from tests.analyse.recorded import recorded, shipped_rig

#: What a camera sees nothing of, what it sees with what it excites, and what excites nothing.
LEDS = ("365 nm", "455 nm", "625 nm")


def record_angular(
    folder: Path,
    protocol: dict[str, Any],
    change: Callable[[dict[str, Any]], None] = lambda rig: None,
    **simulation: Any,
) -> Path:
    """The folder of an angular run on the shipped rig for fluorescent materials, as told."""
    rig = shipped_rig("sim-fluorescent")
    rig["devices"]["camera"]["warm_up"] = "1 min"
    textile = {"material": "yellow-textile", "region": [0.05, 0.08, 0.8, 0.8]}
    rig["simulation"] |= {"sample": [textile]} | simulation
    change(rig)
    return recorded(folder, {"protocol": "angular_fluorescence", **protocol}, rig)


def record_sphere(folder: Path, protocol: dict[str, Any], **simulation: Any) -> Path:
    """The folder of an angular run with a sphere, in a larger frame."""
    return record_angular(
        folder,
        {"shape": "sphere", "region": [0.2, 0.02, 0.6, 0.96], **protocol},
        sensor={"width": 360, "height": 240},
        sample=[{"material": "yellow-textile", "region": [0.25, 0.1, 0.5, 0.8], "shape": "sphere"}],
        **simulation,
    )


def true_camera(run: Path, sigma: float = 0.002) -> CameraFile:
    """What a calibration without error would find of the lens."""
    rho2 = np.linspace(0, 1, 50)
    corner = vignetting(64, 96)[0, 0] ** -0.5 - 1
    terms = np.column_stack([rho2, rho2**2, rho2**3])
    falloff, *_ = np.linalg.lstsq(terms, (1 + corner * rho2) ** -2.0 - 1, rcond=None)
    return CameraFile(
        iso=100,
        f_number=4.0,
        channels=("R", "G", "B"),
        flats=(Flat(f_number=4.0, falloff=(tuple(falloff),) * 3, sigma=sigma),),
        camera=read_run(run).camera_identity,
        flicker=0.007,
        flicker_sigma=0.001,
    )
