"""Base of the results of chains: the result of every part of the run."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labrig.foundation.output_file import make_folder_in
from labrig.results.run_result import AnyResult, RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainResult(RunResult):
    """Results of the parts of a chain.

    Attributes
    ----------
    parts
        Result of each part by its name, in the order of the run; those that could not be analysed
        are missing.
    failed
        Reason why a part could not be analysed, by its name.
    """

    parts: Mapping[str, AnyResult]
    failed: Mapping[str, str]

    def provides(self) -> dict[str, Any]:
        """Return the values that all parts provide; the later part has priority."""
        provided: dict[str, Any] = {}
        for part in self.parts.values():
            for name, value in part.provides().items():
                by_patch = isinstance(value, Mapping)
                provided[name] = {**provided.get(name, {}), **value} if by_patch else value
        return provided

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name."""
        for name, part in self.parts.items():
            part.write_files(make_folder_in(folder, name))
