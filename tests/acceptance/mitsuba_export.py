"""Does Mitsuba 3 render an exported scene as it is known to look?

    python -m tests.acceptance.mitsuba_export

Runs where the package `mitsuba` (3.9.0) is installed beside labrig, in the variant `scalar_rgb`.
Expected values are closed forms and quadratures, no other renderer.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.reproduce import ExportedMesh, Glow, Pinhole, write_mitsuba_scene

#: Largest relative error that passes.
LIMIT = 0.02
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
#: Height in metres of the lamp over the floor, and half its width.
HEIGHT_M, HALF_M = 0.8, 0.5


def rendered(meshes: list[ExportedMesh], camera: Pinhole, **settings: Any) -> FloatArray:
    """Radiance (height, width, 3) by Mitsuba."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    with tempfile.TemporaryDirectory() as folder:
        path = write_mitsuba_scene(Path(folder), meshes, camera, **settings)
        image = mitsuba.render(mitsuba.load_file(str(path)))
        return np.array(image, dtype=np.float64)


def square(half_m: float, z_m: float, is_up: bool) -> FloatArray:
    """Corners of a square about the z axis that faces upwards or downwards."""
    corners = half_m * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    corners[:, 2] = z_m
    return corners if is_up else corners * [-1, 1, 1]


def texture() -> FloatArray:
    """A texture that no turn or mirror leaves unchanged, (h, w, 3)."""
    down, across = np.mgrid[0:24, 0:32] / np.array([24, 32])[:, None, None]
    return np.stack([0.2 + across, 0.1 + down**2, 1 - across * down], axis=-1)


def bilinear(texels: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Values of a texture at (u, v), v upwards, linear between the centres of texels."""
    height, width = texels.shape[:2]
    x = np.clip(u * width - 0.5, 0, width - 1)
    y = np.clip((1 - v) * height - 0.5, 0, height - 1)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    right, low = (x - left)[..., None], (y - top)[..., None]
    upper = texels[top, left] * (1 - right) + texels[top, left + 1] * right
    lower = texels[top + 1, left] * (1 - right) + texels[top + 1, left + 1] * right
    return np.asarray(upper * (1 - low) + lower * low)


def error_of_a_seen_texture() -> float:
    """The glow looked at: every pixel, against the texture; frame 1 of two."""
    glow = Glow(np.array([[9.0, 9.0, 9.0], [0.5, 2.0, 0.1]]), texture())
    mesh = ExportedMesh("glow -- a", square(0.5, 0.0, True), FACES, np.full(3, 0.3), UV, glow)
    angle = float(np.rad2deg(2 * np.arctan(0.5 / 4)))
    camera = Pinhole((0, 0, 4.0), (0, 0, 0), (0, 1, 0), angle, 40, 40)
    image = rendered([mesh], camera, frame=1, samples=400)
    # Means over pixels, as the samples are spread.
    fine = (np.arange(400) + 0.5) / 400
    u, v = np.meshgrid(fine, fine[::-1])
    expected = bilinear(texture(), u, v).reshape(40, 10, 40, 10, 3).mean(axis=(1, 3))
    return float(np.abs(image / (expected * glow.colour[1]) - 1).max())


def floor_scene(glow: Glow) -> tuple[list[ExportedMesh], Pinhole]:
    """A black lamp that shines down upon a grey floor, and a camera at the floor's middle."""
    lamp = ExportedMesh("lamp", square(HALF_M, HEIGHT_M, False), FACES, np.zeros(3), UV, glow)
    floor = ExportedMesh("floor", square(3.0, 0.0, True), FACES, np.array([0.2, 0.5, 0.8]))
    camera = Pinhole((2.0, 0, 0.5), (0, 0, 0), (0, 0, 1), 0.3, 16, 16)
    return [lamp, floor], camera


def error_below_a_lamp() -> float:
    """Floor below a square lamp of one radiance, by the form factor of a rectangle."""
    glow = Glow(np.array([[4.0, 1.0, 0.3]]))
    meshes, camera = floor_scene(glow)
    image = rendered(meshes, camera, samples=512).mean(axis=(0, 1))
    a = HALF_M / HEIGHT_M
    corner = 2 * a / np.sqrt(1 + a**2) * np.arctan(a / np.sqrt(1 + a**2)) / (2 * np.pi)
    expected = meshes[1].base_colour * 4 * corner * glow.colour[0]
    return float(np.abs(image / expected - 1).max())


def error_below_a_texture() -> float:
    """Floor below a textured lamp, by a sum over the lamp's area; away from its middle."""
    glow = Glow(np.array([[4.0, 1.0, 0.3]]), texture() ** 3)
    meshes, camera = floor_scene(glow)
    place = np.array([0.7, -0.4, 0.0])
    camera = replace(camera, look_at_m=(0.7, -0.4, 0.0))
    image = rendered(meshes, camera, samples=1024).mean(axis=(0, 1))
    fine = (np.arange(500) + 0.5) / 500
    u, v = np.meshgrid(fine, fine)
    corners = meshes[0].vertices_m
    points = (
        corners[0]
        + u[..., None] * (corners[1] - corners[0])
        + v[..., None] * (corners[3] - corners[0])
    )
    squared = ((points - place) ** 2).sum(axis=-1)
    cosines = HEIGHT_M**2 / squared
    area = (2 * HALF_M / 500) ** 2
    radiance = bilinear(texture() ** 3, u, v) * glow.colour[0]
    irradiance = (radiance * (cosines / squared)[..., None]).sum(axis=(0, 1)) * area
    expected = meshes[1].base_colour / np.pi * irradiance
    return float(np.abs(image / expected - 1).max())


def error_in_a_furnace() -> float:
    """A closed box whose walls glow alike: a geometric series of 12 vertices."""
    walls = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            corners = square(1.0, side, side < 0)
            walls.append(
                ExportedMesh(
                    f"wall {axis} {side}",
                    np.roll(corners, axis, axis=1),
                    FACES,
                    np.array([0.2, 0.5, 0.8]),
                    glow=Glow(np.array([[1.0, 0.5, 0.1]])),
                )
            )
    camera = Pinhole((0.1, 0.2, 0.3), (1, 0, 0), (0, 0, 1), 60, 24, 24)
    image = rendered(walls, camera, samples=256, most_vertices=12).mean(axis=(0, 1))
    rho = walls[0].base_colour
    expected = np.array([1.0, 0.5, 0.1]) * (1 - rho**12) / (1 - rho)
    return float(np.abs(image / expected - 1).max())


def main() -> None:
    """Print the largest relative error of each scene; the exit code tells of one too large."""
    errors = {
        "glow seen": error_of_a_seen_texture(),
        "floor below a lamp": error_below_a_lamp(),
        "floor below a texture": error_below_a_texture(),
        "furnace": error_in_a_furnace(),
    }
    for name, error in errors.items():
        print(f"{name:24s} {100 * error:.2f} %")
    sys.exit(max(errors.values()) > LIMIT)


if __name__ == "__main__":
    main()
