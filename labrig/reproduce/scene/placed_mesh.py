"""Meshes of files where a scene puts them, held to have their front on the side that is seen."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from labrig.errors import UsageError
from labrig.reproduce.mesh_file.read_mesh import read_parts
from labrig.reproduce.scene.object_entry import MeshEntry, ObjectEntry
from labrig.reproduce.transport.mesh import Mesh, rotation


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
    parts = [
        replace(part, vertices_m=part.vertices_m @ turn.T * shape.size_m + shape.position_m)
        for part in read_parts(folder / shape.file)
    ]
    # What a file already has with its front inside stays so.
    mesh = Mesh.joined(parts)
    if shape.inward and not (mesh.is_closed and mesh.volume_m3 < 0):
        parts = [part.turned_over() for part in parts]
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
    if not _is_seen_from_front(_bodies(parts), shape.inward):
        raise UsageError(
            f"{name}: expected bodies whose front is {'in' if shape.inward else 'out'}side, got "
            f"an inverted one in {shape.file}; turn its normals over, or give "
            f"'inward: {str(not shape.inward).lower()}' or 'two_sided: true'"
        )
    return mesh


def _bodies(parts: Sequence[Mesh]) -> list[Mesh]:
    """Return the closed bodies of some parts: pieces of one part, or of several together."""
    pieces = [piece for part in parts for piece in part.pieces()]
    open_ones = [piece for piece in pieces if not piece.is_closed]
    over_parts = Mesh.joined(open_ones).pieces() if open_ones else []
    return [piece for piece in (*pieces, *over_parts) if piece.is_closed and piece.volume_m3]


def _is_seen_from_front(bodies: Sequence[Mesh], inward: bool) -> bool:
    """Return whether the space in front of all bodies is air, or filled by other bodies.

    A point is within so many bodies: one with its front inside, such as a hollow of another or a
    room, counts −1 within. Air is where none is, or within a room.
    """
    if not bodies:
        return True
    low = np.array([body.vertices_m.min(axis=0) for body in bodies])
    high = np.array([body.vertices_m.max(axis=0) for body in bodies])
    in_front = []
    for number, body in enumerate(bodies):
        corner = body.vertices_m[0]
        is_near = ((low <= corner) & (corner <= high)).all(axis=1)
        is_near[number] = False
        solid_angle_sr = sum(
            bodies[other].solid_angle_sr(corner) for other in np.flatnonzero(is_near).tolist()
        )
        in_front.append(round(solid_angle_sr / (4 * np.pi)) - (body.volume_m3 < 0))
    return min(in_front) == (-1 if inward else 0)
