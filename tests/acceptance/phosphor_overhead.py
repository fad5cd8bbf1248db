"""Time of pictures whose materials phosphoresce, and of the same where they do not.

    python -m tests.acceptance.phosphor_overhead [SCENE ...] [--rounds 5] [--pictures 6]

The shipped scenes after figures 1 and 12 of Nalbach, Seidel and Ritschel at 640 × 480 pixels, in
the light, and the same scenes whose phosphors only reflect, with the same albedo. They state 454 ms
with and 448 ms without phosphorescence (figure 1). Printed is the least time of a round's pictures
at 25 pictures a second, the median of all rounds with its standard error, and the time of the
first picture, for which the samples are charged from the programme's begin. Both renderings take
turns, so that other work of the computer slows both.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from labrig.foundation import resources
from labrig.reproduce import Renderer, Scene, load_scene
from tests.quick_yaml import read_quickly, write_quickly

SIZE = 640, 480
#: Paths a pixel: those of the scene (None), or fewer where every picture traces them anew.
PATHS = {"painted-owl": None, "waving-cloth": 4}
PICTURES_PER_S = 25.0


def reflecting(name: str, folder: Path) -> Scene:
    """Return a shipped scene whose phosphors are surfaces of the same albedo."""
    path = resources.find("config/scenes", "scene", name)
    described = read_quickly(path.read_text())
    for key, material in described["materials"].items():
        if "file" in material:
            described["materials"][key] = {"albedo": material["assume_albedo"]}
    for placed in described["objects"].values():
        # Texels hold levels of phosphors alone.
        placed.pop("samples", None)
        if "material_map" in placed:
            placed["material_map"]["file"] = str(path.parent / placed["material_map"]["file"])
    plain = folder / f"{name}.yaml"
    plain.write_text(write_quickly(described))
    return load_scene(plain)


@dataclass
class Times:
    """Times of the first picture and of a later one in ms, a number for each round."""

    first_ms: list[float] = field(default_factory=list)
    later_ms: list[float] = field(default_factory=list)

    def add(self, scene: Scene, begin_s: float, pictures: int) -> None:
        """Render the first picture and as many later ones."""
        taken = []
        start = time.perf_counter()
        renderer = Renderer(scene)
        for number in range(pictures + 1):
            renderer.frame(begin_s + number / PICTURES_PER_S)
            now = time.perf_counter()
            taken.append(1000 * (now - start))
            start = now
        self.first_ms.append(taken[0])
        self.later_ms.append(min(taken[1:]))


def median(numbers: Sequence[float]) -> tuple[float, float]:
    """Return the median and its standard error, 1.25 σ/√n, with σ from the quartiles."""
    low, middle, high = np.quantile(numbers, (0.25, 0.5, 0.75))
    return float(middle), float(1.25 * (high - low) / 1.35 / np.sqrt(len(numbers)))


def text(numbers: Sequence[float]) -> str:
    """Return the median with its standard error."""
    return "{:.1f} ± {:.1f}".format(*median(numbers))


def main() -> None:
    """Print both times of each scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(PATHS))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--pictures", type=int, default=6)
    asked = parser.parse_args()
    print(
        f"{SIZE[0]} × {SIZE[1]} pixels, {os.cpu_count()} cores, {asked.rounds} rounds of ", end=""
    )
    print(f"{asked.pictures} pictures at {PICTURES_PER_S:g} a second; ms a picture")
    for name in asked.scenes:
        with tempfile.TemporaryDirectory() as folder:
            scenes = {
                "with": load_scene(name).resized(*SIZE, PATHS[name]),
                "without": reflecting(name, Path(folder)).resized(*SIZE, PATHS[name]),
            }
            # In the light, where both have something to show.
            begin_s = min(t_s for t_s in scenes["with"].file.frames_s)
            begin_s -= 1.0 if begin_s < 0 else 0.0
            times = {kind: Times() for kind in scenes}
            for _ in range(asked.rounds):
                for kind, scene in scenes.items():
                    times[kind].add(scene, begin_s, asked.pictures)
        lit, plain = times["with"], times["without"]
        more = np.subtract(lit.later_ms, plain.later_ms)
        print(
            f"{name}: {text(lit.later_ms)} ms with, {text(plain.later_ms)} ms without "
            f"phosphorescence, {text(more.tolist())} ms more; first picture {text(lit.first_ms)} "
            f"ms with, {text(plain.first_ms)} ms without",
            flush=True,
        )


if __name__ == "__main__":
    main()
