"""Result of an irradiance run: the lamp's light on the sample, directly and through the filter."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import IRRADIANCE_KIND, IrradianceFile
from labrig.foundation.arrays import FloatArray
from labrig.results.budget import HEADLINE_NM, Budget
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class CardRatio:
    """Signal of a grey card through the filter relative to that under the lamp itself.

    Attributes
    ----------
    value, sigma
        Mean ratio over the rounds and its independent standard uncertainty at p positions, shape
        (p, channels); NaN where it was not measured.
    common_sigma
        Relative standard uncertainty common to all ratios.
    drift
        Relative scatter of the rounds about their mean, all positions and channels together.
    rounds
        Number of rounds.
    """

    value: FloatArray
    sigma: FloatArray
    common_sigma: float
    drift: float
    rounds: int


@dataclass(frozen=True, eq=False)
class StripScale:
    """Light through the filter at p positions relative to the expectation by its calibration.

    Attributes
    ----------
    value
        Factors, shape (p,).
    covariance
        Covariance of the factors' logarithms, shape (p, p).
    measured, measured_sigma
        Factor of each position alone, before smoothing, and its relative standard uncertainty with
        that of the camera's curves, shape (p,).
    """

    value: FloatArray
    covariance: FloatArray
    measured: FloatArray
    measured_sigma: FloatArray

    @property
    def relative_sigma(self) -> FloatArray:
        """Standard uncertainties of the factors' logarithms, shape (p,)."""
        sigma: FloatArray = np.sqrt(np.diag(self.covariance))
        return sigma


@dataclass(frozen=True, eq=False, kw_only=True)
class IrradianceResult(RunResult):
    """Irradiance of every band, directly and along the filter.

    Attributes
    ----------
    calibration
        Calibration for excitation on the same bench; the file `irradiance.yaml`.
    centre_nm
        Centre of the band that each position transmits in nm, shape (p,).
    card_ratio
        Ratios measured on the grey card.
    scale
        Ratios relative to the expectation by the filter's calibration.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.calibration.bands_nm, result.scale.value / result.scale.measured)
    """

    kind: ClassVar[str] = "irradiance"

    calibration: IrradianceFile
    centre_nm: FloatArray
    card_ratio: CardRatio
    scale: StripScale

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the lamp's light over that of some places, or of every light."""
        file = self.calibration
        rows = range(len(file.lights))
        if not file.lights:
            rows = np.unique(
                [np.argmin(np.abs(self.centre_nm - near_nm)) for near_nm in HEADLINE_NM]
            ).tolist()
        return {
            f"light by the lamp itself over that at {self.centre_nm[row]:.0f} nm": Budget(
                file.ratio[row],
                noise=file.ratio[row] * file.scale_sigma,
                calibration=file.ratio[row] * float(self.scale.relative_sigma[row]),
                left_out=("fluorescence of the card",),
            )
            for row in rows
        }

    def provides(self) -> Mapping[str, Any]:
        """Return the calibration."""
        return {IRRADIANCE_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `irradiance.yaml`."""
        IRRADIANCE_KIND.write(folder, self.calibration)
