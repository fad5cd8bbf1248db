"""The emission spectrum Λ* of a sample as files: `emission.yaml`, and `spectrum.csv`."""

import csv
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.interpolate import CubicSpline

from labrig.fit.spectrum import SpectrumFit
from labrig.material import Spectrum
from labrig.optics.piecewise import band_means, edges_about
from labrig.yaml_file import read_model, write_yaml

FloatArray = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]

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
    def of(cls, fit: SpectrumFit, sample: str, lamp: str, run: str) -> Self:
        """From a fit. Its draws are brought to one integral: what is common to all is no shape."""
        edges = edges_about(WAVELENGTH_NM)
        value = band_means(fit.knots_nm, fit.value, edges)
        draws = band_means(fit.knots_nm, fit.samples.T, edges)
        draws = draws / draws.sum(axis=0) * value.sum() / value.max()
        low, high = np.quantile(draws, [(1 - CREDIBLE) / 2, (1 + CREDIBLE) / 2], axis=1)
        covariance = np.cov(draws)
        return cls(
            sample=sample,
            wavelength_nm=tuple(WAVELENGTH_NM.tolist()),
            value=tuple((value / value.max()).tolist()),
            sigma=tuple(np.sqrt(np.diag(covariance)).tolist()),
            low=tuple(low.tolist()),
            high=tuple(high.tolist()),
            covariance=tuple(tuple(row) for row in covariance.tolist()),
            lamp=lamp,
            run=run,
        )

    def in_bands(self, edges_nm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Means over neighbouring bands (b,), and their covariance (b, b).

        Values are means: a cubic spline through their running sum takes them apart where an edge
        of a band lies within one; straight lines between them would fill valleys.
        """
        ends = edges_about(np.array(self.wavelength_nm))
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
