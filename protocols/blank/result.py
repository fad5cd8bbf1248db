"""Result of a blank: light after lamp off that is not the sample's glow."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import BLANK_KIND, BlankFile
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.results.budget import Budget
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class StrayLight:
    """Stray light in n frames of C channels.

    Attributes
    ----------
    start_s, t_s
        Begins and middles of the exposures in seconds after lamp off, rising, shape (n,).
    rate, sigma
        Stray light above the constant level and its standard uncertainty in DN/s, shape (n, C).
    constant, constant_sigma
        Constant level and its standard uncertainty in DN/s, shape (C,).
    fades
        Whether the signal still falls in the late frames.
    unclean
        Whether stray light above the constant level is detected, shape (n,).
    first_clean_s
        Start of the first frame from which all are clean, in seconds after lamp off; None if there
        is none.
    """

    start_s: FloatArray
    t_s: FloatArray
    rate: FloatArray
    sigma: FloatArray
    constant: FloatArray
    constant_sigma: FloatArray
    fades: bool
    unclean: BoolArray
    first_clean_s: float | None


@dataclass(frozen=True, eq=False, kw_only=True)
class BlankResult(RunResult):
    """Stray light over time.

    Attributes
    ----------
    calibration
        Calibration for the decays of the same bench; the file `blank.yaml`.
    stray_light
        Stray light of all frames, also of those after the first clean one.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.calibration.first_clean_s, result.stray_light.rate.max())
    """

    kind: ClassVar[str] = "blank"

    calibration: BlankFile
    stray_light: StrayLight

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the constant and of the ambient light in every channel."""
        file = self.calibration
        budgets = {}
        for number, channel in enumerate(file.channels):
            constant = Measured(
                file.constant_dn_per_s[number], file.constant_dn_per_s_sigma[number], "DN/s"
            )
            leak = Measured(
                file.ambient_dn_per_s[number], file.ambient_dn_per_s_sigma[number], "DN/s"
            )
            budgets[f"constant light, {channel}"] = Budget.of(constant)
            budgets[f"light in the dark frames, {channel}"] = Budget.of(
                leak, left_out=("light that all channels share",)
            )
        return budgets

    def provides(self) -> Mapping[str, Any]:
        """Return the calibration."""
        return {BLANK_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `blank.yaml`."""
        BLANK_KIND.write(folder, self.calibration)
