"""Result of a bench's calibration: the results of its parts, and the bench that they belong to."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import REFERENCE_KIND, ReferenceFile
from labrig.foundation.output_file import make_folder_in
from labrig.results.run_result import AnyResult, RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationResult(RunResult):
    """A bench's calibration: the result of every part of the run.

    Attributes
    ----------
    parts
        Result of each part by its name, in the order of their analysis; those that could not be
        analysed are missing.
    failed
        Reason why a part could not be analysed, by its name.
    reference
        The bench, with the picture by which later runs check that it is still the same.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.reference.made, ", ".join(result.parts))
    """

    kind: ClassVar[str] = "calibration"

    parts: Mapping[str, AnyResult]
    failed: Mapping[str, str]
    reference: ReferenceFile

    def provides(self) -> dict[str, Any]:
        """Return the calibrations of all parts, and the reference."""
        provided: dict[str, Any] = {"reference": self.reference}
        for part in self.parts.values():
            provided |= part.provides()
        return provided

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name, and `reference.yaml`."""
        for name, part in self.parts.items():
            part.write_files(make_folder_in(folder, name))
        REFERENCE_KIND.write(folder, self.reference)
