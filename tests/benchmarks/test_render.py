"""Pictures of a box: all of a first one, a later one, and the fold against NumPy's."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.reproduce import LampTable, Matrices, Paths, Renderer, Tracer, fold, load_scene

Against = Callable[..., None]
THREADS = 2


def numpy_fold(
    parts: list[Paths], matrices: NDArray[Any], of_place: NDArray[Any], lamps: NDArray[Any]
) -> NDArray[Any]:
    """The fold, all paths of a part at once, from the deepest vertices up."""
    pictures = []
    for paths in parts:
        n_vertices = np.diff(paths.first)
        radiance = np.zeros((len(n_vertices), lamps.shape[1]), np.float32)
        for depth in range(int(n_vertices.max(initial=0)) - 1, -1, -1):
            own = np.flatnonzero(n_vertices > depth)
            at = paths.first[own] + depth
            coming = paths.weight[at, None] * radiance[own] + paths.light[at] @ lamps
            for number, matrix in enumerate(matrices):
                chosen = of_place[paths.place[at]] == number
                radiance[own[chosen]] = coming[chosen] @ matrix.T
        seen = paths.seen_lamp >= 0
        radiance[seen] += lamps[paths.seen_lamp[seen]]
        pictures.append(radiance.reshape(-1, paths.per_target, lamps.shape[1]).mean(axis=1))
    return np.concatenate(pictures)


def test_fold_of_a_picture(against: Against) -> None:
    """256² pixels at 64 paths, 24 bands, one wall fluorescent; an eighth of it by NumPy."""
    scene = load_scene("cornell-box").resized(256, 32, 64)
    geometry, lamps = scene.geometry(-1.0), scene.lamps(-1.0)
    tracer = Tracer(geometry, LampTable.of(lamps, geometry), scene.path_length)
    paths = list(tracer.from_camera(scene.camera, 64, THREADS))
    matrices = np.stack([material.matrix for material in scene.materials])
    light = np.array([lamp.light for lamp in lamps], np.float32)
    glow = np.zeros((geometry.n_places, len(scene.bands)), np.float32)

    def ours() -> Any:
        return fold(
            paths, Matrices.of(scene.materials), geometry.material_of_place, glow, light, THREADS
        )

    def numpys() -> Any:
        return numpy_fold(paths, matrices, geometry.material_of_place, light)

    np.testing.assert_allclose(ours(), numpys(), rtol=1e-3, atol=1e-9)
    against(ours, {"NumPy, one thread": numpys}, rounds=3, what="an eighth of a picture: fold")


def test_pictures_of_the_box(against: Against) -> None:
    """256² pixels at 64 paths: the first with ten minutes of charging, and one after that."""
    scene = load_scene("cornell-box")
    renderer = Renderer(scene, THREADS)

    def first() -> None:
        Renderer(scene, THREADS).frame(-1.0)

    renderer.frame(-1.0)
    times = iter(np.linspace(0.1, 60, 50).tolist())
    against(
        lambda: renderer.frame(next(times)),
        {"the first one, with tracing and charging": first},
        rounds=3,
        what="a later picture of 256², 64 paths, 24 bands",
    )
    print(f"paths take {renderer.memory_bytes / 1e6:.0f} MB")
