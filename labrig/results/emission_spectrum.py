"""The emission spectrum Λ* of a sample, whether it changes, and its file `emission.yaml`."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.interpolate import CubicSpline

from labrig.finite import Finite, NotNegative
from labrig.material import Spectrum
from labrig.optics import band_means, edges_from_centres
from labrig.results.measured import FloatArray, Measured
from labrig.results.run_result import RunResult
from labrig.yaml_file import read_model, write_yaml

#: The grid of the paper's section 4.7.
WAVELENGTH_NM: FloatArray = np.arange(400.0, 701.0, 10.0)
#: Probability that the truth of a wavelength lies between `low` and `high`.
CREDIBLE = 0.6827


class EmissionSpectrum(BaseModel):
    """Λ* on a grid, its largest value 1.

    Attributes
    ----------
    sample
        Its name.
    wavelength_nm
        (n,) every value is the mean about its wavelength, half-way to its neighbours.
    value, sigma
        (n,) and one standard deviation; a common factor is left open and not in it.
    low, high
        (n,) ends of the 68 % credible interval.
    covariance
        (n, n) of the values.
    lamp
        That charged the sample.
    run
        Where it was measured.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["emission_spectrum"] = "emission_spectrum"
    sample: str
    wavelength_nm: tuple[Finite, ...] = Field(min_length=2)
    value: tuple[NotNegative, ...]
    sigma: tuple[NotNegative, ...]
    low: tuple[NotNegative, ...]
    high: tuple[NotNegative, ...]
    covariance: tuple[tuple[Finite, ...], ...]
    lamp: str = "halogen"
    run: str | None = None

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        count = len(self.wavelength_nm)
        columns = (self.value, self.sigma, self.low, self.high, self.covariance, *self.covariance)
        if any(len(column) != count for column in columns):
            raise ValueError(f"expected {count} numbers, one a wavelength, in every column")
        if (np.diff(self.wavelength_nm) <= 0).any():
            raise ValueError("expected rising wavelengths")
        return self

    @classmethod
    def from_draws(
        cls,
        knots_nm: FloatArray,
        value: FloatArray,
        draws: FloatArray,
        *,
        sample: str,
        lamp: str,
        run: str,
    ) -> Self:
        """The spectrum on the grid of `WAVELENGTH_NM`, from a fit on its own knots.

        The draws are brought to one integral: what is common to all wavelengths is no shape.

        Parameters
        ----------
        knots_nm, value
            (k,) of the fitted spectrum, in any unit: straight lines between the knots.
        draws
            (s, k) spectra that the measured values leave possible.
        sample, lamp, run
            As the attributes.
        """
        edges = edges_from_centres(WAVELENGTH_NM)
        means = band_means(knots_nm, value, edges)
        shapes = band_means(knots_nm, draws.T, edges)
        shapes = shapes / shapes.sum(axis=0) * means.sum() / means.max()
        low, high = np.quantile(shapes, [(1 - CREDIBLE) / 2, (1 + CREDIBLE) / 2], axis=1)
        covariance = np.cov(shapes)
        return cls(
            sample=sample,
            wavelength_nm=tuple(WAVELENGTH_NM.tolist()),
            value=tuple((means / means.max()).tolist()),
            sigma=tuple(np.sqrt(np.diag(covariance)).tolist()),
            low=tuple(low.tolist()),
            high=tuple(high.tolist()),
            covariance=tuple(tuple(row) for row in covariance.tolist()),
            lamp=lamp,
            run=run,
        )

    @property
    def peak_nm(self) -> float:
        """Wavelength of the largest value."""
        return self.wavelength_nm[int(np.argmax(self.value))]

    @property
    def centroid(self) -> Measured:
        """Mean wavelength in nm, weighted by the values."""
        nm, value = np.array(self.wavelength_nm), np.array(self.value)
        centroid = float(nm @ value / value.sum())
        lever = (nm - centroid) / value.sum()
        sigma = float(np.sqrt(lever @ np.array(self.covariance) @ lever))
        return Measured(centroid, sigma, "nm")

    def in_bands(self, edges_nm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Means over neighbouring bands (b,), and their covariance (b, b).

        Values are means: a cubic spline through their running sum takes them apart where an edge
        of a band lies within one; straight lines between them would fill valleys.
        """
        ends = edges_from_centres(np.array(self.wavelength_nm))
        sums = np.vstack([np.zeros(len(ends) - 1), np.tril(np.ones((len(ends) - 1,) * 2))])
        sums[1:] *= np.diff(ends)
        edges = np.asarray(edges_nm, dtype=np.float64)
        inside = np.clip(edges, ends[0], ends[-1])
        means = np.diff(CubicSpline(ends, sums)(inside), axis=0) / np.diff(edges)[:, np.newaxis]
        return means @ np.array(self.value), means @ np.array(self.covariance) @ means.T

    def for_material(self) -> Spectrum:
        """As a material's file has it."""
        return Spectrum(wavelength_nm=self.wavelength_nm, value=self.value, sigma=self.sigma)

    def write_csv(self, path: Path) -> None:
        """Write the columns of the grid as a table."""
        with path.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["wavelength_nm", "value", "sigma", "low", "high"])
            columns = (self.wavelength_nm, self.value, self.sigma, self.low, self.high)
            for row in zip(*columns, strict=True):
                table.writerow([f"{number:.6g}" for number in row])


def read_emission_spectrum(path: Path) -> EmissionSpectrum:
    """The spectrum in the file at `path`.

    Raises
    ------
    UsageError
        No such file, or it is malformed.
    """
    return read_model(path, EmissionSpectrum)


def write_emission_spectrum(path: Path, spectrum: EmissionSpectrum) -> None:
    """Write `spectrum` so that `read_emission_spectrum` gives it back."""
    write_yaml(path, spectrum)


@dataclass(frozen=True, eq=False)
class FilterFrames:
    """Frames of one scene through the filter: its brightness may change, its colours may not.

    Attributes
    ----------
    t_s
        (f,) middle of each exposure after lamp-off.
    value_dn_per_s, sigma_dn_per_s
        (f, m) of every position and channel, NaN where it clips; one standard deviation of what
        is independent.
    dark_sigma_dn_per_s
        (f, m) of what a dark level that is off adds to all values of a frame together.
    """

    t_s: FloatArray
    value_dn_per_s: FloatArray
    sigma_dn_per_s: FloatArray
    dark_sigma_dn_per_s: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    def take(self, rows: Sequence[int]) -> "FilterFrames":
        """Some of the frames."""
        some = list(rows)
        return FilterFrames(
            self.t_s[some],
            self.value_dn_per_s[some],
            self.sigma_dn_per_s[some],
            self.dark_sigma_dn_per_s[some],
        )


@dataclass(frozen=True)
class SpectralComparison:
    """Whether one scene through the filter differs from another in more than its brightness.

    Attributes
    ----------
    what
        Which scene against which, for people.
    brightness
        Of the one relative to the other.
    chi2, dof
        Of the difference, the brightness and an offset of the dark level fitted.
    p_value
        Chance of such a difference by noise alone.
    beyond_noise
        Relative root mean square difference that noise does not explain, bright places counting
        most; 0 if it explains all.
    shift_nm, shift_sigma_nm
        How far the centroid of light along the filter is moved.
    """

    what: str
    brightness: float
    chi2: float
    dof: int
    p_value: float
    beyond_noise: float
    shift_nm: float
    shift_sigma_nm: float


@dataclass(frozen=True, eq=False)
class ChargeSpectrum:
    """The glow after one charge.

    Attributes
    ----------
    lamp
        That charged the sample.
    frames
        In which there is light.
    spectrum
        Of all frames together; its credible band is of few draws.
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
        After the first charge, all times together; the file `emission.yaml`.
    channels
        Of the camera.
    centre_nm
        (m,) centre of the filter's band for every value of a frame: position by position, the
        channels of one after the other.
    white_reference
        Whether a grey card under the known lamp told what the camera's curves are off by.
    charges
        One a lamp that lit, in order of time.
    times
        Every frame after the first charge against all others together; empty if it is alone.
    at_times
        The spectrum of each of these frames, of few draws.
    lamps
        Every later charge against the first.
    changes_with_time, depends_on_lamp
        Whether any of `times`, of `lamps` differs by more than chance.
    """

    spectrum: EmissionSpectrum
    channels: tuple[str, ...]
    centre_nm: FloatArray
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
        By the patch's name; under "" of the only one.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for patch in result.patches.values():
    ...     print(patch.spectrum.peak_nm, patch.spectrum.centroid)
    """

    kind: ClassVar[str] = "emission_spectrum"

    patches: Mapping[str, PatchSpectrum]

    def provides(self) -> Mapping[str, Any]:
        """The spectrum of every patch."""
        return {"spectra": {name: patch.spectrum for name, patch in self.patches.items()}}

    def write_files(self, folder: Path) -> None:
        """Write `emission.yaml` and `spectrum.csv`; of several patches in a folder each."""
        for name, patch in self.patches.items():
            place = folder / name
            place.mkdir(exist_ok=True)
            write_emission_spectrum(place / "emission.yaml", patch.spectrum)
            patch.spectrum.write_csv(place / "spectrum.csv")
