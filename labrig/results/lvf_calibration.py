"""What the calibration of a linear variable filter gives."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import LVF_KIND, LvfFile
from labrig.optics import CameraResponse, Strip
from labrig.results.measured import FloatArray
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class StripProfile:
    """Light along a strip, pixel by pixel.

    Attributes
    ----------
    position
        (n,) rising from 0 at the strip's left end to 1 at its right end.
    value_dn_per_s
        (n, channels) mean across the strip.
    """

    position: FloatArray
    value_dn_per_s: FloatArray


@dataclass(frozen=True, eq=False)
class SliceValues:
    """Light in the slices of a strip, from all frames of one scene.

    Attributes
    ----------
    value, sigma
        (positions, channels) in DN/s; NaN where all frames clip. σ is without what lamp, shutter
        and aperture change from one scene to the next: that is common to all places and channels.
    """

    value: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class LocatedLines:
    """Lines of a lamp found along a strip.

    Attributes
    ----------
    wavelength_nm
        (l,) rising; of a blend, of its first line.
    position, sigma
        (l,) where they are, and one standard deviation, in the unit of the profile's positions.
    fwhm
        Width of a single line in that unit, in the middle of the lines.
    rising
        Whether the wavelength grows with the position, from left to right.
    explained
        Fraction of the profile's variance that the lines and a straight background explain.
    """

    wavelength_nm: FloatArray
    position: FloatArray
    sigma: FloatArray
    fwhm: float
    rising: bool
    explained: float

    def __str__(self) -> str:
        """Which lines, and which way round."""
        way = "rising" if self.rising else "falling"
        return f"{', '.join(f'{nm:.0f}' for nm in self.wavelength_nm)} nm, {way} to the right"


@dataclass(frozen=True, eq=False)
class StripLines:
    """A strip under the mercury lamp.

    Attributes
    ----------
    strip
        With its wavelengths rising as they were found.
    profile
        From its left end to its right end.
    lines
        At positions from the blue end, 0, to the red end, 1.
    """

    strip: Strip
    profile: StripProfile
    lines: LocatedLines


@dataclass(frozen=True, eq=False)
class PlacedStrip:
    """The strip on the sample by its mercury lines.

    Attributes
    ----------
    strip
        Such that the map known from before the camera holds along it.
    residual_nm
        (l,) wavelength of the map there minus that of the line.
    sigma_nm
        Standard uncertainty of the strip's place, in the middle of the lines.
    """

    strip: Strip
    residual_nm: FloatArray
    sigma_nm: float


@dataclass(frozen=True)
class Stripes:
    """How far the glow is from where the card was lit.

    Attributes
    ----------
    strip
        On the sample as the camera sees it.
    shift_nm, sigma_nm
        Along the strip, towards the red end.
    """

    strip: Strip
    shift_nm: float
    sigma_nm: float


@dataclass(frozen=True)
class FilterMisfit:
    """How far the frames of a colour filter are from the transmittances, rms along the strip.

    Attributes
    ----------
    name
        Of the filter that should have been in.
    own, best
        Of its own transmittance, and of the best one.
    like
        Whose that is.
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
    """Relative sensitivity (n, channels) of a camera's channels at (n,) wavelengths."""

    wavelength_nm: FloatArray
    sensitivity: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class LvfCalibrationResult(RunResult):
    """A calibrated linear variable filter.

    Attributes
    ----------
    calibration
        The file `lvf.yaml`: bands at p positions, map of wavelengths, places of the strip.
    before_camera, on_sample
        The strip under the mercury lamp, looked through and on the sample.
    map_residual_nm, map_order
        (l,) wavelength of the map minus that of each line before the camera; 1 or 2: straight or
        bent.
    placed
        The strip on the sample by its lines.
    stripes, why_no_stripes
        The strip on the sample by what glows; None: there are no stripes, for that reason.
    card
        The grey card in the slices of the strip, without the strip.
    through_filters
        The card through the strip and each colour filter that was photographed, by its name;
        `none` is without one.
    filter_misfits
        Of every colour filter that was photographed.
    filters
        Names of the f colour filters that took part.
    transmittance_residual
        (f, p) transmittance measured minus what the calibrated strip lets expect, mean of the
        channels by their light; NaN where it says nothing.
    band_misfit
        (p,) root mean square of what the fit leaves, in σ; where it is above 1, σ was raised by it.
    camera_before
        The camera's curves as they were known; `calibration` has them as the filters tell them.

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
    why_no_stripes: str
    card: SliceValues
    through_filters: Mapping[str, SliceValues]
    filter_misfits: tuple[FilterMisfit, ...]
    filters: tuple[str, ...]
    transmittance_residual: FloatArray
    band_misfit: FloatArray
    camera_before: CameraCurves

    @property
    def camera_curves(self) -> CameraResponse:
        """The camera's curves as the filters tell them."""
        assert self.calibration.camera is not None, "a calibration has them"
        return self.calibration.camera.response()

    @property
    def map_rms_nm(self) -> float:
        """Root of the mean squared residual of the map."""
        return float(np.sqrt(np.mean(self.map_residual_nm**2)))

    def provides(self) -> Mapping[str, Any]:
        """The calibrated filter."""
        return {LVF_KIND.name: self.calibration}

    def write_files(self, folder: Path) -> None:
        """Write `lvf.yaml`."""
        LVF_KIND.write_into(folder, self.calibration)
