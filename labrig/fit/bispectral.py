"""Reflectance and re-radiation in measured columns, where they can be told apart.

Beyond the band of a light all that comes back is re-radiated. Within it both come together: the
reflectance there is told by the light itself, less what may be re-radiated, and the re-radiation
only where another light tells the reflectance.

Under light m with the irradiance E, a surface has the spectrum

    S(λ) = ρ(λ) E(λ) + ∫ Φ(λ_i, λ) E(λ_i) dλ_i ,

and a white reference of known reflectance tells E. The column of that light is ∫ S dλ over each
band, divided by the power P = ∫ E dλ: the true matrix averaged over the light's own spectrum,
whatever its shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import Spectrum, edges_from_centres

#: Part of its peak down to which a light is followed on both sides, and the part of that distance
#: by which its window goes on: of a normal curve, 1e-4 of the power is beyond.
WINDOW_LEVEL, WINDOW_ROOM = 0.02, 0.5
#: Pixels over which noise is averaged when the window is looked for.
SMOOTHED_PIXELS = 9
#: A light's peak over its σ, below which there is no light.
MIN_PEAK = 20.0


@dataclass(frozen=True, eq=False)
class IlluminatedSpectrum:
    """Light from a surface, above the dark, in the scale of all spectra that belong together.

    Attributes
    ----------
    wavelength_nm : ndarray, shape (p,)
        Rising wavelengths in nm.
    value : ndarray, shape (p,)
        Light per nm and second.
    sigma : ndarray, shape (p,)
        Standard deviation of each value, independent of the others'.
    common_sigma : ndarray, shape (p,), or None
        Standard deviation of an error that all values share, as of an offset; None without one.
    """

    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray
    common_sigma: FloatArray | None = None

    @classmethod
    def of(cls, spectrum: Spectrum) -> "IlluminatedSpectrum":
        """Return a spectrum whose values have independent errors, or none that are known."""
        sigma = np.zeros_like(spectrum.value) if spectrum.sigma is None else spectrum.sigma
        return cls(spectrum.wavelength_nm, spectrum.value, sigma)

    def divided_by(self, factor: FloatArray) -> "IlluminatedSpectrum":
        """Return the spectrum over an exact factor (p,), such as the reflectance of a white."""
        common = None if self.common_sigma is None else self.common_sigma / factor
        return IlluminatedSpectrum(
            self.wavelength_nm, self.value / factor, self.sigma / factor, common
        )

    def integrated(self, weights_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the integrals with weights of shape (k, p), and their σ, shape (k,)."""
        variance = np.square(weights_nm) @ np.square(self.sigma)
        return weights_nm @ self.value, np.hypot(
            np.sqrt(variance), self.common_sigma_of(weights_nm)
        )

    def common_sigma_of(self, weights_nm: FloatArray) -> FloatArray:
        """Return σ of the integrals by the error that all values share, shape (k,)."""
        if self.common_sigma is None:
            return np.zeros(len(weights_nm))
        return np.asarray(weights_nm @ self.common_sigma)


@dataclass(frozen=True, eq=False)
class BispectralColumns:
    """Columns of one sample under m lights, in k bands.

    Attributes
    ----------
    light_nm : ndarray, shape (m,)
        Mean wavelength of each light in nm, weighted by its power; rising.
    output_nm : ndarray, shape (k,)
        Centres of the bands in nm.
    window_nm : ndarray, shape (m, 2)
        Ends of the range within which all of a light's power is, in nm.
    share, share_sigma : ndarray, shape (k, m)
        Part of a light's power in each band, and σ.
    centroid_nm : ndarray, shape (k, m)
        Mean wavelength of the part of a light in each band, in nm; the centre of the band where
        there is no light.
    column, column_sigma : ndarray, shape (k, m)
        Light that comes back in each band over the light's power, and σ.
    power, power_sigma : ndarray, shape (m,)
        Power of each light in the unit of the spectra, and σ.
    common_sigma : ndarray, shape (k, m)
        Part of `column_sigma` by an error that all entries of a column share.
    order : ndarray of int, shape (m,)
        Place of each light among those that were given.
    """

    light_nm: FloatArray
    output_nm: FloatArray
    window_nm: FloatArray
    share: FloatArray
    share_sigma: FloatArray
    centroid_nm: FloatArray
    column: FloatArray
    column_sigma: FloatArray
    power: FloatArray
    power_sigma: FloatArray
    common_sigma: FloatArray
    order: NDArray[np.intp]


def bispectral_columns(
    lights: Sequence[IlluminatedSpectrum],
    samples: Sequence[IlluminatedSpectrum],
    output_nm: FloatArray,
    scale_sigma: FloatArray | None = None,
    light_sigma: FloatArray | None = None,
    windows_nm: Sequence[tuple[float, float]] | None = None,
) -> BispectralColumns:
    """Divide the light from a sample by the power of the lights.

    Parameters
    ----------
    lights
        Spectrum of each light: that of a white reference over its reflectance.
    samples
        Spectrum of the sample under each light, in the same scale.
    output_nm
        Rising centres of k bands in nm.
    scale_sigma
        Relative σ of the spectrometer's scale in each band, shape (k,), independent from band to
        band; it is the same under all lights. None for none.
    light_sigma
        Relative σ of each light between white and sample, shape (m,). None for none.
    windows_nm
        Ends of the range of each light within which its power is counted, in nm. None for those of
        the strongest peaks.

    Returns
    -------
    BispectralColumns
        Lights in the order of their wavelengths, whatever the order of `lights`.

    Raises
    ------
    DataError
        One of the lights cannot be seen, or a number of lights and of samples differ.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import IlluminatedSpectrum, bispectral_columns
    >>> nm = np.arange(380.0, 781.0, 2.0)
    >>> blue, noise = np.exp(-(((nm - 450) / 12) ** 2)), np.full(len(nm), 1e-4)
    >>> green = np.exp(-(((nm - 540) / 30) ** 2))
    >>> lit = (blue, 0.3 * blue + 0.1 * green)
    >>> white, cloth = (IlluminatedSpectrum(nm, light, noise) for light in lit)
    >>> columns = bispectral_columns([white], [cloth], np.array([450.0, 540.0]))
    >>> [round(float(value), 2) for value in columns.column[:, 0]]
    [0.3, 0.24]
    """
    if len(lights) != len(samples) or not lights:
        raise DataError(
            f"expected a spectrum of the sample for every light, got {len(samples)} for "
            f"{len(lights)} lights"
        )
    edges_nm = edges_from_centres(output_nm)
    windows = windows_nm or [light_window_nm(light) for light in lights]
    parts = [
        _column(light, sample, window_nm, edges_nm)
        for light, sample, window_nm in zip(lights, samples, windows, strict=True)
    ]
    order = np.argsort([part.light_nm for part in parts], kind="stable")
    parts = [parts[index] for index in order]
    share, share_sigma, centroid_nm, column, sigma = (
        np.array([getattr(part, name) for part in parts]).T
        for name in ("share", "share_sigma", "centroid_nm", "column", "column_sigma")
    )
    relative = np.zeros(len(parts)) if light_sigma is None else light_sigma[order]
    variance = sigma**2 + (column * relative) ** 2
    if scale_sigma is not None:
        variance += column**2 * _scale_variance(share, scale_sigma)
    power, power_sigma = np.array([part.power for part in parts]).T
    common_sigma = np.array([part.common_sigma for part in parts]).T
    return BispectralColumns(
        np.array([part.light_nm for part in parts]),
        output_nm,
        np.array(windows)[order],
        share,
        share_sigma,
        centroid_nm,
        column,
        np.sqrt(variance),
        power,
        power_sigma,
        common_sigma,
        order,
    )


def light_window_nm(light: IlluminatedSpectrum) -> tuple[float, float]:
    """Return the ends of the range in nm about the strongest peak of a light that holds its power.

    Raises
    ------
    DataError
        There is no light.
    """
    nm = light.wavelength_nm
    pixels = min(SMOOTHED_PIXELS, len(nm))
    smooth = np.convolve(light.value, np.full(pixels, 1 / pixels), mode="same")
    noise = np.sqrt(np.convolve(light.sigma**2, np.full(pixels, 1 / pixels**2), mode="same"))
    # At the ends of its range a detector sees little: what is divided there is noise.
    peak = int(np.argmax(np.where(smooth > MIN_PEAK * noise, smooth, -np.inf)))
    if not smooth[peak] > MIN_PEAK * noise[peak]:
        raise DataError("expected light on the white reference, got none above the noise")
    is_lit = smooth > WINDOW_LEVEL * smooth[peak]
    below = np.flatnonzero(~is_lit[:peak])
    above = np.flatnonzero(~is_lit[peak:])
    low_nm = nm[below[-1]] if len(below) else nm[0]
    high_nm = nm[peak + above[0]] if len(above) else nm[-1]
    low_nm -= WINDOW_ROOM * (nm[peak] - low_nm)
    high_nm += WINDOW_ROOM * (high_nm - nm[peak])
    return float(max(low_nm, nm[0])), float(min(high_nm, nm[-1]))


def band_weights_nm(wavelength_nm: FloatArray, edges_nm: FloatArray) -> FloatArray:
    """Return weights of the integrals over bands of a piecewise-linear curve.

    Parameters
    ----------
    wavelength_nm
        Rising wavelengths of the curve's points in nm, shape (p,).
    edges_nm
        Rising edges of the bands in nm, shape (k + 1,).

    Returns
    -------
    ndarray
        Weights in nm, shape (k, p): their product with the curve's values are the integrals.
    """
    inner = wavelength_nm[(wavelength_nm > edges_nm[0]) & (wavelength_nm < edges_nm[-1])]
    knots = np.unique(np.concatenate([edges_nm, inner]))
    knots = knots[(knots >= wavelength_nm[0]) & (knots <= wavelength_nm[-1])]
    step = np.diff(knots)
    place = np.clip(
        np.searchsorted(wavelength_nm, knots, side="right") - 1, 0, len(wavelength_nm) - 2
    )
    part = (knots - wavelength_nm[place]) / (wavelength_nm[place + 1] - wavelength_nm[place])
    band = np.searchsorted(edges_nm, (knots[:-1] + knots[1:]) / 2, side="right") - 1
    weights = np.zeros((len(edges_nm) - 1, len(wavelength_nm)))
    for ends in (slice(None, -1), slice(1, None)):
        np.add.at(weights, (band, place[ends]), step / 2 * (1 - part[ends]))
        np.add.at(weights, (band, place[ends] + 1), step / 2 * part[ends])
    return weights


@dataclass(frozen=True, eq=False)
class _Column:
    light_nm: float
    share: FloatArray
    share_sigma: FloatArray
    centroid_nm: FloatArray
    column: FloatArray
    column_sigma: FloatArray
    common_sigma: FloatArray
    power: tuple[float, float]


def _column(
    light: IlluminatedSpectrum,
    sample: IlluminatedSpectrum,
    window_nm: tuple[float, float],
    edges_nm: FloatArray,
) -> _Column:
    bands = band_weights_nm(light.wavelength_nm, edges_nm)
    window = band_weights_nm(light.wavelength_nm, np.array(window_nm))
    (power,), (power_sigma,) = light.integrated(window)
    (moment,), _ = light.integrated(window * light.wavelength_nm)
    in_band, in_band_sigma = light.integrated(bands)
    moments, _ = light.integrated(bands * light.wavelength_nm)
    sample_bands = band_weights_nm(sample.wavelength_nm, edges_nm)
    back, back_sigma = sample.integrated(sample_bands)
    share, column = in_band / power, back / power
    middle_nm = (edges_nm[1:] + edges_nm[:-1]) / 2
    is_lit = in_band > 5 * in_band_sigma
    centroid_nm = np.where(is_lit, moments / np.where(is_lit, in_band, 1.0), middle_nm)
    return _Column(
        float(moment / power),
        share,
        np.hypot(in_band_sigma / power, share * power_sigma / power),
        np.clip(centroid_nm, edges_nm[:-1], edges_nm[1:]),
        column,
        np.hypot(back_sigma / power, column * power_sigma / power),
        sample.common_sigma_of(sample_bands) / power,
        (float(power), float(power_sigma)),
    )


def _scale_variance(share: FloatArray, scale_sigma: FloatArray) -> FloatArray:
    """Return the relative variance of columns by the scale, shape (k, m).

    Where sample and light are in one band, the scale of that band falls out.
    """
    part = np.clip(share, 0.0, 1.0)
    variance = np.square(scale_sigma)[:, np.newaxis]
    of_power = np.sum(part**2 * variance, axis=0)
    return np.asarray((1 - part) ** 2 * variance + of_power - part**2 * variance)


#: Least part of a light in a band from which its reflectance is read.
MIN_SHARE = 0.03
#: Part of a light in a band from which reflected light is more than a correction.
MIXED_SHARE = 1e-3
#: Mean and σ of a reflectance of which nothing is known, even between 0 and 1; and the part of a
#: light in a band up to which that is enough to tell re-radiation.
UNKNOWN_REFLECTANCE = 0.5, 1 / np.sqrt(12)
LITTLE_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class SeparatedColumns:
    """Columns of m lights in k bands, taken apart.

    Attributes
    ----------
    reflectance, reflectance_sigma : ndarray, shape (k,)
        Reflectance at the centre of each band and σ; NaN where no light is.
    reradiated, reradiated_sigma : ndarray, shape (k, m)
        Re-radiated part of the column and σ; NaN where it cannot be told from reflected light.
    is_mixed : ndarray, shape (k, m)
        Whether the light itself is in that band, so that the re-radiation rests on the reflectance
        that another light tells, or is not known.
    """

    reflectance: FloatArray
    reflectance_sigma: FloatArray
    reradiated: FloatArray
    reradiated_sigma: FloatArray
    is_mixed: NDArray[np.bool_]


def separate_columns(columns: BispectralColumns) -> SeparatedColumns:
    """Take reflected and re-radiated light in columns apart.

    Where a light has little of its power, an unknown reflectance is taken as any from 0 to 1. In
    its own band a light is reflected and may excite re-radiation, which is between none and what
    the emission under a light of shorter wavelength extrapolates to (Kasha's rule: emission has one
    shape whatever excites it). Half of that is subtracted from the reflectance, and σ holds the
    other half.

    Parameters
    ----------
    columns
        Columns of a sample under all lights.

    Returns
    -------
    SeparatedColumns
        Reflectance, re-radiation, and where both are mixed.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import IlluminatedSpectrum, bispectral_columns, separate_columns
    >>> nm = np.arange(380.0, 781.0, 2.0)
    >>> blue, noise = np.exp(-(((nm - 450) / 12) ** 2)), np.full(len(nm), 1e-4)
    >>> green = np.exp(-(((nm - 540) / 30) ** 2))
    >>> lit = (blue, 0.3 * blue + 0.1 * green)
    >>> white, cloth = (IlluminatedSpectrum(nm, light, noise) for light in lit)
    >>> columns = bispectral_columns([white], [cloth], np.arange(430.0, 600.0, 20.0))
    >>> separated = separate_columns(columns)
    >>> separated.is_mixed[:3, 0].tolist()
    [True, True, True]
    >>> [round(float(value), 2) for value in separated.reradiated[3:7, 0]]
    [0.01, 0.04, 0.08, 0.08]
    """
    share, column = columns.share, columns.column
    is_mixed = share >= np.maximum(MIXED_SHARE, 3 * columns.share_sigma)
    own = _own_reradiation(columns, is_mixed)
    is_read = share >= MIN_SHARE
    part = np.where(is_read, share, 1.0)
    ratio = np.where(is_read, (column - own / 2) / part, np.nan)
    relative = np.hypot(columns.column_sigma, ratio * columns.share_sigma) / part
    sigma = np.where(is_read, np.hypot(relative, own / part / 2), np.inf)

    main = sigma.argmin(axis=1)
    slope = _slopes(columns, ratio, main)
    reflectance, reflectance_sigma = _at(columns, ratio, sigma, main, slope, columns.output_nm)
    reradiated, reradiated_sigma = np.full_like(column, np.nan), np.full_like(column, np.nan)
    for light in range(column.shape[1]):
        others = sigma.copy()
        others[:, light] = np.inf
        known, known_sigma = _at(
            columns, ratio, others, others.argmin(axis=1), slope, columns.centroid_nm[:, light]
        )
        small = np.isnan(known) & (share[:, light] < LITTLE_SHARE)
        known = np.where(small, UNKNOWN_REFLECTANCE[0], known)
        known_sigma = np.where(small, UNKNOWN_REFLECTANCE[1], known_sigma)
        is_seen = share[:, light] > 3 * columns.share_sigma[:, light]
        is_lit = is_seen | _in_window(columns, light)
        lit = np.where(is_lit, share[:, light], 0.0)
        lit_sigma = np.where(is_lit, columns.share_sigma[:, light], 0.0)
        reradiated[:, light] = column[:, light] - known * lit
        parts = np.hypot(known_sigma * lit, known * lit_sigma)
        reradiated_sigma[:, light] = np.hypot(columns.column_sigma[:, light], parts)
    return SeparatedColumns(
        reflectance,
        reflectance_sigma,
        np.where(np.isfinite(reradiated_sigma), reradiated, np.nan),
        np.where(np.isfinite(reradiated), reradiated_sigma, np.nan),
        is_mixed,
    )


def _own_reradiation(columns: BispectralColumns, is_mixed: NDArray[np.bool_]) -> FloatArray:
    """Return the most that a light's column may hold of re-radiation in its own band, (k, m)."""
    column = np.maximum(columns.column, 0.0)
    own = np.zeros_like(column)
    for light in range(column.shape[1]):
        beyond = ~is_mixed[:, light] & (columns.output_nm > columns.light_nm[light])
        for band in np.flatnonzero(is_mixed[:, light]):
            clear = np.flatnonzero(~is_mixed[band, :light])
            reference = clear[-1] if len(clear) else None
            shared = beyond if reference is None else beyond & ~is_mixed[:, reference]
            if not shared.any():
                continue
            if reference is None:
                # Nothing of shorter wavelength tells the emission here: as much as next to it.
                own[band, light] = column[np.flatnonzero(shared)[0], light]
                continue
            weight = column[shared, reference]
            amount = weight @ column[shared, light] / max(weight @ weight, 1e-300)
            own[band, light] = amount * column[band, reference]
    return own


def _in_window(columns: BispectralColumns, light: int) -> NDArray[np.bool_]:
    """Return whether each band overlaps the range of a light."""
    edges_nm = edges_from_centres(columns.output_nm)
    low_nm, high_nm = columns.window_nm[light]
    return np.asarray((edges_nm[1:] > low_nm) & (edges_nm[:-1] < high_nm))


def _slopes(columns: BispectralColumns, ratio: FloatArray, main: NDArray[np.intp]) -> FloatArray:
    """Return the change of the reflectance per nm about each band, shape (k,); 0 if unknown."""
    bands = np.arange(len(main))
    value, place_nm = ratio[bands, main], columns.centroid_nm[bands, main]
    known = np.isfinite(value)
    slope = np.zeros(len(main))
    if known.sum() >= 3:
        slope[known] = np.gradient(value[known], place_nm[known])
    return slope


def _at(
    columns: BispectralColumns,
    ratio: FloatArray,
    sigma: FloatArray,
    chosen: NDArray[np.intp],
    slope: FloatArray,
    place_nm: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the reflectance that chosen lights tell, and σ, at a wavelength of each band."""
    bands = np.arange(len(chosen))
    away = slope * (place_nm - columns.centroid_nm[bands, chosen])
    value, value_sigma = ratio[bands, chosen] + away, np.hypot(sigma[bands, chosen], away / 2)
    known = np.isfinite(sigma[bands, chosen])
    return np.where(known, value, np.nan), np.where(known, value_sigma, np.nan)
