"""The file of a fluorescent material: its name, its matrix in a file beside it, and its origin."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from labrig.foundation.errors import UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.yaml_file import read_model, write_yaml
from labrig.material.file import Provenance
from labrig.material.reradiation import ReradiationMatrix, read_reradiation, write_reradiation


class FluorescentMaterial(FrozenModel, NotebookViews):
    """A fluorescent material.

    Attributes
    ----------
    name
        Name of the material, for example `yellow-paper`.
    kind
        Kind of the material: `fluorescent`.
    matrix
        Name of the file with the re-radiation matrix, in the same folder.
    provenance
        Origin of the numbers. Default: not recorded.
    """

    name: Annotated[str, Field(min_length=1)]
    kind: Literal["fluorescent"]
    matrix: Annotated[str, Field(min_length=1)]
    provenance: Provenance | None = None


def read_fluorescent(path: str | os.PathLike[str]) -> ReradiationMatrix:
    """Read the matrix of a fluorescent material.

    Parameters
    ----------
    path
        Path of a material file of kind `fluorescent`.

    Returns
    -------
    ReradiationMatrix
        The matrix from the file beside it, with the material's name.

    Raises
    ------
    UsageError, DataError
        One of the files is missing or malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, read_fluorescent, write_fluorescent
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(31, 0.5)))
    >>> write_fluorescent(Path("grey.yaml"), grey)
    >>> read_fluorescent("grey.yaml").reflectance[:3].tolist()
    [0.5, 0.5, 0.5]
    """
    path = Path(path)
    material = read_model(path, FluorescentMaterial)
    beside = path.parent / material.matrix
    if not beside.is_file():
        raise UsageError(
            f"{path}: expected its matrix in the file {beside}, got no such file; put it there"
        )
    return replace(read_reradiation(beside), name=material.name)


def write_fluorescent(
    path: Path, matrix: ReradiationMatrix, provenance: Provenance | None = None
) -> None:
    """Write a fluorescent material, and its matrix as CSV beside it.

    Parameters
    ----------
    path
        Path of the material file, which ends in `.yaml`; the matrix has the same name with `.csv`.
        Both are overwritten.
    matrix
        Reflectance and re-radiation.
    provenance
        Origin of the numbers.

    Raises
    ------
    UsageError
        The path does not end in `.yaml`, or the matrix has no name.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix, write_fluorescent
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(31, 0.5)))
    >>> write_fluorescent(Path("grey.yaml"), grey)
    >>> sorted(path.name for path in Path().glob("grey.*"))
    ['grey.csv', 'grey.yaml']
    """
    if path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"{path}: expected a file name that ends in .yaml")
    if not matrix.name:
        raise UsageError("expected a matrix with a name, got none")
    beside = path.with_suffix(".csv")
    write_reradiation(beside, matrix)
    write_yaml(
        path,
        FluorescentMaterial(
            name=matrix.name, kind="fluorescent", matrix=beside.name, provenance=provenance
        ),
    )
