"""Meshes of files where a scene puts them, held to have their front on the side that is seen."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.reproduce.mesh_file.read_mesh import read_mesh
from labrig.reproduce.scene.object_entry import MeshEntry, ObjectEntry
from labrig.reproduce.transport.mesh import Mesh, rotation

#: Patches of one body that are looked at, the largest ones.
MOST_PATCHES = 100


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
        patches += by_area[:MOST_PATCHES]
    air = -1 if inward else 0
    in_front = [bodies_at(_point_in_front(patch)) for patch in patches if patch.area_m2 > 0]
    least = min(in_front, default=air)
    return least == air if inward else least >= air


def _point_in_front(mesh: Mesh) -> FloatArray:
    """Return a point just in front of the largest triangle, in m."""
    largest = int(np.argmax(mesh.areas_m2))
    middle = mesh.vertices_m[mesh.faces[largest]].mean(axis=0)
    return np.asarray(middle + 1e-6 * np.sqrt(mesh.areas_m2[largest]) * mesh.normals[largest])
