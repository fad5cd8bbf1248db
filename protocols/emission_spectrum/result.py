"""The emission spectrum Λ* of a sample, whether it changes, and its file `emission.yaml`."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.foundation.output_file import make_folder_in
from labrig.results.budget import Budget, named
from labrig.results.emission_spectrum import (
    EmissionSpectrum,
    FilterFrames,
    SpectralComparison,
    write_emission_spectrum,
)
from labrig.results.run_result import RunResult, in_folders


@dataclass(frozen=True, eq=False)
class ChargeSpectrum:
    """The glow after one charge.

    Attributes
    ----------
    lamp
        Name of the lamp that charged the sample.
    frames
        Frames in which light is detected.
    spectrum
        Spectrum of all frames together, its credible band from few draws.
    """

    lamp: str
    frames: FilterFrames
    spectrum: EmissionSpectrum


@dataclass(frozen=True, eq=False)
class PatchSpectrum:
    """The emission spectrum of one patch.

    Attributes
    ----------
    spectrum
        Spectrum after the first charge, all times together; the file `emission.yaml`.
    channels
        Channels of the camera.
    centre_nm
        Centre of the filter's band in nm for every value of a frame, position by position, or
        filter by filter, and within it channel by channel, shape (m,).
    filters
        Names of the colour filters before the camera; empty of the variable filter. With them the
        first values of a frame are those without a filter.
    white_reference
        Whether the camera's curves were corrected by a grey card under the known lamp.
    charges
        Glow after the charge by each lamp that lit, in order of time.
    times
        Comparisons of every frame after the first charge with all others together; empty if it is
        the only one.
    at_times
        Spectrum of each of these frames, from few draws.
    lamps
        Comparisons of every later charge with the first.
    changes_with_time, depends_on_lamp
        Whether any of `times`, of `lamps` is significant.
    """

    spectrum: EmissionSpectrum
    channels: tuple[str, ...]
    centre_nm: FloatArray
    filters: tuple[str, ...]
    white_reference: bool
    charges: tuple[ChargeSpectrum, ...]
    times: tuple[SpectralComparison, ...]
    at_times: tuple[EmissionSpectrum, ...]
    lamps: tuple[SpectralComparison, ...]
    changes_with_time: bool
    depends_on_lamp: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class EmissionSpectrumResult(RunResult):
    """Emission spectra through the variable filter.

    Attributes
    ----------
    patches
        Emission spectrum of each patch by its name; that of the only one under "".

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for patch in result.patches.values():
    ...     print(patch.spectrum.peak_nm, patch.spectrum.centroid)
    """

    kind: ClassVar[str] = "emission_spectrum"

    patches: Mapping[str, PatchSpectrum]

    def provides(self) -> Mapping[str, Any]:
        """Return the spectrum of every patch."""
        return {"spectra": {name: patch.spectrum for name, patch in self.patches.items()}}

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the centroids, whose σ has filter and camera in it."""
        return {
            named(name, "centroid"): Budget(
                patch.spectrum.centroid.value, "nm", undivided=patch.spectrum.centroid.sigma
            )
            for name, patch in self.patches.items()
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `spectrum.csv` of each patch, in a folder of its name."""
        spectra = {name: patch.spectrum for name, patch in self.patches.items()}
        return in_folders({name: spectrum.csv_tables() for name, spectrum in spectra.items()})

    def write_files(self, folder: Path) -> None:
        """Write `emission.yaml` of each patch, in a folder of its name."""
        for name, patch in self.patches.items():
            write_emission_spectrum(make_folder_in(folder, name) / "emission.yaml", patch.spectrum)
