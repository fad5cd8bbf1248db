"""What a blank shows: light after lamp-off that is no glow."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.calibration import BLANK_KIND, BlankFile
from labrig.results.measured import BoolArray, FloatArray
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class StrayLight:
    """Light in DN/s of n frames by their middles, C channels.

    Attributes
    ----------
    start_s, t_s
        (n,) begins and middles of the exposures after lamp-off, rising.
    rate, sigma
        (n, C) above the constant level.
    constant, constant_sigma
        (C,) what stays.
    fades
        Whether the late frames still get darker.
    unclean
        (n,) whether anything is seen above the constant level.
    first_clean_s
        Begin of the first frame after which all are clean; None: there is none.
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
        For the decays of the same bench; the file `blank.yaml`.
    stray_light
        All frames, also those after the first clean one.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.calibration.first_clean_s, result.stray_light.rate.max())
    """

    kind: ClassVar[str] = "blank"

    calibration: BlankFile
    stray_light: StrayLight

    def provides(self) -> Mapping[str, Any]:
        """The blank."""
        return {BLANK_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `blank.yaml`."""
        BLANK_KIND.write_into(folder, self.calibration)
