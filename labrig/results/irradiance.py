"""What the lamp does to the sample, by itself and through the variable filter that lies on it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import IRRADIANCE_KIND, IrradianceFile
from labrig.results.measured import FloatArray
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class CardRatio:
    """Light of a grey card through the filter over that of the lamp by itself.

    Attributes
    ----------
    value, sigma
        (p, channels) mean over the rounds at p positions; NaN where it was not measured. σ is
        without what is common to all.
    common_sigma
        Relative standard uncertainty that is common to all ratios.
    drift
        Relative scatter of the rounds about their mean, all positions and channels together.
    rounds
        How many rounds there are.
    """

    value: FloatArray
    sigma: FloatArray
    common_sigma: float
    drift: float
    rounds: int


@dataclass(frozen=True, eq=False)
class StripScale:
    """What the filter leaves at p positions, over what its calibration lets expect.

    Attributes
    ----------
    value
        (p,) factors.
    covariance
        (p, p) of their logarithms.
    measured, measured_sigma
        (p,) each position by itself, before neighbours had their say; σ relative, with the
        camera's curves.
    """

    value: FloatArray
    covariance: FloatArray
    measured: FloatArray
    measured_sigma: FloatArray

    @property
    def relative_sigma(self) -> FloatArray:
        """(p,) standard uncertainties of the factors' logarithms."""
        sigma: FloatArray = np.sqrt(np.diag(self.covariance))
        return sigma


@dataclass(frozen=True, eq=False, kw_only=True)
class IrradianceResult(RunResult):
    """Irradiance of every band, directly and along the filter.

    Attributes
    ----------
    calibration
        For excitation on the same bench; the file `irradiance.yaml`.
    centre_nm
        (p,) middle of the band that each position lets through.
    card_ratio
        What the photographs of the grey card show.
    scale
        The same over what the filter's calibration lets expect.

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

    def provides(self) -> Mapping[str, Any]:
        """The irradiance."""
        return {IRRADIANCE_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `irradiance.yaml`."""
        IRRADIANCE_KIND.write_into(folder, self.calibration)
