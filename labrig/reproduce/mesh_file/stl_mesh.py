"""Triangles of STL files, in text or binary."""

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.reproduce.mesh_file.polygons import triangles
from labrig.reproduce.transport.mesh import Mesh

HEAD_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_mesh(content: bytes) -> Mesh:
    """Return the solids of an STL file as one mesh.

    Normals are left out: the order of the corners says where the front is.

    Parameters
    ----------
    content
        Content of the file.

    Raises
    ------
    UsageError
        The file is not as long as its count of triangles says, or a line of its text is no STL.
    """
    # Binary files may begin with `solid`, too: their length tells them.
    stated = int.from_bytes(content[80:HEAD_BYTES], "little")
    if len(content) >= HEAD_BYTES and len(content) == HEAD_BYTES + stated * FACET.itemsize:
        corners = np.frombuffer(content, FACET, offset=HEAD_BYTES)["corners"]
        faces = np.arange(3 * stated, dtype=np.int32).reshape(-1, 3)
        return Mesh(corners.reshape(-1, 3).astype(np.float64), faces)
    if not content[:HEAD_BYTES].lstrip().lower().startswith(b"solid") or b"\0" in content:
        raise UsageError(
            f"expected a binary STL of {HEAD_BYTES} + {FACET.itemsize} bytes for each of the "
            f"{stated} triangles that it states, or one in text that begins with 'solid', got "
            f"{len(content)} bytes"
        )
    return _of_text(content)


def _of_text(content: bytes) -> Mesh:
    places: list[list[float]] = []
    lengths: list[int] = []
    # What has been opened and not yet been ended.
    open_parts: list[str] = []
    for number, line in enumerate(content.splitlines(), start=1):
        words = line.decode("utf-8", errors="replace").split()
        if not words:
            continue
        word = words[0].lower()
        inside = open_parts[-1] if open_parts else ""
        if word == "vertex" and inside == "loop":
            places.append(_place(words[1:], number))
            lengths[-1] += 1
        elif (inside, word) in BEGIN:
            open_parts.append(BEGIN[inside, word])
            if word == "outer":
                lengths.append(0)
        elif word == f"end{inside}" and inside:
            open_parts.pop()
        else:
            said = " ".join(words)[:40]
            raise UsageError(f"expected STL, got '{said}' in line {number}")
    if open_parts:
        raise UsageError(f"expected 'end{open_parts[-1]}' at the end, got a file that was cut off")
    corners = np.array(places, dtype=np.float64).reshape(-1, 3)
    return Mesh(corners, triangles(corners, np.array(lengths, dtype=np.int64)).astype(np.int32))


#: What begins with a word within something else.
BEGIN = {("", "solid"): "solid", ("solid", "facet"): "facet", ("facet", "outer"): "loop"}


def _place(words: list[str], number: int) -> list[float]:
    try:
        x, y, z = (float(word) for word in words)
    except ValueError:
        raise UsageError(
            f"expected three numbers after 'vertex', got '{' '.join(words)[:40]}' in line {number}"
        ) from None
    return [x, y, z]
