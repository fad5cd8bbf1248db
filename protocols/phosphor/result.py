"""Result of a chain of protocols: the results of its parts, and the materials from them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from labrig.foundation.output_file import make_folder_in
from labrig.material import Material, write_material
from labrig.results.run_result import ChainResult


@dataclass(frozen=True, eq=False, kw_only=True)
class PhosphorResult(ChainResult):
    """A phosphor: the result of every part of the run, and the materials from all of them.

    Attributes
    ----------
    materials
        Material of each patch, or of each sample, by its name; that of the only one under "".

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, material in result.materials.items():
    ...     print(name, [state.k_r_per_s for state in material.states])
    """

    kind: ClassVar[str] = "phosphor"

    materials: Mapping[str, Material]

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name, and the material files."""
        super().write_files(folder)
        for patch, material in self.materials.items():
            write_material(make_folder_in(folder, patch) / "material.yaml", material)
