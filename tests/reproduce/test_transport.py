"""Light that is traced once and folded, against what can be computed without rays."""

import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.reproduce import (
    Geometry,
    Lamp,
    LampTable,
    Matrices,
    Mesh,
    PathLength,
    Paths,
    Pinhole,
    Samples,
    Surface,
    SurfaceMaterial,
    Tracer,
    fold,
)
from labrig.reproduce.transport.tracing_kernels import located_in_texture, rasterised

BANDS = 24
ROOM = Mesh.box((0, 0, 0), (2, 3, 2.5), inward=True)
INSIDE = Pinhole((0, 0.3, 0.1), (1, 1, 0), width_px=24, height_px=24)


def fluorescent(seed: int) -> SurfaceMaterial:
    """A surface that re-radiates much, and at some wavelengths loses little."""
    rng = np.random.default_rng(seed)
    matrix = np.tril(rng.uniform(0, 0.06, (BANDS, BANDS)), -1)
    matrix += np.diag(rng.uniform(0.2, 0.8, BANDS))
    return SurfaceMaterial("dye", matrix.astype(np.float32))


def folded(
    paths: Sequence[Paths],
    geometry: Geometry,
    material: SurfaceMaterial,
    glow: FloatArray,
    lamps: FloatArray,
    *,
    incident: bool = False,
) -> FloatArray:
    everywhere = np.tile(glow, (geometry.n_places, 1)).astype(np.float32)
    return np.asarray(
        fold(
            paths, Matrices.of([material]), geometry.material_of_place, everywhere,
            lamps.reshape(-1, BANDS).astype(np.float32), 1, incident=incident,
        ),
        dtype=np.float64,
    )  # fmt: skip


def room_light(
    length: PathLength, seed: int, per_pixel: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the light of each pixel within a room that glows evenly, its matrix and its glow."""
    geometry = Geometry.of([Surface("room", ROOM, 0)])
    assert geometry.is_room
    dye = fluorescent(seed)
    glow = np.random.default_rng((seed, 1)).uniform(0, 1, BANDS)
    tracer = Tracer(geometry, LampTable.of([], geometry), length, seed)
    paths = list(tracer.from_camera(INSIDE, per_pixel, 1))
    return folded(paths, geometry, dye, glow, np.zeros(0)), dye.matrix.astype(np.float64), glow


@pytest.mark.parametrize("vertices", [1, 6, 12])
def test_in_a_closed_room_every_ray_sees_the_sum_of_so_many_bounces(vertices: int) -> None:
    light, matrix, glow = room_light(PathLength(vertices, 0.0), 10 + vertices, 4)
    bounces = [np.linalg.matrix_power(matrix, n) @ glow for n in range(vertices)]
    np.testing.assert_allclose(light, np.tile(sum(bounces), (len(light), 1)), rtol=1e-6)


@pytest.mark.parametrize(("vertices", "survival"), [(2, 0.8), (4, 0.75), (8, 0.9)])
def test_roulette_leaves_the_mean_as_it_is(vertices: int, survival: float) -> None:
    light, matrix, glow = room_light(PathLength(vertices, survival), 20 + vertices, 32)
    endless = np.linalg.solve(np.eye(BANDS) - matrix, glow)
    error = light.std(axis=0) / np.sqrt(len(light))
    assert (np.abs(light.mean(axis=0) - endless) < 3 * error).all()
    # The error is small enough to find a missing bounce.
    assert (error < 0.03 * endless).all()


def test_a_disk_lamp_over_a_fluorescent_plane() -> None:
    """L = M · lamp · R²/(R² + h²) on the axis of the disk."""
    radius_m, height_m, dye = 0.5, 0.7, fluorescent(5)
    light = np.random.default_rng(6).uniform(0, 1, BANDS)
    geometry = Geometry.of(
        [
            Surface("plane", Mesh.rectangle((-5, -5, 0), (10, 0, 0), (0, 10, 0)), 0),
            Surface("lamp", Mesh.disk((0, 0, height_m), (0, 0, -1), radius_m), -1, lamp=0),
        ]
    )
    lamps = LampTable.of([Lamp("disk", "area", light)], geometry)
    camera = Pinhole(
        (0.0, 1e-4, 0.1), (0, 0, 0), (0, 1, 0), vertical_fov_deg=0.2, width_px=8, height_px=8
    )
    paths = list(Tracer(geometry, lamps, PathLength(1, 0.0)).from_camera(camera, 4096, 1))
    seen = folded(paths, geometry, dye, np.zeros(BANDS), light).mean(axis=0)
    expected = dye.matrix @ light * radius_m**2 / (radius_m**2 + height_m**2)
    np.testing.assert_allclose(seen, expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("kind", "vector", "irradiance"),
    [
        ("point", (0.3, 0.4, 1.2), 1.2 / 1.3**3),
        ("distant", (0.6, 0.0, 0.8), 0.8),
        ("sky", (0.0, 0.0, 1.0), np.pi),
    ],
)
def test_irradiance_of_other_lamps(
    kind: str, vector: tuple[float, float, float], irradiance: float
) -> None:
    plane = Mesh.rectangle((-0.001, -0.001, 0), (0.002, 0, 0), (0, 0.002, 0))
    geometry = Geometry.of([Surface("plane", plane, 0, samples=(1, 1))])
    lamps = LampTable.of([Lamp("lamp", kind, np.ones(BANDS), vector)], geometry)  # type: ignore[arg-type]
    paths = list(Tracer(geometry, lamps, PathLength(2, 0.0)).from_surface(0, 64, 1))
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    seen = folded(paths, geometry, black, np.zeros(BANDS), np.ones(BANDS), incident=True)
    np.testing.assert_allclose(seen, irradiance, rtol=2e-3)


@pytest.mark.parametrize("samples", [(1, 1), (3, 2), "vertices"])
@pytest.mark.parametrize("turned", [False, True])
def test_the_light_between_two_squares_that_meet_at_an_edge(samples: Samples, turned: bool) -> None:
    """The view factor of perpendicular unit squares with a common edge is 0.20004."""
    edges = ((0, 1, 0), (1, 0, 0)) if turned else ((1, 0, 0), (0, 1, 0))
    floor = Mesh.grid((0, 0, 0), *edges, 2)
    wall = Mesh.rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1))
    geometry = Geometry.of(
        [
            Surface("floor", floor.turned_over() if turned else floor, 0, samples=samples),
            Surface("wall", wall, 0, samples=(1, 1)),
        ]
    )
    n_places = geometry.places_of(0).stop
    tracer = Tracer(geometry, LampTable.of([], geometry), PathLength(2, 0.0), seed=9)
    paths = list(tracer.from_surface(0, (1 << 17) // n_places, 1))
    glow = np.zeros((geometry.n_places, BANDS), np.float32)
    glow[geometry.places_of(1)] = 1.0
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    seen = fold(
        paths, Matrices.of([black]), geometry.material_of_place, glow,
        np.zeros((0, BANDS), np.float32), 1, incident=True,
    )  # fmt: skip
    if samples == "vertices":
        # Each vertex counts as much as the area that it stands for.
        area = np.bincount(floor.faces.ravel(), np.repeat(floor.areas_m2 / 3, 3))
        mean = float(area @ seen[:, 0]) / area.sum()
    else:
        mean = float(seen[:, 0].mean())
    assert mean == pytest.approx(np.pi * 0.20004, rel=0.01)


def test_what_is_between_casts_a_shadow() -> None:
    plane = Mesh.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    screen = Mesh.rectangle((0, -2, 0.5), (2, 0, 0), (0, 4, 0))
    geometry = Geometry.of(
        [
            Surface("plane", plane, 0, samples=(8, 1)),
            Surface("screen", screen, 0, is_two_sided=True),
        ]
    )
    lamps = LampTable.of([Lamp("sun", "distant", np.ones(BANDS))], geometry)
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    paths = list(Tracer(geometry, lamps, PathLength(1, 0.0)).from_surface(0, 16, 1))
    seen = folded(paths, geometry, black, np.zeros(BANDS), np.ones(BANDS), incident=True)
    np.testing.assert_allclose(seen[:, 0], [1, 1, 1, 1, 0, 0, 0, 0], atol=1e-6)


def test_the_glow_of_a_wall_between_its_texels_and_its_vertices_is_interpolated() -> None:
    """A glow that is linear over the wall is seen as linear, whichever way it is stored."""
    camera = Pinhole((0.5, 0.5, 1.2), (0.5, 0.5, 0), (0, 1, 0), 40.0, 16, 16)
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    wall = Mesh.grid((0, 0, 0), (1, 0, 0), (0, 1, 0), 4)
    for samples in ((8, 8), "vertices"):
        geometry = Geometry.of([Surface("wall", wall, 0, samples=samples)])
        x = wall.vertices_m[:, 0] if samples == "vertices" else np.tile((np.arange(8) + 0.5) / 8, 8)
        tracer = Tracer(geometry, LampTable.of([], geometry), PathLength(1, 0.0), seed=3)
        paths = list(tracer.from_camera(camera, 1024, 1))
        glow = np.repeat(x[:, None], BANDS, axis=1).astype(np.float32)
        seen = fold(
            paths, Matrices.of([black]), geometry.material_of_place, glow,
            np.zeros((0, BANDS), np.float32), 1,
        )  # fmt: skip
        half = 1.2 * np.tan(np.deg2rad(20))
        columns = 0.5 + half * (2 * (np.arange(16) + 0.5) / 16 - 1)
        np.testing.assert_allclose(seen[:, 0].reshape(16, 16).mean(axis=0), columns, atol=0.004)


def test_the_same_seed_gives_the_same_light_with_any_number_of_threads() -> None:
    geometry = Geometry.of([Surface("room", ROOM, 0, samples=(8, 8))])
    tracer = Tracer(geometry, LampTable.of([], geometry), PathLength(), 7)
    one, two = (
        [*tracer.from_camera(INSIDE, 512, threads), *tracer.from_surface(0, 512, threads)]
        for threads in (1, 2)
    )
    assert len(one) == len(two) > 2
    for first, second in zip(one, two, strict=True):
        np.testing.assert_array_equal(first.place, second.place)
        np.testing.assert_array_equal(first.weight, second.weight)


def test_the_front_of_a_wall_has_light_and_its_back_is_black() -> None:
    wall = Mesh.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    for two_sided, expected in ((False, 0.0), (True, 1.0)):
        geometry = Geometry.of([Surface("wall", wall, 0, is_two_sided=two_sided)])
        tracer = Tracer(geometry, LampTable.of([], geometry), PathLength(1, 0.0))
        for height_m, seen in ((1.0, 1.0), (-1.0, expected)):
            camera = Pinhole((0, 0, height_m), (0, 0, 0), (0, 1, 0), 40.0, 4, 4)
            paths = list(tracer.from_camera(camera, 4, 1))
            light = folded(paths, geometry, black, np.ones(BANDS), np.zeros(0))
            np.testing.assert_array_equal(light, seen)


def test_a_point_that_rounding_moves_beside_its_triangle_stays_on_it() -> None:
    """In single precision a point near the edge of a cell may fall into the empty next one."""
    corners = np.array([[[0, 0], [0.5, 0], [0.5, 1]], [[0, 0], [0.5, 1], [0, 1]]], np.float32)
    face_at, _ = rasterised(corners, 8, 4)
    assert (face_at[:, 4:] == -1).all()
    uv = np.array([[0.5000001, 0.3], [0.5000001, 1.0000001]], np.float32)
    cell = np.array([[1, 3], [3, 3]], np.int32)
    faces, weights = located_in_texture(corners, face_at, uv, cell)
    assert np.isin(faces, [0, 1]).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    back = np.einsum("nk,nkc->nc", weights, corners[faces])
    np.testing.assert_allclose(back, uv, atol=1e-6)


def test_a_ball_far_away_that_shows_its_inside_makes_no_room() -> None:
    """Rays that leave the scene are lost, and the sky is seen, unless the room is around all."""
    floor = Surface("floor", Mesh.rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0, samples=(1, 1))
    ball = Surface("ball", Mesh.sphere((5, 0, 0), 0.1, inward=True), 0)
    geometry = Geometry.of([floor, ball])
    assert not geometry.is_room
    lamps = LampTable.of([Lamp("sky", "sky", np.ones(BANDS))], geometry)
    paths = list(Tracer(geometry, lamps, PathLength(2, 0.0)).from_surface(0, 256, 1))
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    seen = folded(paths, geometry, black, np.zeros(BANDS), np.ones(BANDS), incident=True)
    assert seen[0, 0] == pytest.approx(np.pi, rel=0.01)
    assert sum(each.n_escaped for each in paths) == 0


@pytest.mark.parametrize("begin", ["walls", "camera"])
def test_rays_that_leave_a_closed_room_are_traced_again_and_counted(begin: str) -> None:
    """A room of 0.1 µm with slits of 0.4 nm, which count as closed: no light is lost in them."""
    side_m = 1e-7
    whole = Mesh.box((0, 0, 0), (side_m, side_m, side_m), inward=True)
    moved = whole.vertices_m.copy()
    moved[:4, 0] += 4e-10
    camera = Pinhole((0, 0, 0), (side_m, 0, 0), (0, 0, 1), 120.0, 32, 32)
    expected = np.pi * sum(0.5**n for n in range(11))
    for vertices, most in ((whole.vertices_m, 0.0), (moved, 0.02)):
        mesh = Mesh(vertices, whole.faces, whole.uv)
        geometry = Geometry.of([Surface("room", mesh, 0, samples=(6, 4))])
        assert geometry.is_room
        length = PathLength(12 if begin == "walls" else 1, 0.0)
        tracer = Tracer(geometry, LampTable.of([], geometry), length, 5)
        grey = SurfaceMaterial("grey", (0.5 * np.eye(BANDS)).astype(np.float32))
        if begin == "walls":
            paths = list(tracer.from_surface(0, 256, 1))
            seen = folded(paths, geometry, grey, np.ones(BANDS), np.zeros(0), incident=True)
            np.testing.assert_allclose(seen, expected, rtol=1e-5)
        else:
            # One vertex only: all that leaves is the ray from the camera.
            paths = list(tracer.from_camera(camera, 16, 1))
            seen = folded(paths, geometry, grey, np.ones(BANDS), np.zeros(0))
            np.testing.assert_allclose(seen, 1.0, rtol=1e-5)
        share = sum(each.n_escaped for each in paths) / sum(len(each.place) for each in paths)
        assert most / 20 <= share <= most


@pytest.mark.parametrize(
    ("mesh", "inside"),
    [
        (Mesh.sphere((0, 0, 0), 1.0, 12), 4 * np.pi),
        (Mesh.box((0, 0, 0), (2, 2, 2), 30.0, inward=True), -4 * np.pi),
        (Mesh.rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0)), -4 * np.pi / 6),
    ],
)
def test_the_solid_angle_of_a_mesh(mesh: Mesh, inside: float) -> None:
    """A side of a cube has a sixth of the sphere from its middle; its front counts as negative."""
    assert mesh.solid_angle_sr((0.0, 0.0, 0.0)) == pytest.approx(inside, abs=1e-9)
    if mesh.is_closed:
        assert mesh.solid_angle_sr((0.5, 3.0, -0.2)) == pytest.approx(0, abs=1e-9)


def test_light_of_another_side_does_not_run_over_the_edge_of_a_chart() -> None:
    """Sides of a box lie side by side in its texture, and are apart in space."""
    box = Mesh.box((0, 0, 0), (1, 1, 1))
    geometry = Geometry.of([Surface("box", box, 0, samples=(12, 8))])
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    tracer = Tracer(geometry, LampTable.of([], geometry), PathLength(1, 0.0), 3)
    column, row = np.meshgrid(np.arange(12) // 4, np.arange(8) // 4)
    for side, direction in enumerate(
        np.repeat(np.eye(3), 2, axis=0) * np.tile([1, -1], 3)[:, None]
    ):
        glow = np.repeat((column + 3 * row == side).ravel()[:, None], BANDS, axis=1)
        up = np.roll(np.abs(direction), 1)
        camera = Pinhole(tuple(3 * direction), (0, 0, 0), tuple(up), 22.0, 16, 16)
        seen = fold(
            list(tracer.from_camera(camera, 64, 1)), Matrices.of([black]),
            geometry.material_of_place, glow.astype(np.float32),
            np.zeros((0, BANDS), np.float32), 1,
        )  # fmt: skip
        np.testing.assert_array_equal(seen, 1.0)


def test_one_texel_is_the_mean_over_its_surface_not_over_its_texture() -> None:
    """A ball in the light of the sun gets a quarter of it; near its poles the texture is dense."""
    ball = Mesh.sphere((0, 0, 0), 0.5, rows=64)
    black = SurfaceMaterial("black", np.zeros((BANDS, BANDS), np.float32))
    for samples, per_place in (((1, 1), 4096), ((2, 4), 1024), ((64, 1), 256)):
        geometry = Geometry.of([Surface("ball", ball, 0, samples=samples)])
        lamps = LampTable.of([Lamp("sun", "distant", np.ones(BANDS))], geometry)
        paths = list(Tracer(geometry, lamps, PathLength(1, 0.0)).from_surface(0, per_place, 1))
        seen = folded(paths, geometry, black, np.zeros(BANDS), np.ones(BANDS), incident=True)
        rows = seen[:, 0].reshape(samples[::-1]).mean(axis=1)
        cosine = np.cos(np.linspace(np.pi, 0, samples[1] + 1))
        expected = np.diff(np.maximum(cosine, 0) ** 2 / 2) / np.diff(cosine)
        np.testing.assert_allclose(rows, expected, atol=0.003)


def test_paths_from_places_take_little_more_memory_than_is_kept() -> None:
    """Points of all places at once took seven times as much as their paths."""
    wall = Mesh.rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    geometry = Geometry.of([Surface("wall", wall, 0, samples=(256, 256))])
    tracer = Tracer(geometry, LampTable.of([], geometry), PathLength(1, 0.0))
    next(iter(tracer.from_surface(0, 16, 1)))
    tracemalloc.start()
    kept = list(tracer.from_surface(0, 16, 1))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3 * sum(each.nbytes for each in kept)
