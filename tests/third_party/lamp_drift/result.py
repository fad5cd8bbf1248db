"""The result: numbers that a notebook reads, and the calibration's file."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from labrig.foundation.arrays import FloatArray
from labrig.results import Measured, RunResult
from lamp_drift.calibration import DRIFT_KIND, DriftFile


@dataclass(frozen=True, eq=False, kw_only=True)
class LampDriftResult(RunResult):
    """A straight line through the light of a lamp.

    Attributes
    ----------
    drift
        Change of the light relative to its mean, per second.
    time_s
        Start of each photograph after that of the first one, in seconds, shape (n,).
    level_dn_per_s
        Mean of the green channel over the exposure time, shape (n,).
    change_sigmas
        Difference from the drift that the rig file names, in standard deviations; None if it
        names none.
    """

    kind: ClassVar[str] = "lamp_drift"

    drift: Measured
    time_s: FloatArray
    level_dn_per_s: FloatArray
    change_sigmas: float | None = None

    def write_files(self, folder: Path) -> None:
        """Write `drift.yaml` into the result's folder."""
        file = DriftFile(drift_per_s=self.drift.value, drift_per_s_sigma=self.drift.sigma)
        DRIFT_KIND.write(folder, file)
