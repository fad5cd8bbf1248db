"""Result of a chain of protocols: the results of its parts, and the materials from them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.foundation.output_file import make_folder_in
from labrig.material import Material, write_material
from labrig.results.run_result import AnyResult, RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class PhosphorResult(RunResult):
    """A phosphor: the result of every part of the run, and the materials from all of them.

    Attributes
    ----------
    parts
        Result of each part by its name, in the order of the run; those that could not be analysed
        are missing.
    failed
        Reason why a part could not be analysed, by its name.
    materials
        Material of each patch, or of each sample, by its name; that of the only one under "".

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, material in result.materials.items():
    ...     print(name, [state.k_r_per_s for state in material.states])
    """

    kind: ClassVar[str] = "phosphor"

    parts: Mapping[str, AnyResult]
    failed: Mapping[str, str]
    materials: Mapping[str, Material]

    def provides(self) -> dict[str, Any]:
        """Return the values that all parts provide; the later part has priority."""
        provided: dict[str, Any] = {}
        for part in self.parts.values():
            for name, value in part.provides().items():
                by_patch = isinstance(value, Mapping)
                provided[name] = {**provided.get(name, {}), **value} if by_patch else value
        return provided

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name, and the material files."""
        for name, part in self.parts.items():
            part.write_files(make_folder_in(folder, name))
        for patch, material in self.materials.items():
            write_material(make_folder_in(folder, patch) / "material.yaml", material)
