"""Columns of a re-radiation matrix, measured directly."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.material import ReradiationMatrix
from labrig.optics import edges_from_centres
from labrig.results.budget import Budget
from labrig.results.measured import Measured

#: Width in nm of the input bands between the lights.
INPUT_BAND_NM = 10.0
#: Gap in nm of the reflectance that is bridged between two lights.
MAX_GAP_NM = 40.0


@dataclass(frozen=True, eq=False)
class LightSpectrum:
    """One light, as the white reference shows it.

    Attributes
    ----------
    name
        Name of the LED or filter.
    mean_nm, peak_nm, fwhm_nm
        Mean wavelength weighted by power, peak, and full width at half maximum in nm.
    named_nm
        Peak that the rig file says, in nm; NaN where it says nothing.
    integration_s
        Integration time on the white reference in seconds.
    beyond, beyond_sigma
        Light at longer wavelengths than its own band over its power, and σ: the reference
        fluoresces, or the LED shines there, too.
    wavelength_nm, relative : ndarray, shape (p,)
        Its spectrum, 1 at the peak.
    """

    name: str
    mean_nm: float
    peak_nm: float
    fwhm_nm: float
    named_nm: float
    integration_s: float
    beyond: float
    beyond_sigma: float
    wavelength_nm: FloatArray
    relative: FloatArray


@dataclass(frozen=True, eq=False)
class DirectColumns:
    """Columns of a sample under m lights, in k bands.

    Attributes
    ----------
    lights
        Names of the lights, by rising wavelength.
    input_nm : ndarray, shape (m,)
        Mean wavelength of each light in nm.
    output_nm : ndarray, shape (k,)
        Centres of the bands of the light that comes back, in nm.
    column, column_sigma : ndarray, shape (k, m)
        Light that comes back in a band over the light's power, reflected and re-radiated, and σ.
    share : ndarray, shape (k, m)
        Part of the light's own power in the band.
    is_mixed : ndarray, shape (k, m)
        Whether the light itself is in the band, so that reflected and re-radiated light come
        together.
    reflectance, reflectance_sigma : ndarray, shape (k,)
        Reflectance in each band and σ; NaN where no light is.
    reradiated, reradiated_sigma : ndarray, shape (k, m)
        Re-radiated part of `column` and σ; NaN where it cannot be told from reflected light.
    common_sigma : ndarray, shape (k, m)
        Part of `column_sigma` by an error that all entries of a column share: that of an offset.
    light_sigma : ndarray, shape (m,)
        Relative σ of a light's power, which all entries of a column share and which is in
        `column_sigma`, too.
    drift
        Column of the first light read once more at the end, over the first reading: bleaching, or a
        light that changed.
    """

    lights: tuple[str, ...]
    input_nm: FloatArray
    output_nm: FloatArray
    column: FloatArray
    column_sigma: FloatArray
    share: FloatArray
    is_mixed: BoolArray
    reflectance: FloatArray
    reflectance_sigma: FloatArray
    reradiated: FloatArray
    reradiated_sigma: FloatArray
    common_sigma: FloatArray
    light_sigma: FloatArray
    drift: Measured

    def reradiated_total(self, light: int, scale_sigma: float) -> Budget:
        """Return the part of a light's power that comes back re-radiated in all bands measured.

        Parameters
        ----------
        light
            Number of the light, from 0.
        scale_sigma
            Relative σ of reference and spectrometer, which are in σ of every entry; NaN if their
            files have none.
        """
        known = np.isfinite(self.reradiated[:, light]) & np.isfinite(
            self.reradiated_sigma[:, light]
        )
        value, sigma = self.reradiated[known, light], self.reradiated_sigma[known, light]
        shared, common = self.light_sigma[light] * value, self.common_sigma[known, light]
        scaled = np.nan_to_num(scale_sigma) * value
        own = np.maximum(sigma**2 - shared**2 - common**2 - scaled**2, 0.0)
        noise = float(np.sqrt(own.sum() + common.sum() ** 2 + shared.sum() ** 2))
        calibration = None if np.isnan(scale_sigma) else abs(float(scaled.sum()))
        return Budget(float(value.sum()), noise=noise, calibration=calibration)

    @property
    def correlation(self) -> FloatArray:
        """Typical correlation of the errors of two entries of a column, shape (m,)."""
        return np.asarray(np.median(self.common_sigma**2 / self.column_sigma**2, axis=0))

    def matrix(self, name: str) -> ReradiationMatrix:
        """Return the matrix whose input bands are the lights.

        Raises
        ------
        ValueError
            There is one light only, or two of the same wavelength.
        """
        width_nm = np.diff(edges_from_centres(self.output_nm))[:, np.newaxis]
        return ReradiationMatrix(
            name,
            self.input_nm,
            self.output_nm,
            self.reflectance,
            self.reradiated / width_nm,
            self.reflectance_sigma,
            self.reradiated_sigma / width_nm,
            column_correlation=self.correlation,
        )

    def interpolated(self, name: str) -> tuple[ReradiationMatrix, BoolArray]:
        """Return the matrix on input bands of 10 nm, and which of these no light reached.

        Between two lights the re-radiation is interpolated where both tell it, and a quarter of
        their difference is in σ half-way. Elsewhere it is NaN, and 0 where it would need light of
        shorter wavelength than that which comes back. Gaps of the reflectance between two lights
        are bridged; half of the change is in σ there.

        Returns
        -------
        matrix : ReradiationMatrix
            On input bands of 10 nm from 300 nm to 780 nm.
        is_extrapolated : ndarray of bool, shape (input bands,)
            Whether a band is shorter than all lights or longer.
        """
        input_nm = np.arange(300.0, 781.0, INPUT_BAND_NM)
        lights = self.matrix(name)
        assert lights.reradiation_sigma is not None
        upper = np.clip(np.searchsorted(self.input_nm, input_nm), 1, len(self.input_nm) - 1)
        lower = upper - 1
        part = (input_nm - self.input_nm[lower]) / (self.input_nm[upper] - self.input_nm[lower])
        room = INPUT_BAND_NM / 2
        is_extrapolated = (input_nm < self.input_nm[0] - room) | (
            input_nm > self.input_nm[-1] + room
        )
        part = np.clip(part, 0.0, 1.0)
        # Where a band is that of a light, its neighbour has no say.
        weights = np.stack([1 - part, part])
        value, variance = np.zeros((2, len(self.output_nm), len(input_nm)))
        for weight, place in zip(weights, (lower, upper), strict=True):
            is_beyond = self.output_nm[:, np.newaxis] > self.input_nm[place] + room
            term = np.where(is_beyond, lights.reradiation[:, place], np.nan)
            value += np.where(weight > 0, weight * term, 0.0)
            sigma = weight * lights.reradiation_sigma[:, place]
            variance += np.where(weight > 0, sigma**2, 0.0)
        apart = lights.reradiation[:, upper] - lights.reradiation[:, lower]
        variance += np.where(part * (1 - part) > 0, (part * (1 - part) * apart) ** 2, 0.0)
        is_stokes = self.output_nm[:, np.newaxis] > input_nm
        unknown = is_extrapolated & is_stokes
        value = np.where(unknown, np.nan, np.where(is_stokes, value, 0.0))
        variance = np.where(np.isnan(value), np.nan, np.where(is_stokes, variance, 0.0))
        reflectance, reflectance_sigma = self._bridged()
        matrix = ReradiationMatrix(
            name, input_nm, self.output_nm, reflectance, value, reflectance_sigma, np.sqrt(variance)
        )
        return matrix, is_extrapolated

    def _bridged(self) -> tuple[FloatArray, FloatArray]:
        """Return the reflectance and σ with narrow gaps bridged."""
        known = np.flatnonzero(np.isfinite(self.reflectance))
        value, sigma = self.reflectance.copy(), self.reflectance_sigma.copy()
        for left, right in pairwise(known):
            gap = slice(left + 1, right)
            ends_nm, ends = self.output_nm[[left, right]], self.reflectance[[left, right]]
            if ends_nm[1] - ends_nm[0] <= MAX_GAP_NM:
                value[gap] = np.interp(self.output_nm[gap], ends_nm, ends)
                widest = self.reflectance_sigma[[left, right]].max()
                sigma[gap] = np.hypot(widest, (ends[1] - ends[0]) / 2)
        return value, sigma


@dataclass(frozen=True, eq=False)
class DirectMeasurement:
    """Direct measurement of samples, with which estimates of their matrices are compared.

    Attributes
    ----------
    lights
        Lights by rising wavelength.
    samples
        Columns of each sample by its name.
    """

    lights: tuple[LightSpectrum, ...]
    samples: Mapping[str, DirectColumns]
