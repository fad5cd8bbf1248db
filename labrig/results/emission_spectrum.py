"""Emission spectrum with its covariance, and its file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator
from scipy.interpolate import CubicSpline

from labrig.foundation.arrays import FloatArray
from labrig.foundation.models import Finite, FrozenModel, NotNegative
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.yaml_file import read_model, write_yaml
from labrig.material import Spectrum
from labrig.optics import band_means, edges_from_centres
from labrig.results.measured import Measured

#: Grid of wavelengths in nm, from section 4.7 of the paper (Nalbach et al.).
WAVELENGTH_NM: FloatArray = np.arange(400.0, 701.0, 10.0)
#: Probability of the credible band between `low` and `high` at a wavelength.
CREDIBLE = 0.6827


@dataclass(frozen=True, eq=False)
class FilterFrames:
    """f frames of one scene through the filter, of constant colours but variable brightness.

    Attributes
    ----------
    t_s
        Middles of the exposures in seconds after lamp off, shape (f,).
    value_dn_per_s
        Signal of every position and channel in DN/s, shape (f, m); NaN where it clips.
    sigma_dn_per_s
        Independent standard uncertainty of the signal in DN/s, shape (f, m).
    dark_dn_per_s_sigma
        Common-mode standard uncertainty of a frame's values by the dark level in DN/s, shape (f,
        m).
    """

    t_s: FloatArray
    value_dn_per_s: FloatArray
    sigma_dn_per_s: FloatArray
    dark_dn_per_s_sigma: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    def take(self, rows: Sequence[int]) -> "FilterFrames":
        """Return the given frames."""
        indices = list(rows)
        return FilterFrames(
            self.t_s[indices],
            self.value_dn_per_s[indices],
            self.sigma_dn_per_s[indices],
            self.dark_dn_per_s_sigma[indices],
        )


@dataclass(frozen=True)
class SpectralComparison:
    """Test whether two scenes through the filter differ in more than their brightness.

    Attributes
    ----------
    what
        Names of the two scenes, for people.
    brightness
        Brightness of the first scene relative to the second.
    chi2, dof
        χ² of the difference, brightness and an offset of the dark level fitted, and its degrees of
        freedom.
    p_value
        Probability of such a χ² by noise alone.
    beyond_noise
        Relative root mean square difference in excess of noise, weighted towards bright places; 0
        if noise explains all.
    shift_nm, shift_nm_sigma
        Shift of the centroid of light along the filter and its standard uncertainty in nm.
    """

    what: str
    brightness: float
    chi2: float
    dof: int
    p_value: float
    beyond_noise: float
    shift_nm: float
    shift_nm_sigma: float


class EmissionSpectrum(FrozenModel, NotebookViews):
    """Emission spectrum Λ* on a grid, normalised to a maximum of 1.

    Attributes
    ----------
    sample
        Name of the sample.
    wavelength_nm
        Wavelengths of the grid in nm, shape (n,). Each value is the mean about its wavelength,
        half-way to its neighbours.
    value, sigma
        Spectrum and its standard uncertainty, shape (n,); a common factor is not in it.
    low, high
        Ends of the 68 % credible band, shape (n,).
    covariance
        Covariance of the values, shape (n, n).
    lamp
        Name of the lamp that charged the sample.
    run
        Name of the run in which it was measured.
    """

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
        """Average a spectrum fitted on its own knots to the grid of `WAVELENGTH_NM`.

        The draws are normalised to one integral: a factor common to all wavelengths is not part of
        the shape.

        Parameters
        ----------
        knots_nm
            Wavelengths of the fitted spectrum in nm, linear between them, shape (k,).
        value
            Fitted spectrum in any unit, shape (k,).
        draws
            Posterior draws of the spectrum, shape (s, k).
        sample, lamp, run
            Names of sample, lamp and run, as the attributes.
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
        """Wavelength of the largest value in nm."""
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
        """Return the means over neighbouring bands, shape (b,), and their covariance, shape (b, b).

        A cubic spline through the running sum of the values divides them where an edge of a band
        lies between grid points; linear interpolation would fill valleys.
        """
        grid_edges = edges_from_centres(np.array(self.wavelength_nm))
        sums = np.vstack(
            [np.zeros(len(grid_edges) - 1), np.tril(np.ones((len(grid_edges) - 1,) * 2))]
        )
        sums[1:] *= np.diff(grid_edges)
        edges = np.asarray(edges_nm, dtype=np.float64)
        clipped_edges = np.clip(edges, grid_edges[0], grid_edges[-1])
        means = (
            np.diff(CubicSpline(grid_edges, sums)(clipped_edges), axis=0)
            / np.diff(edges)[:, np.newaxis]
        )
        return means @ np.array(self.value), means @ np.array(self.covariance) @ means.T

    def for_material(self) -> Spectrum:
        """Return the spectrum in the form of a material file."""
        return Spectrum(wavelength_nm=self.wavelength_nm, value=self.value, sigma=self.sigma)

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the columns of the grid as `spectrum.csv`."""
        columns = (self.wavelength_nm, self.value, self.sigma, self.low, self.high)
        rows = ([f"{number:.6g}" for number in row] for row in zip(*columns, strict=True))
        head = ("wavelength_nm", "value", "value_sigma", "low", "high")
        return {"spectrum.csv": CsvTable(head, rows)}


def read_emission_spectrum(path: Path) -> EmissionSpectrum:
    """Read an emission spectrum.

    Raises
    ------
    UsageError
        The file does not exist, or is malformed.
    """
    return read_model(path, EmissionSpectrum)


def write_emission_spectrum(path: Path, spectrum: EmissionSpectrum) -> None:
    """Write an emission spectrum; `read_emission_spectrum` reads it back."""
    write_yaml(path, spectrum)
