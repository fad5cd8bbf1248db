"""Materials of any kind, from any of their files."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import MATERIAL, PICTURE, TABLE, require_kind
from labrig.foundation.yaml_file import read_yaml
from labrig.material.file import Material, read_material

# SciPy, which matrices need, is slow to load.
if TYPE_CHECKING:
    from labrig.material.reradiation import MatrixLayout, ReradiationMatrix

#: Endings of material files; all others are those of matrices.
YAML = (".yaml", ".yml")
PHOSPHOR, FLUORESCENT = "phosphor", "fluorescent"


def read_any_material(
    name_or_path: str | os.PathLike[str],
    entry: str | None = None,
    *,
    pixel: tuple[int, int] | None = None,
    layout: "MatrixLayout | None" = None,
) -> "Material | ReradiationMatrix":
    """Read a phosphor, or the re-radiation matrix of a fluorescent material.

    Parameters
    ----------
    name_or_path
        Path of a material file (`.yaml`), whose `kind` tells what it is; name of a shipped
        material such as `blue-paint` or `yellow-textile`; or path of a file that
        `read_reradiation` reads.
    entry, pixel
        Matrix in a file of several, see `read_reradiation`.
    layout
        Answers to what the table of an excitation-emission matrix leaves open.

    Returns
    -------
    Material or ReradiationMatrix
        The phosphor, or the matrix.

    Raises
    ------
    UsageError, DataError
        There is no such material, a file is malformed, or `entry`, `pixel` or `layout` is given
        for a material file.

    Examples
    --------
    >>> from labrig.material import read_any_material
    >>> type(read_any_material("blue-paint")).__name__
    'Material'
    >>> type(read_any_material("paper.csv")).__name__
    'ReradiationMatrix'
    """
    path = Path(name_or_path)
    if path.suffix:
        require_kind(path, MATERIAL, TABLE, PICTURE)
    if path.suffix and path.suffix.lower() not in YAML:
        from labrig.material.reradiation import read_reradiation

        return read_reradiation(path, entry, pixel=pixel, layout=layout)
    for option, value in (("entry", entry), ("pixel", pixel), ("layout", layout)):
        if value is not None:
            raise UsageError(f"{path}: expected a file of matrices for '{option}', got a material")
    is_dye = str(name_or_path) in resources.names("config/fluorescent")
    place = "config/fluorescent" if is_dye else "config/materials"
    file = resources.find(place, "material", name_or_path)
    kind = read_yaml(file).get("kind")
    if kind not in (PHOSPHOR, FLUORESCENT):
        got = "nothing" if kind is None else f"'{kind}'"
        raise UsageError(f"{file}: expected 'kind: {PHOSPHOR}' or 'kind: {FLUORESCENT}', got {got}")
    if kind == PHOSPHOR:
        return read_material(file)
    from labrig.material.fluorescent import read_fluorescent

    return read_fluorescent(file)
