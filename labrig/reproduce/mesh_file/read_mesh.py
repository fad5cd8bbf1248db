"""Reading of a mesh, whatever the format of its file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_MESH_BYTES, read_bytes
from labrig.reproduce.mesh_file.gltf_mesh import gltf_mesh
from labrig.reproduce.mesh_file.obj_mesh import obj_mesh
from labrig.reproduce.mesh_file.ply_mesh import ply_mesh
from labrig.reproduce.mesh_file.stl_mesh import stl_mesh
from labrig.reproduce.transport.mesh import Mesh

#: Readers of the content of a file in a folder, by the ending of its name.
READERS: dict[str, Callable[[bytes, Path], Mesh]] = {
    ".obj": lambda content, _: obj_mesh(content),
    ".ply": lambda content, _: ply_mesh(content),
    ".glb": gltf_mesh,
    ".gltf": gltf_mesh,
    ".stl": lambda content, _: stl_mesh(content),
}


def read_mesh(path: Path) -> Mesh:
    r"""Read a mesh from a file.

    The front of a triangle is where its corners run counter-clockwise, also in parts of glTF that
    are mirrored. Vertices stand in the order of the file, without those that no triangle has; one
    with several texture coordinates stands several times. Lines, points, normals and materials are
    left out.

    Parameters
    ----------
    path
        OBJ, PLY, glTF or STL file.

    Returns
    -------
    Mesh
        Triangles of all objects, groups, solids or nodes, in the file's own unit, with texture
        coordinates where it has some.

    Raises
    ------
    UsageError
        There is no such file, its format is another, it is damaged or says something that labrig
        does not read, its numbers are not those that it states, it has no surface, or texture
        coordinates on a part of it only.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reproduce import read_mesh
    >>> _ = Path("triangle.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    >>> read_mesh(Path("triangle.obj")).area_m2
    0.5
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise UsageError(f"{path}: expected a mesh as {', '.join(READERS)}, got '{path.suffix}'")
    if not path.is_file():
        raise UsageError(f"{path}: expected a file with a mesh, got no such file")
    content = read_bytes(path, MAX_MESH_BYTES)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            mesh = reader(content, path.parent).without_loose_vertices()
            area = mesh.area_m2
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    if not len(mesh.faces):
        raise UsageError(f"{path}: expected a mesh of triangles, got none")
    if not 0 < area < np.inf or not np.isfinite(mesh.vertices_m).all():
        raise UsageError(f"{path}: expected finite triangles with an area, got others")
    return mesh
