"""Result of a bench's calibration: the results of its parts, and the bench that they belong to."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import REFERENCE_KIND, ReferenceFile
from labrig.results.run_result import ChainResult


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationResult(ChainResult):
    """A bench's calibration: the result of every part of the run.

    Attributes
    ----------
    reference
        The bench, with the picture by which later runs check that it is still the same.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.reference.made, ", ".join(result.parts))
    """

    kind: ClassVar[str] = "calibration"

    reference: ReferenceFile

    def provides(self) -> dict[str, Any]:
        """Return the calibrations of all parts, and the reference."""
        return super().provides() | {"reference": self.reference}

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name, and `reference.yaml`."""
        super().write_files(folder)
        REFERENCE_KIND.write(folder, self.reference)
