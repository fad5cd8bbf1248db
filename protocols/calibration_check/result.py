"""Result of a calibration's check: what changed on the bench since it was calibrated."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.results.run_result import RunResult
from labrig.results.strip_profile import PictureChange


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationCheckResult(RunResult):
    """Comparison of the bench with the calibration that a run uses.

    Attributes
    ----------
    calibration
        Name of the run that calibrated the bench.
    age_h
        Age of the calibration in hours.
    change
        What changed since.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(f"{result.change.brightness.value:.3f}")
    """

    kind: ClassVar[str] = "calibration_check"

    calibration: str
    age_h: float
    change: PictureChange
