"""Light transport against Mitsuba 3, which shares no code with it.

Run in an environment that has Mitsuba 3.9.0 beside labrig, by hand:
`python -m tests.acceptance.mitsuba_transport`. Its variant `scalar_rgb` has three bands.

Two comparisons. Without fluorescence, the means of pictures of a box at equal depth. With a wall
that re-radiates and another that glows, the irradiance of the floor: Mitsuba knows no
re-radiation, so there it is emission from tiles of the wall, computed from the irradiance of each
tile and iterated to a fixed point.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.reproduce import (
    Geometry,
    Lamp,
    LampTable,
    Matrices,
    Mesh,
    PathLength,
    Pinhole,
    Surface,
    SurfaceMaterial,
    Tracer,
    fold,
)

CAMERA = Pinhole((0.5, -1.38, 0.5), (0.5, 0, 0.5), vertical_fov_deg=40, width_px=128, height_px=128)
DEPTHS = (1, 2, 4, 8, 12)
LIGHT = np.array([8.0, 5.0, 3.0])
TILES, SEEDS = 4, 16
METER_PX = 32


@dataclass(frozen=True)
class Wall:
    """A rectangle of the box, and what it reflects in three bands."""

    name: str
    corner: tuple[float, float, float]
    u: tuple[float, float, float]
    v: tuple[float, float, float]
    albedo: tuple[float, float, float]

    @property
    def mesh(self) -> Mesh:
        return Mesh.rectangle(self.corner, self.u, self.v)


WALLS = (
    Wall("floor", (0, 0, 0), (1, 0, 0), (0, 1, 0), (0.7, 0.7, 0.7)),
    Wall("ceiling", (0, 0, 1), (0, 1, 0), (1, 0, 0), (0.75, 0.72, 0.68)),
    Wall("back", (0, 1, 0), (1, 0, 0), (0, 0, 1), (0.8, 0.8, 0.8)),
    Wall("left", (0, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.1, 0.1)),
    Wall("right", (1, 1, 0), (0, -1, 0), (0, 0, 1), (0.15, 0.5, 0.2)),
)
LAMP = Wall("lamp", (0.35, 0.4, 0.99), (0, 0.2, 0), (0.3, 0, 0), (0, 0, 0))
#: What the right wall re-radiates, by band in (columns): the first excites both others.
RERADIATION = np.array([[0, 0, 0], [0.35, 0, 0], [0.2, 0.3, 0]])
#: What the left wall emits by itself.
GLOW = np.array([0.9, 0.2, 0.05])


def ours(depth: int, per_pixel: int) -> FloatArray:
    """Return the mean of our picture in each band."""
    geometry, lamps, materials = _scene()
    tracer = Tracer(geometry, LampTable.of(lamps, geometry), PathLength(depth, 0.0), seed=depth)
    paths = list(tracer.from_camera(CAMERA, per_pixel, 2))
    glow = np.zeros((geometry.n_places, 3), np.float32)
    light = np.array([lamp.light for lamp in lamps], np.float32)
    picture = fold(paths, Matrices.of(materials), geometry.material_of_place, glow, light, 2)
    return np.asarray(picture.mean(axis=0), dtype=np.float64)


def our_irradiance(per_place: int, seed: int) -> FloatArray:
    """Return the irradiance of the floor with re-radiation, glow and all inter-reflection."""
    geometry, lamps, materials = _scene(reradiates=True)
    tracer = Tracer(geometry, LampTable.of(lamps, geometry), PathLength(8, 0.8), seed)
    paths = list(tracer.from_surface(0, per_place, 2))
    glow = np.zeros((geometry.n_places, 3), np.float32)
    glow[geometry.places_of(3)] = GLOW
    light = np.array([lamp.light for lamp in lamps], np.float32)
    irradiance = fold(
        paths, Matrices.of(materials), geometry.material_of_place, glow, light, 2, incident=True
    )
    return np.asarray(irradiance.mean(axis=0), dtype=np.float64)


def mitsubas(depth: int, per_pixel: int) -> FloatArray:
    """Return the mean of Mitsuba's picture in each band."""
    import mitsuba as mi

    scene = {
        **_mitsuba_walls({}),
        "integrator": {"type": "path", "max_depth": depth + 1, "rr_depth": 10_000},
        "sensor": {
            "type": "perspective",
            "fov": CAMERA.vertical_fov_deg,
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(
                list(CAMERA.position_m), list(CAMERA.look_at_m), list(CAMERA.up)
            ),
            "film": _film(CAMERA.width_px),
            "sampler": {"type": "independent", "sample_count": per_pixel, "seed": depth},
        },
    }
    picture = np.array(mi.render(mi.load_dict(scene)))
    return np.asarray(picture.reshape(-1, 3).mean(axis=0), dtype=np.float64)


def mitsubas_irradiances(per_tile: int, rounds: int) -> FloatArray:
    """Return irradiances of the floor by emission of tiles, iterated to a fixed point."""
    tiles = np.zeros((TILES, TILES, 3))
    for _ in range(rounds):
        irradiance = np.array(
            [
                [_meter(tiles, ("right", row, column), per_tile, 1) for column in range(TILES)]
                for row in range(TILES)
            ]
        )
        tiles = irradiance @ RERADIATION.T / np.pi
    return np.array([_meter(tiles, ("floor", 0, 0), 8 * per_tile, seed) for seed in range(SEEDS)])


def _scene(
    reradiates: bool = False,
) -> tuple[Geometry, tuple[Lamp, ...], list[SurfaceMaterial]]:
    surfaces, materials = [], []
    for number, wall in enumerate(WALLS):
        matrix = np.diag(wall.albedo)
        if reradiates and wall.name == "right":
            matrix = matrix + RERADIATION
        materials.append(SurfaceMaterial(wall.name, matrix.astype(np.float32)))
        surfaces.append(Surface(wall.name, wall.mesh, number, samples=(1, 1)))
    surfaces.append(Surface("lamp", LAMP.mesh, -1, lamp=0))
    return Geometry.of(surfaces), (Lamp("lamp", "area", LIGHT),), materials


def _meter(tiles: FloatArray, at: tuple[str, int, int], samples: int, seed: int) -> FloatArray:
    """Return the irradiance of a wall, or of a tile of the right one, as Mitsuba computes it."""
    import mitsuba as mi

    scene = {
        **_mitsuba_walls({"tiles": tiles}, at, samples),
        "integrator": {"type": "path", "max_depth": 40, "rr_depth": 8},
    }
    value = np.array(mi.render(mi.load_dict(scene), seed=seed))
    return np.asarray(value.reshape(-1, 3).mean(axis=0), dtype=np.float64)


def _film(size: int) -> dict[str, Any]:
    return {
        "type": "hdrfilm",
        "width": size,
        "height": size,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }


def _mitsuba_walls(
    emitting: dict[str, Any], meter: tuple[str, int, int] | None = None, samples: int = 0
) -> dict[str, Any]:
    """Return the box as Mitsuba's dictionary; its lamp reflects nothing."""
    content: dict[str, Any] = {"type": "scene"}
    sensor = {
        "type": "irradiancemeter",
        # Many pixels, since the sum of one is in single precision.
        "film": _film(METER_PX),
        "sampler": {"type": "independent", "sample_count": samples // METER_PX**2},
    }
    for wall in (*WALLS, LAMP):
        is_tiled = wall.name == "right" and "tiles" in emitting
        parts = TILES if is_tiled else 1
        for row in range(parts):
            for column in range(parts):
                shape = _rectangle(wall, parts, row, column)
                if wall.name == "lamp":
                    shape["emitter"] = _emitter(LIGHT)
                elif is_tiled:
                    shape["emitter"] = _emitter(emitting["tiles"][row, column])
                elif wall.name == "left" and emitting:
                    shape["emitter"] = _emitter(GLOW)
                if meter == (wall.name, row, column):
                    shape["sensor"] = sensor
                content[f"{wall.name}-{row}-{column}"] = shape
    return content


def _rectangle(wall: Wall, parts: int, row: int, column: int) -> dict[str, Any]:
    import mitsuba as mi

    u, v = np.array(wall.u) / parts, np.array(wall.v) / parts
    corner = np.array(wall.corner) + column * u + row * v
    matrix = np.eye(4)
    # Mitsuba's rectangle reaches from -1 to 1.
    matrix[:3, 0], matrix[:3, 1] = u / 2, v / 2
    matrix[:3, 2] = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    matrix[:3, 3] = corner + u / 2 + v / 2
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f(matrix),
        "bsdf": {
            "type": "diffuse",
            "reflectance": {"type": "rgb", "value": list(map(float, wall.albedo))},
        },
    }


def _emitter(radiance: FloatArray) -> dict[str, Any]:
    return {"type": "area", "radiance": {"type": "rgb", "value": [float(x) for x in radiance]}}


def main() -> None:
    """Print both comparisons."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    print("means of a picture, ours over Mitsuba's, without fluorescence")
    for depth in DEPTHS:
        own, other = ours(depth, 512), mitsubas(depth, 512)
        print(f"  {depth:2d} vertices  {other.round(4)}  ratio - 1 {own / other - 1}")
    print("irradiance of the floor with a wall that re-radiates and one that glows")
    own = _mean(np.array([our_irradiance(1 << 16, seed) for seed in range(SEEDS)]), "ours")
    other = _mean(mitsubas_irradiances(1 << 16, 5), "Mitsuba's")
    print(f"  ratio - 1 {own / other - 1}")


def _mean(values: FloatArray, name: str) -> FloatArray:
    mean, sigma = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
    print(f"  {name} {mean.round(4)} ± {sigma.round(4)}")
    return np.asarray(mean)


if __name__ == "__main__":
    main()
