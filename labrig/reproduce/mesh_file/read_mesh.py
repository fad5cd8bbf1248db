"""Reading of a mesh, whatever the format of its file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from labrig.errors import UsageError
from labrig.input_file import read_bytes
from labrig.reproduce.mesh_file.gltf_mesh import gltf_parts
from labrig.reproduce.mesh_file.obj_mesh import obj_parts
from labrig.reproduce.mesh_file.ply_mesh import ply_parts
from labrig.reproduce.mesh_file.stl_mesh import stl_parts
from labrig.reproduce.transport.mesh import Mesh

#: Readers of the content of a file in a folder, by the ending of its name.
READERS: dict[str, Callable[[bytes, Path], list[Mesh]]] = {
    ".obj": lambda content, _: obj_parts(content),
    ".ply": lambda content, _: ply_parts(content),
    ".glb": gltf_parts,
    ".gltf": gltf_parts,
    ".stl": lambda content, _: stl_parts(content),
}


def read_mesh(path: Path) -> Mesh:
    r"""Read a mesh from a file.

    Parameters
    ----------
    path
        OBJ, PLY, glTF or STL file; see `read_parts`.

    Returns
    -------
    Mesh
        Triangles of all parts, in the file's own unit, with texture coordinates where it has some.

    Raises
    ------
    UsageError
        As by `read_parts`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reproduce import read_mesh
    >>> _ = Path("triangle.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    >>> read_mesh(Path("triangle.obj")).area_m2
    0.5
    """
    return Mesh.joined(read_parts(path))


def read_parts(path: Path) -> list[Mesh]:
    r"""Read the parts of a mesh from a file: its objects, groups, solids, or nodes.

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
    list of Mesh
        Parts that have triangles, all or none with texture coordinates.

    Raises
    ------
    UsageError
        There is no such file, its format is another, it is damaged or says something that labrig
        does not read, its numbers are not those that it states, or it has no surface.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reproduce import read_parts
    >>> text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no a\nf 1 2 3\no b\nf -4 -3 -1\n"
    >>> _ = Path("two.obj").write_text(text)
    >>> [part.vertices_m[2].tolist() for part in read_parts(Path("two.obj"))]
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise UsageError(f"{path}: expected a mesh as {', '.join(READERS)}, got '{path.suffix}'")
    if not path.is_file():
        raise UsageError(f"{path}: expected a file with a mesh, got no such file")
    content = read_bytes(path, path.stat().st_size)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            parts = [part.without_loose_vertices() for part in reader(content, path.parent)]
            area = sum(part.area_m2 for part in parts)
        if len({part.uv is None for part in parts}) > 1:
            raise UsageError(
                "expected texture coordinates on all faces or on none, got them on some; unwrap "
                "all of the mesh"
            )
        if not parts:
            raise UsageError("expected a mesh of triangles, got none")
        if not 0 < area < np.inf or not all(np.isfinite(part.vertices_m).all() for part in parts):
            raise UsageError("expected finite triangles with an area, got others")
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    return parts
