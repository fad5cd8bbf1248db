"""Result of a calibration's check: what changed on the bench since it was calibrated."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.foundation.arrays import FloatArray
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class PictureChange:
    """A picture of the card through the filter, compared with that of a calibration.

    Attributes
    ----------
    brightness
        Brightness over that of the calibration, all places together.
    colour
        Light at 420 nm relative to that at 680 nm, over the same ratio of the calibration. A lamp
        that burns at a lower temperature has less than 1.
    shift_nm
        Distance in nm of the filter from where it was in the frame, the larger one of its two ends.
    wavelength_nm
        Wavelengths in nm of the places that were compared, shape (places,).
    unevenness
        Brightness of each place over what brightness and colour explain, less 1, shape (places,).
    """

    brightness: Measured
    colour: Measured
    shift_nm: Measured
    wavelength_nm: FloatArray
    unevenness: FloatArray

    @property
    def worst(self) -> tuple[float, float]:
        """Largest unevenness, and its wavelength in nm."""
        place = int(abs(self.unevenness).argmax())
        return float(self.unevenness[place]), float(self.wavelength_nm[place])


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
