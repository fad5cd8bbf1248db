"""A small scene in which a material is designed: a corner of two squares under a lamp."""

from pathlib import Path
from typing import Any

from labrig.foundation.yaml_file import validate, write_yaml
from labrig.reproduce import SceneFile

LUX = 2000.0
#: One metre upwards, and one wall behind it that sends light back.
FLOOR = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]}
WALL = {"corner_m": [0, 1, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 0, 1]}


def corner(folder: Path, **changed: Any) -> Path:
    """Write a scene whose floor is to be designed, under a sun for five minutes from -300 s on."""
    content: dict[str, Any] = {
        "name": "corner",
        "kind": "scene",
        "bench_light": {"spectrum": "450nm", "illuminance_lux": 3.0},
        "materials": {"paint": {"albedo": 0.4}, "wall": {"albedo": 0.6}},
        "lamps": {"sun": {"kind": "distant", "illuminance_lux": LUX, "towards": [0, -1, 1]}},
        "objects": {
            "floor": {"material": "paint", "rectangle": FLOOR, "samples": [6, 6]},
            "back": {"material": "wall", "rectangle": WALL},
        },
        "camera": {
            "position_m": [0.5, -1.2, 1.2], "look_at_m": [0.5, 0.6, 0.2], "vertical_fov_deg": 45,
            "width_px": 12, "height_px": 12,
        },
        "programme": [{"at_s": -300, "lamps": {"sun": 1}}, {"at_s": 0, "lamps": {"sun": 0}}],
        "frames_s": [-1],
        "paths": {"per_pixel": 16, "per_place": 64},
    }  # fmt: skip
    path = folder / "corner.yaml"
    write_yaml(path, validate({**content, **changed}, SceneFile, "corner"))
    return path
