"""What a chain of protocols found: the results of its parts, and the materials they make."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.material import Material, write_material
from labrig.results.run_result import AnyResult, RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class PhosphorResult(RunResult):
    """A phosphor: what every part of the run found, and the materials from all of them.

    Attributes
    ----------
    parts
        By name, in the order of the run; those that could not be analysed are missing.
    failed
        Why a part could not be analysed, by its name.
    materials
        By patch; under "" the only one.

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
        """What all parts provide; where two provide the same, what the later one does."""
        provided: dict[str, Any] = {}
        for part in self.parts.values():
            for name, value in part.provides().items():
                by_patch = isinstance(value, Mapping)
                provided[name] = {**provided.get(name, {}), **value} if by_patch else value
        return provided

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name, and the material files."""
        for name, part in self.parts.items():
            (folder / name).mkdir(exist_ok=True)
            part.write_files(folder / name)
        for patch, material in self.materials.items():
            (folder / patch).mkdir(exist_ok=True)
            write_material(folder / patch / "material.yaml", material)
