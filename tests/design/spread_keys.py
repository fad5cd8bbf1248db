"""Keys that spread over objects."""

from typing import Any

import numpy as np

from tests.design.small_scene import FLOOR, WALL

#: A floor of 16 × 16 texels, seen from in front of it.
OBJECTS: dict[str, Any] = {
    "floor": {"material": "paint", "rectangle": FLOOR, "samples": [16, 16]},
    "back": {"material": "wall", "rectangle": WALL},
}

PIXELS = {"left": [0.3, 0.6], "right": [0.7, 0.6]}

TIMES_S = [1.0, 20.0, 60.0]

#: Colours after 0 s and rates of decay of both dots.
GLOWS = {"left": ([0.002, 0.03, 0.006], 0.03), "right": ([0.006, 0.004, 0.02], 0.01)}


def keys(glows: dict[str, tuple[list[float], float]] = GLOWS) -> list[dict[str, Any]]:
    return [
        {"at": f"{t} s", "place": name, "colour": (np.exp(-rate * t) * np.array(rgb)).tolist()}
        for name, (rgb, rate) in glows.items()
        for t in TIMES_S
    ]
