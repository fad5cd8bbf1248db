"""Result of a measurement of camera curves, and its file `curves.csv`."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.optics import CHART_PATCHES, CURVES_FILE, CameraResponse
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraCurvesResult(RunResult):
    """Estimated spectral sensitivities of a camera.

    Attributes
    ----------
    camera
        Maker and model as the camera states them.
    wavelength_nm
        Wavelengths in nm, shape (n,).
    channels
        Names of the k channels.
    sensitivity, sigma
        Sensitivities, the highest 1, and their σ, to which a common factor does not belong, shape
        (n, k).
    family_mean
        Mean of the shipped cameras with this camera's ratios between channels, shape (n, k).
    family_count, left_out
        Number of shipped cameras that were used, and names of those that were not.
    chart
        Table of the chart's reflectances.
    patch_value, patch_fitted
        Values of the chart's 24 patches in DN/s as measured and by the curves, shape (24, k).
    patch_sigma
        σ of their difference, shape (24, k).
    lamp
        Name of the lamp's spectrum.
    evenness
        Least over most light on the chart, by the grey card; None without one.
    through_filter
        Whether the card was seen through the variable filter, too.
    unusualness
        How far the camera is from the mean of the others; 1 for a usual one.
    misfit
        Factor by which the patches err more than expected; σ is larger by it.
    mean_sigma
        Root mean square of σ from 400 nm to 700 nm, relative to the channels' peaks.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(result.camera, f"{result.mean_sigma:.1%}")
    """

    kind: ClassVar[str] = "camera_curves"

    camera: str
    wavelength_nm: FloatArray
    channels: tuple[str, ...]
    sensitivity: FloatArray
    sigma: FloatArray
    family_mean: FloatArray
    family_count: int
    left_out: tuple[str, ...]
    chart: str
    patch_value: FloatArray
    patch_fitted: FloatArray
    patch_sigma: FloatArray
    lamp: str
    evenness: float | None
    through_filter: bool
    unusualness: float
    misfit: float
    mean_sigma: float

    def response(self) -> CameraResponse:
        """Return the curves as other parts of labrig use them."""
        return CameraResponse(
            self.camera, self.wavelength_nm, self.sensitivity, self.channels, self.sigma
        )

    def pulls(self) -> dict[str, FloatArray]:
        """Return measured less fitted values of each patch over their σ, by name, (k,) each."""
        pulls = (self.patch_value - self.patch_fitted) / self.patch_sigma
        return dict(zip(CHART_PATCHES, pulls, strict=True))

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `curves.csv`, which a rig file names under `optics: camera`."""
        head = ["wavelength_nm", *self.channels, *(f"{name}_sigma" for name in self.channels)]
        rows = np.column_stack([self.wavelength_nm, self.sensitivity, self.sigma])
        cells = ([f"{number:.6g}" for number in row] for row in rows)
        title = " ".join(f"#Camera: {self.camera}".split())
        return {CURVES_FILE: CsvTable(head, cells, (title,))}
