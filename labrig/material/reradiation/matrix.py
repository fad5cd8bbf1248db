"""The re-radiation matrix of a surface: what comes back at which wavelength, of each wavelength.

A surface under the irradiance E(λ) has the spectrum

    π L(λ_o) = ρ(λ_o) E(λ_o) + ∫ Φ(λ_i, λ_o) E(λ_i) dλ_i

of radiance factor ρ and re-radiation Φ per nm of output (R. Donaldson, British Journal of Applied
Physics 5, 1954). Instruments give both as one bispectral matrix, whose diagonal is the reflectance.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.notebook_views import NotebookViews
from labrig.optics import Spectrum, edges_from_centres

#: Unit of the re-radiation; `relative` is some multiple of 1/nm that is not known.
Unit: TypeAlias = Literal["1/nm", "relative"]

#: Two wavelengths in nm that differ by less than this are the same.
SAME_NM = 1e-6


@dataclass(frozen=True, eq=False)
class SeenSpectrum:
    """Light from a surface, in the unit of the irradiance that falls on it.

    Attributes
    ----------
    reflected
        Light that keeps its wavelength.
    reradiated
        Light that was absorbed at another wavelength.
    """

    reflected: Spectrum
    reradiated: Spectrum

    @property
    def total(self) -> Spectrum:
        """All light; its σ is known where both parts' are."""
        parts = (self.reflected, self.reradiated)
        sigmas = [part.sigma for part in parts if part.sigma is not None]
        return Spectrum(
            self.reflected.name,
            self.reflected.wavelength_nm,
            self.reflected.value + self.reradiated.value,
            np.hypot(*sigmas) if len(sigmas) == len(parts) else None,
        )


@dataclass(frozen=True, eq=False)
class ReradiationMatrix(NotebookViews):
    """Reflectance and re-radiation of a surface, constant in each band.

    Bands reach half-way to their neighbours. A number that was not measured is NaN; light of such
    an entry is left out of all sums.

    Parameters
    ----------
    name
        Name of the material.
    input_nm
        Rising centres of the bands of the incident light in nm, shape (m,), m ≥ 2.
    output_nm
        Rising centres of the bands of the light that comes back in nm, shape (n,), n ≥ 2.
    reflectance
        Radiance factor ρ without re-radiation, shape (n,).
    reradiation
        Re-radiation Φ in `unit`, shape (n, m).
    reflectance_sigma, reradiation_sigma
        One standard deviation of each number, where it is known.
    unit
        `1/nm` of output; or `relative`, as of spectrofluorometers whose scale is arbitrary: then
        all that follows from the re-radiation is relative, too.
    column_correlation
        Correlation of the errors of any two entries of one input band, from 0 to 1, shape (m,):
        instruments read a dark level once for each. None stands for 0.

    Raises
    ------
    ValueError
        Shapes disagree, wavelengths do not rise, a number is infinite, or the unit is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMatrix
    >>> nm = np.arange(400.0, 701.0, 10.0)
    >>> values = np.diag(np.full(31, 0.5))
    >>> values[20, 5] = 0.1
    >>> paper = ReradiationMatrix.from_bands("paper", nm, nm, values)
    >>> [float(column) for column in paper.reradiated_fraction[4:7]]
    [0.0, 0.1, 0.0]
    """

    name: str
    input_nm: FloatArray
    output_nm: FloatArray
    reflectance: FloatArray
    reradiation: FloatArray
    reflectance_sigma: FloatArray | None = None
    reradiation_sigma: FloatArray | None = None
    unit: Unit = "1/nm"
    column_correlation: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.unit not in get_args(Unit):
            raise ValueError(f"expected the unit {' or '.join(get_args(Unit))}, got {self.unit}")
        for grid in (self.input_nm, self.output_nm):
            if grid.ndim != 1 or len(grid) < 2:
                raise ValueError("expected two or more wavelengths of input and of output")
            if not np.isfinite(grid).all() or grid[0] <= 0 or (np.diff(grid) <= 0).any():
                raise ValueError("expected wavelengths above 0 nm that rise")
        shapes = {
            "reflectance": (len(self.output_nm),),
            "reradiation": (len(self.output_nm), len(self.input_nm)),
        }
        for name, shape in shapes.items():
            value, sigma = getattr(self, name), getattr(self, f"{name}_sigma")
            for what, numbers in ((name, value), (f"{name}_sigma", sigma)):
                if numbers is not None and numbers.shape != shape:
                    raise ValueError(f"expected {what} of shape {shape}, got {numbers.shape}")
                if numbers is not None and np.isinf(numbers).any():
                    raise ValueError(f"some number of {what} is infinite")
            if sigma is not None and (sigma < 0).any():
                raise ValueError(f"some {name}_sigma is negative")
        correlation = self.column_correlation
        if correlation is not None and (
            correlation.shape != self.input_nm.shape
            or not ((correlation >= 0) & (correlation <= 1)).all()
        ):
            raise ValueError("expected a column_correlation from 0 to 1 for each input band")

    @classmethod
    def from_bands(
        cls,
        name: str,
        input_nm: FloatArray,
        output_nm: FloatArray,
        values: FloatArray,
        sigma: FloatArray | None = None,
    ) -> Self:
        """Take apart a bispectral matrix, as instruments and their files give it.

        Parameters
        ----------
        name
            Name of the material.
        input_nm, output_nm
            Rising centres of the bands in nm, shapes (m,) and (n,).
        values
            Fractions of the light of each input band that come back in each output band, shape
            (n, m). Where input and output are one band stands the reflectance.
        sigma
            One standard deviation of the values, of the same shape, where it is known.

        Returns
        -------
        ReradiationMatrix
            Its reflectance is NaN in output bands without an input band of the same wavelength.
            Re-radiation within a band cannot be told from reflectance and counts as that.
        """
        same = are_same_bands(output_nm, input_nm)
        width = np.diff(edges_from_centres(output_nm))[:, np.newaxis]

        def apart(table: FloatArray) -> tuple[FloatArray, FloatArray]:
            diagonal = np.where(same, table, 0.0).sum(axis=1)
            return (
                np.where(same.any(axis=1), diagonal, np.nan),
                np.where(same, 0.0, table / width),
            )

        if values.shape != same.shape:
            raise ValueError(f"expected a matrix of shape {same.shape}, got {values.shape}")
        sigmas = (None, None) if sigma is None else apart(sigma)
        return cls(name, input_nm, output_nm, *apart(values), *sigmas)

    def to_bands(self) -> FloatArray:
        """Return the bispectral matrix that `from_bands` reads, shape (n, m).

        Raises
        ------
        ValueError
            An output band that reflects has no input band of the same wavelength.
        """
        same = are_same_bands(self.output_nm, self.input_nm)
        measured = ~np.isnan(self.reflectance)
        if not same[measured].any(axis=1).all():
            raise ValueError("expected an input band at every wavelength of the reflectance")
        diagonal = np.where(measured, self.reflectance, 0.0)[:, np.newaxis]
        return self.reradiation * self.output_width_nm[:, np.newaxis] + np.where(
            same, diagonal, 0.0
        )

    @cached_property
    def input_edges_nm(self) -> FloatArray:
        """Edges of the input bands in nm, shape (m + 1,)."""
        return edges_from_centres(self.input_nm)

    @cached_property
    def output_edges_nm(self) -> FloatArray:
        """Edges of the output bands in nm, shape (n + 1,)."""
        return edges_from_centres(self.output_nm)

    @property
    def input_width_nm(self) -> FloatArray:
        """Widths of the input bands in nm, shape (m,)."""
        return np.diff(self.input_edges_nm)

    @property
    def output_width_nm(self) -> FloatArray:
        """Widths of the output bands in nm, shape (n,)."""
        return np.diff(self.output_edges_nm)

    @property
    def is_stokes(self) -> BoolArray:
        """Whether the output has the longer wavelength, as of fluorescence, shape (n, m)."""
        return np.asarray(self.output_nm[:, np.newaxis] > self.input_nm + SAME_NM)

    @property
    def reradiated_fraction(self) -> FloatArray:
        """Fraction of the light of each input band that comes back at longer wavelengths, (m,).

        As a radiance factor over that of a perfect white: at 45°/0° it is no energy balance, and
        real surfaces exceed 1.
        """
        terms = np.where(self.is_stokes, np.nan_to_num(self.reradiation), 0.0)
        return np.asarray(self.output_width_nm @ terms)

    @property
    def reradiated_fraction_sigma(self) -> FloatArray | None:
        """One standard deviation of `reradiated_fraction`, shape (m,), where it is known."""
        if self.reradiation_sigma is None:
            return None
        terms = np.where(self.is_stokes, np.nan_to_num(self.reradiation_sigma), 0.0)
        terms *= self.output_width_nm[:, np.newaxis]
        common = self._correlation
        independent = (1 - common) * np.square(terms).sum(axis=0)
        return np.asarray(np.sqrt(independent + common * np.square(terms.sum(axis=0))))

    @property
    def _correlation(self) -> FloatArray:
        correlation = self.column_correlation
        return np.zeros(len(self.input_nm)) if correlation is None else correlation

    @property
    def total_fraction(self) -> FloatArray:
        """Fraction of the light of each input band that comes back at all, shape (m,)."""
        reflectance = np.interp(
            self.input_nm, self.output_nm, np.nan_to_num(self.reflectance), left=0.0, right=0.0
        )
        return self.reradiated_fraction + reflectance

    def singular_values(self) -> FloatArray:
        """Return the singular values of the re-radiation, falling, the largest 1.

        One dye re-radiates the same spectrum whatever excites it (Kasha's rule): its matrix has
        one singular value but for the corner where emission and excitation overlap.
        """
        # Entries of unequal bands count by the light in them.
        cell = np.sqrt(self.output_width_nm[:, np.newaxis] * self.input_width_nm)
        stokes = np.where(self.is_stokes, np.nan_to_num(self.reradiation), 0.0) * cell
        values = np.linalg.svd(stokes, compute_uv=False)
        return np.asarray(values / values[0]) if values[0] > 0 else np.asarray(values)

    def under(self, light: Spectrum) -> SeenSpectrum:
        """Return the light that comes back under some irradiance.

        Parameters
        ----------
        light
            Irradiance per nm. It is averaged in the bands of input and output.

        Returns
        -------
        SeenSpectrum
            Spectra on `output_nm`. A perfect white returns `light` itself.

        Examples
        --------
        >>> import numpy as np
        >>> from labrig.material import ReradiationMatrix
        >>> from labrig.optics import Spectrum
        >>> nm = np.arange(400.0, 701.0, 10.0)
        >>> values = np.diag(np.full(31, 0.5))
        >>> values[20, 5] = 0.1
        >>> paper = ReradiationMatrix.from_bands("paper", nm, nm, values)
        >>> seen = paper.under(Spectrum("even", nm, np.full(31, 2.0)))
        >>> float(seen.reflected.value[20]), round(float(seen.reradiated.value[20]), 6)
        (1.0, 0.2)
        """
        on_output = light.in_bands(self.output_edges_nm)
        absorbed = light.in_bands(self.input_edges_nm) * self.input_width_nm
        reflected = np.nan_to_num(self.reflectance) * on_output
        reradiated = np.nan_to_num(self.reradiation) @ absorbed
        sigmas: list[FloatArray | None] = [None, None]
        if self.reflectance_sigma is not None:
            sigmas[0] = np.nan_to_num(self.reflectance_sigma) * on_output
        if self.reradiation_sigma is not None:
            sigmas[1] = np.sqrt(np.nan_to_num(self.reradiation_sigma) ** 2 @ absorbed**2)
        return SeenSpectrum(
            Spectrum(self.name, self.output_nm, reflected, sigmas[0]),
            Spectrum(self.name, self.output_nm, reradiated, sigmas[1]),
        )

    def rebinned(self, input_nm: ArrayLike, output_nm: ArrayLike) -> Self:
        """Return the matrix in other bands, with the same light in and out.

        Parameters
        ----------
        input_nm, output_nm
            Rising centres of the new bands in nm.

        Returns
        -------
        ReradiationMatrix
            Under light that is constant in each new input band, each new output band returns what
            the old ones return there. What was not measured counts as no re-radiation, and where no
            part of a band was measured its reflectance is NaN.
        """
        inputs, outputs = (np.asarray(nm, dtype=np.float64) for nm in (input_nm, output_nm))
        from_input = _overlaps_nm(self.input_edges_nm, edges_from_centres(inputs))
        from_output = _overlaps_nm(self.output_edges_nm, edges_from_centres(outputs))
        new_width = np.diff(edges_from_centres(outputs))[:, np.newaxis]
        by_input = from_input.T / np.diff(edges_from_centres(inputs))
        measured = ~np.isnan(self.reflectance)
        covered = from_output @ measured
        with np.errstate(invalid="ignore", divide="ignore"):
            to_mean = np.where(covered[:, np.newaxis] > 0, from_output * measured, np.nan)
            to_mean = to_mean / covered[:, np.newaxis]
        to_output = from_output / new_width

        reflectance_sigma = reradiation_sigma = None
        if self.reflectance_sigma is not None:
            variance = np.nan_to_num(self.reflectance_sigma) ** 2
            reflectance_sigma = np.sqrt(to_mean**2 @ variance)
        correlation = None
        if self.reradiation_sigma is not None:
            sigma = np.nan_to_num(self.reradiation_sigma)
            independent = to_output**2 @ (sigma**2 * (1 - self._correlation)) @ by_input**2
            common = (to_output @ (sigma * np.sqrt(self._correlation))) ** 2 @ by_input**2
            reradiation_sigma = np.sqrt(independent + common)
            if self.column_correlation is not None:
                total = (independent + common).sum(axis=0)
                correlation = np.divide(
                    common.sum(axis=0), total, out=np.zeros_like(total), where=total > 0
                )
        return type(self)(
            self.name,
            inputs,
            outputs,
            to_mean @ np.nan_to_num(self.reflectance),
            to_output @ np.nan_to_num(self.reradiation) @ by_input,
            reflectance_sigma,
            reradiation_sigma,
            self.unit,
            correlation,
        )


def are_same_bands(output_nm: FloatArray, input_nm: FloatArray) -> BoolArray:
    """Return whether a band of output and one of input have the same centre, shape (n, m)."""
    return np.asarray(np.abs(output_nm[:, np.newaxis] - input_nm) < SAME_NM)


def _overlaps_nm(old_edges_nm: FloatArray, new_edges_nm: FloatArray) -> FloatArray:
    """Return the widths in nm that new bands share with old ones, shape (new, old)."""
    low = np.maximum(new_edges_nm[:-1, np.newaxis], old_edges_nm[:-1])
    high = np.minimum(new_edges_nm[1:, np.newaxis], old_edges_nm[1:])
    return np.asarray(np.maximum(high - low, 0.0))
