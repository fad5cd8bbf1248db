"""Small scenes that are rendered."""

from pathlib import Path
from typing import Any

import numpy as np

from labrig.material import Material
from labrig.optics import absolute_irradiance, read_light
from labrig.reproduce import (
    Scene,
    SceneFile,
    build_scene,
)

LUX = 800.0

BENCH = {"spectrum": "A", "illuminance_lux": 1000.0}


def scene(folder: Path, **changed: Any) -> Scene:
    """A phosphorescent square under a distant lamp that shines for five minutes."""
    content: dict[str, Any] = {
        "name": "square",
        "kind": "scene",
        "bench_light": BENCH,
        "materials": {"paint": {"file": "blue-paint", "assume_albedo": 0.6, "assume_scale": 0.5}},
        "lamps": {"sun": {"kind": "distant", "illuminance_lux": LUX, "towards": [0, 0, 1]}},
        "objects": {
            "square": {
                "material": "paint",
                "rectangle": {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]},
                "samples": [4, 4],
            }
        },
        "camera": {
            "position_m": [0.5, 0.5, 3], "look_at_m": [0.5, 0.5, 0], "up": [0, 1, 0],
            "vertical_fov_deg": 15, "width_px": 4, "height_px": 4,
        },
        "programme": [{"at_s": -300, "lamps": {"sun": 1}}, {"at_s": 0, "lamps": {"sun": 0}}],
        "frames_s": [-1, 0, 10, 60],
        "paths": {"per_pixel": 16, "per_place": 16},
    }  # fmt: skip
    return build_scene(SceneFile.model_validate({**content, **changed}), folder)


def kappa_of(material: Material, lux: float) -> np.ndarray[Any, Any]:
    """Return κ of each state under so many lux of D65, by integrals of its own."""
    edges = np.array(material.bands_nm)
    nm = np.arange(edges[0], edges[-1], 0.01) + 0.005
    band = np.searchsorted(edges, nm) - 1

    def irradiance(spectrum: str, illuminance_lux: float) -> np.ndarray[Any, Any]:
        light = absolute_irradiance(illuminance_lux, read_light(spectrum))
        return np.bincount(band, light.at(nm) * 0.01)

    unit = np.linalg.norm(irradiance("A", 1000.0))
    assert all(state.k_e_per_s for state in material.states)
    k_e = np.array([state.k_e_per_s for state in material.states])
    return np.asarray(k_e @ irradiance("D65", lux) / unit)
