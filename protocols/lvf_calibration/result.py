"""Result of the calibration of a linear variable filter."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import LVF_KIND, LvfFile
from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Strip
from labrig.results.budget import Budget
from labrig.results.run_result import RunResult
from labrig.results.strip_profile import LocatedLines, SliceValues, StripProfile


@dataclass(frozen=True, eq=False)
class StripLines:
    """A strip under the mercury lamp.

    Attributes
    ----------
    strip
        Place of the strip, with the direction of its wavelengths by the lines.
    profile
        Light from its left end to its right end.
    lines
        Lines at positions from the blue end, 0, to the red end, 1.
    """

    strip: Strip
    profile: StripProfile
    lines: LocatedLines


@dataclass(frozen=True, eq=False)
class PlacedStrip:
    """The strip on the sample, located by its mercury lines.

    Attributes
    ----------
    strip
        Place along which the wavelength map from before the camera holds.
    residual_nm
        Wavelength of the map minus that of each line in nm, shape (l,).
    sigma_nm
        Standard uncertainty of the strip's place in nm, in the middle of the lines.
    """

    strip: Strip
    residual_nm: FloatArray
    sigma_nm: float


@dataclass(frozen=True)
class Stripes:
    """Displacement of the glow from the place where the card was lit.

    Attributes
    ----------
    strip
        Place of the strip on the sample as the camera sees it.
    shift_nm, sigma_nm
        Shift along the strip towards the red end, and its standard uncertainty, in nm.
    """

    strip: Strip
    shift_nm: float
    sigma_nm: float


@dataclass(frozen=True)
class FilterMisfit:
    """Deviation of a colour filter's frames from transmittances, RMS along the strip.

    Attributes
    ----------
    name
        Name of the filter that should have been in place.
    own, best
        Deviation from its own transmittance, and from the best one.
    like
        Name of the filter with the best transmittance.
    left_out
        Whether another filter, none or something else was in its place.
    """

    name: str
    own: float
    best: float
    like: str
    left_out: bool


@dataclass(frozen=True, eq=False)
class CameraCurves:
    """Spectral sensitivity of a camera's channels.

    Attributes
    ----------
    wavelength_nm
        Wavelengths in nm, shape (n,).
    sensitivity
        Relative sensitivity, shape (n, channels).
    """

    wavelength_nm: FloatArray
    sensitivity: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class LvfCalibrationResult(RunResult):
    """A calibrated linear variable filter.

    Attributes
    ----------
    calibration
        Bands at p positions, wavelength map and places of the strip; the file `lvf.yaml`.
    before_camera, on_sample
        The strip under the mercury lamp, before the camera and on the sample.
    map_residual_nm
        Wavelength of the map minus that of each line before the camera in nm, shape (l,).
    map_order
        Degree of the map: 1 is straight, 2 bent.
    placed
        The strip on the sample by its lines.
    stripes, no_stripes_reason
        The strip on the sample by its glow; None if there are no stripes, and the reason for it.
    card
        Signal of the grey card in the slices of the strip, without the strip.
    through_filters
        Signal of the card through the strip and each photographed colour filter, by its name;
        `none` is without one.
    filter_misfits
        Misfit of every photographed colour filter.
    filters
        Names of the f colour filters that were used.
    transmittance_residual
        Measured transmittance minus that of the calibrated strip, mean of the channels weighted by
        their light, shape (f, p); NaN where it is undetermined.
    band_misfit
        Root mean square residual of the fit in σ, shape (p,); where it is above 1, σ was raised by
        it.
    camera_before
        The camera's curves before the calibration; `calibration` has those corrected by the
        filters.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.map_rms_nm, result.calibration.lvf.bands.centre_nm)
    """

    kind: ClassVar[str] = "lvf_calibration"

    calibration: LvfFile
    before_camera: StripLines
    on_sample: StripLines
    map_residual_nm: FloatArray
    map_order: int
    placed: PlacedStrip
    stripes: Stripes | None
    no_stripes_reason: str
    card: SliceValues
    through_filters: Mapping[str, SliceValues]
    filter_misfits: tuple[FilterMisfit, ...]
    filters: tuple[str, ...]
    transmittance_residual: FloatArray
    band_misfit: FloatArray
    camera_before: CameraCurves

    @property
    def camera_curves(self) -> CameraResponse:
        """The camera's curves, corrected by the filters."""
        assert self.calibration.camera is not None, "a calibration has them"
        return self.calibration.camera.response()

    @property
    def map_rms_nm(self) -> float:
        """Root mean square residual of the wavelength map in nm."""
        return float(np.sqrt(np.mean(self.map_residual_nm**2)))

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of centre and width of the bands at both ends and in the middle.

        Their σ has noise, camera, lines and colour filters in it, and is enlarged by the misfit.
        """
        bands, sigma = self.calibration.bands, self.calibration.sigma
        budgets = {}
        last = len(self.calibration.position) - 1
        for row in (0, last // 2, last):
            at = f"at position {self.calibration.position[row]:.2f}"
            for quantity, name in (("centre", "centre_nm"), ("width", "fwhm_nm")):
                budgets[f"{quantity} of the band {at}"] = Budget(
                    getattr(bands, name)[row], "nm", undivided=getattr(sigma, name)[row]
                )
        return budgets

    def provides(self) -> Mapping[str, Any]:
        """Return the calibrated filter."""
        return {LVF_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `lvf.yaml`."""
        LVF_KIND.write(folder, self.calibration)
