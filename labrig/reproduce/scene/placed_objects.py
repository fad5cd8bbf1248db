"""Objects of a scene at any time: their meshes, where these are, and of which materials."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from labrig.foundation.array_file import read_arrays
from labrig.foundation.arrays import FloatArray, Int32Array
from labrig.foundation.errors import UsageError
from labrig.foundation.picture_file import read_picture
from labrig.reproduce.mesh_file.read_mesh import read_mesh
from labrig.reproduce.scene.entries import MaterialMap, MeshEntry, ObjectEntry
from labrig.reproduce.surface.surface_material import SurfaceMaterial
from labrig.reproduce.transport.geometry import Samples, Surface
from labrig.reproduce.transport.mesh import Mesh, rotation

#: Patches of one body that are looked at, the largest ones.
MAX_PATCHES = 100


def placed_mesh(name: str, entry: ObjectEntry, shape: MeshEntry, folder: Path) -> Mesh:
    """Return a mesh of a file at its place.

    Parameters
    ----------
    name
        Name of the object.
    entry, shape
        The object, and its shape.
    folder
        Folder to which the name of the file is relative.

    Raises
    ------
    UsageError
        The file is none of a mesh, or, of an object that is not two-sided, triangles turn their
        front to different sides, a body has its front on the side that is not seen, or it has
        holes; lamps may have these.
    """
    turn = np.eye(3)
    for axis, angle_deg in zip(np.eye(3), shape.turned_deg, strict=True):
        turn = rotation(axis, angle_deg) @ turn
    mesh = read_mesh(folder / shape.file)
    placed_m = mesh.vertices_m @ turn.T * shape.size_m + shape.position_m
    mesh = replace(mesh, vertices_m=placed_m)
    # What a file already has with its front inside stays so.
    if shape.inward and not (mesh.is_closed and mesh.volume_m3 < 0):
        mesh = mesh.turned_over()
    if entry.two_sided:
        return mesh
    if not mesh.is_turned_alike:
        raise UsageError(
            f"{name}: expected triangles that all have their front on the same side, got some "
            f"inverted ones in {shape.file}; turn their normals over, or give 'two_sided: true'"
        )
    if not mesh.is_closed and entry.lamp is None:
        raise UsageError(
            f"{name}: expected a closed mesh, got one with holes in {shape.file}; its back "
            "would be black: close it, or give 'two_sided: true'"
        )
    if not _is_seen_from_front(mesh, shape.inward):
        raise UsageError(
            f"{name}: expected bodies whose front is {'in' if shape.inward else 'out'}side, got "
            f"an inverted one in {shape.file}; turn its normals over, or give "
            f"'inward: {str(not shape.inward).lower()}' or 'two_sided: true'"
        )
    return mesh


def _is_seen_from_front(mesh: Mesh, inward: bool) -> bool:
    """Return whether the space in front of all triangles is air, or filled by other bodies.

    A point is within so many bodies: one with its front inside, such as a hollow of another or a
    room, counts −1 within. Air is where none is, or within a room.
    """
    bodies = [piece for piece in mesh.pieces() if piece.is_closed]
    low = np.array([body.vertices_m.min(axis=0) for body in bodies])
    high = np.array([body.vertices_m.max(axis=0) for body in bodies])

    def bodies_at(point_m: FloatArray) -> int:
        within = np.logical_and(low <= point_m, point_m <= high).all(axis=1)
        near = np.flatnonzero(within).tolist()
        return round(sum(bodies[number].solid_angle_sr(point_m) for number in near) / (4 * np.pi))

    # Bodies that touch along a whole side are one piece, but several between their common edges.
    patches = []
    for body in bodies:
        by_area = sorted(body.pieces(most_at_edge=2), key=lambda patch: -patch.area_m2)
        patches += by_area[:MAX_PATCHES]
    air = -1 if inward else 0
    in_front = [bodies_at(_point_in_front(patch)) for patch in patches if patch.area_m2 > 0]
    least = min(in_front, default=air)
    return least == air if inward else least >= air


def _point_in_front(mesh: Mesh) -> FloatArray:
    """Return a point just in front of the largest triangle, in m."""
    largest = int(np.argmax(mesh.areas_m2))
    middle = mesh.vertices_m[mesh.faces[largest]].mean(axis=0)
    return np.asarray(middle + 1e-6 * np.sqrt(mesh.areas_m2[largest]) * mesh.normals[largest])


#: Texels of a phosphor where nobody says otherwise; the sides of a box lie three by two.
TEXELS, TEXELS_OF_BOX = (64, 64), (96, 64)
MAX_AREA_M2 = 1e12


def surface_over_time(
    name: str,
    entry: ObjectEntry,
    folder: Path,
    numbers: Mapping[str, int],
    lamps: Mapping[str, int],
    materials: tuple[SurfaceMaterial, ...],
) -> Callable[[float], Surface]:
    """Return a function that gives an object at a time in s."""
    mesh = _mesh(name, entry, folder)
    if not 0 < mesh.area_m2 < MAX_AREA_M2:
        raise UsageError(f"{name}: expected a surface with an area, got {mesh.area_m2:g} m²")
    lamp = -1 if entry.lamp is None else lamps[entry.lamp]
    used = [numbers[entry.material]] if entry.material is not None else []
    if entry.material_map is not None:
        used = [numbers[each] for each in entry.material_map.materials.values()]
    glows = any(materials[number].parameters is not None for number in used)
    samples = _samples(name, entry, mesh, glows)
    of_texel = None
    if entry.material_map is not None:
        if not isinstance(samples, tuple):
            raise UsageError(f"{name}: expected texels with 'material_map', got {samples}")
        of_texel = _mapped(name, entry.material_map, folder, samples, numbers)
    place = _motion(name, entry, mesh, folder)

    def at(t_s: float) -> Surface:
        return Surface(
            name, place(t_s), used[0] if used else -1, samples, lamp, entry.two_sided, of_texel
        )

    return at


def _samples(name: str, entry: ObjectEntry, mesh: Mesh, glows: bool) -> Samples:
    if entry.material_map is not None:
        return entry.samples or TEXELS
    if not glows:
        return None
    if entry.particles is not None:
        return "particles"
    of_shape = TEXELS if entry.box is None else TEXELS_OF_BOX
    return entry.samples or ("vertices" if mesh.uv is None else of_shape)


def _mesh(name: str, entry: ObjectEntry, folder: Path) -> Mesh:
    if (flat := entry.rectangle) is not None:
        return Mesh.grid(flat.corner_m, flat.edge_u_m, flat.edge_v_m, flat.parts)
    if entry.disk is not None:
        return Mesh.disk(**entry.disk.model_dump())
    if entry.box is not None:
        return Mesh.box(**entry.box.model_dump())
    if entry.sphere is not None:
        return Mesh.sphere(**entry.sphere.model_dump())
    if entry.particles is not None:
        _, position_m = _trajectory(folder / entry.particles.file)
        return Mesh.octahedra(position_m[0], entry.particles.radius_m)
    assert entry.mesh is not None
    return placed_mesh(name, entry, entry.mesh, folder)


def _motion(name: str, entry: ObjectEntry, mesh: Mesh, folder: Path) -> Callable[[float], Mesh]:
    """Return a function that gives the mesh at a time in s."""
    if (wave := entry.wave) is not None:
        assert mesh.uv is not None
        front, along = mesh.normals[0], mesh.uv[:, 0] / wave.wavelength

        def waved(t_s: float) -> Mesh:
            height = wave.amplitude_m * np.sin(2 * np.pi * (along - t_s / wave.period_s))
            return Mesh(mesh.vertices_m + height[:, None] * front, mesh.faces, mesh.uv)

        return waved
    if entry.particles is not None:
        radius_m = entry.particles.radius_m
        times_s, position_m = _trajectory(folder / entry.particles.file)
        return lambda t_s: Mesh.octahedra(_between(t_s, times_s, position_m), radius_m)
    if entry.vertices_over_time is None:
        return lambda _: mesh
    path = folder / entry.vertices_over_time
    moments_s, vertices_m = _over_time(path, "vertices_m")
    if vertices_m.shape[1:] != mesh.vertices_m.shape:
        raise UsageError(
            f"{path}: expected 'vertices_m' of {len(mesh.vertices_m)} vertices for {name}, got "
            f"those of {vertices_m.shape[1]}"
        )
    return lambda t_s: Mesh(_between(t_s, moments_s, vertices_m), mesh.faces, mesh.uv)


def _trajectory(path: Path) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) in s and places of particles (n, particles, 3) in m."""
    return _over_time(path, "position_m")


def _between(t_s: float, times_s: FloatArray, places_m: FloatArray) -> FloatArray:
    """Return places at a time, straight between neighbouring times, (points, 3)."""
    at = float(np.interp(t_s, times_s, np.arange(len(times_s))))
    before = max(min(int(at), len(times_s) - 2), 0)
    after = min(before + 1, len(times_s) - 1)
    return np.asarray(places_m[before] + (at - before) * (places_m[after] - places_m[before]))


def _over_time(path: Path, name: str) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) and places (n, points, 3) from a file."""
    content = read_arrays(path)
    try:
        times_s = np.asarray(content["t_s"], dtype=np.float64)
        places_m = np.asarray(content[name], dtype=np.float64)
    except (KeyError, ValueError, TypeError) as error:
        raise UsageError(
            f"{path}: expected a .npz file with 't_s' and '{name}' ({error})"
        ) from None
    is_series = places_m.ndim == 3 and places_m.shape[0] == times_s.size and places_m.size > 0
    if not is_series or places_m.shape[2] != 3 or not np.isfinite(places_m).all():
        raise UsageError(
            f"{path}: expected finite '{name}' of shape ({times_s.size}, points, 3), got "
            f"{places_m.shape}"
        )
    if times_s.ndim != 1 or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
        raise UsageError(f"{path}: expected times 't_s' that rise")
    return times_s, places_m


def _mapped(
    name: str,
    entry: MaterialMap,
    folder: Path,
    samples: tuple[int, int],
    numbers: Mapping[str, int],
) -> Int32Array:
    """Return the number of the material of each texel, by the nearest colour (rows, columns)."""
    import cv2

    picture = read_picture(folder / entry.file, f"for the material_map of {name}")
    resized = cv2.resize(picture, samples, interpolation=cv2.INTER_NEAREST)[::-1]
    colours = []
    for text in entry.materials:
        digits = text.removeprefix("#")
        if len(digits) != 6 or not all(digit in "0123456789abcdefABCDEF" for digit in digits):
            raise UsageError(f"{name}: expected colours such as '#ff8000', got '{text}'")
        colours.append([int(digits[k : k + 2], 16) for k in (0, 2, 4)])
    distance = np.abs(resized[:, :, None, :].astype(float) - np.array(colours)).sum(axis=3)
    chosen = np.array([numbers[material] for material in entry.materials.values()])
    return np.asarray(chosen[np.argmin(distance, axis=2)], dtype=np.int32)
