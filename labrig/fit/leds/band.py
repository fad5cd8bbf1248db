"""The band of an LED in a measured spectrum: where there is light, how much, and what is beside.

Light is summed over the band only. Over all pixels of a spectrometer, most of which see nothing,
the error of their common dark level would exceed the LED's light.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import PIXEL_DETECTION_SIGMA
from labrig.optics import Spectrum

#: Width in nm over which pixels are averaged where it is decided whether there is light.
SMOOTH_NM = 2.0
#: Fraction of the peak below which wings are left out: stray light of the instrument.
WING = 1e-3
#: Margin on each side of the significant band, as a fraction of its width.
MARGIN = 0.15
#: Step in nm of the spectrum that is returned.
STEP_NM = 1.0
#: Clipping of lit pixels: limit in standard deviations, these by the median deviation, and rounds.
CLIP_SIGMA, MAD_SIGMA, CLIPPINGS = 2.5, 1.4826, 6
#: Relative scatter of the response from pixel to pixel.
PIXEL_SCATTER = 0.01


@dataclass(frozen=True, eq=False)
class LedBand:
    """Light of one LED by a spectrometer.

    Attributes
    ----------
    spectrum
        The band in steps of 1 nm, in the unit of the reading, with its independent σ.
    light, sigma
        Light in the band, ∫ value dλ, and σ by the noise.
    peak_nm
        Wavelength of the strongest light in nm.
    centroid_nm, centroid_nm_sigma
        Centroid of the band in nm, and σ by the noise.
    beside : ndarray, shape (n,)
        Reading without the band, 0 there.
    wavelength_nm, value_sigma : ndarray, shape (n,)
        Wavelengths of the reading in nm, and σ of its values.
    """

    spectrum: Spectrum
    light: float
    sigma: float
    peak_nm: float
    centroid_nm: float
    centroid_nm_sigma: float
    beside: FloatArray
    wavelength_nm: FloatArray
    value_sigma: FloatArray


def led_band(
    name: str, wavelength_nm: FloatArray, value: FloatArray, sigma: FloatArray
) -> LedBand | None:
    """Find the band of an LED about the strongest light of a spectrum.

    Parameters
    ----------
    name
        Name of the LED.
    wavelength_nm, value, sigma : ndarray, shape (n,)
        Rising wavelengths in nm, light per nm above the dark, and its independent σ.

    Returns
    -------
    LedBand or None
        The band; None if there is no light above the noise.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.leds import led_band
    >>> wavelength_nm = np.arange(350.0, 750.0, 0.4)
    >>> rng = np.random.default_rng(1)
    >>> value = 1000 * np.exp(-(((wavelength_nm - 530.0) / 15.0) ** 2))
    >>> value += rng.normal(0.0, 10.0, len(value))
    >>> band = led_band("530 nm", wavelength_nm, value, np.full(len(value), 10.0))
    >>> f"{band.centroid_nm:.1f} nm, {band.light / (1000 * 15 * np.pi**0.5):.2f}"
    '530.0 nm, 1.00'
    """
    pixel_nm = float(np.median(np.diff(wavelength_nm)))
    width = max(3, round(SMOOTH_NM / pixel_nm) | 1)
    window = np.ones(width) / width
    smooth = np.convolve(value, window, mode="same")
    smooth_sigma = np.sqrt(np.convolve(sigma**2, window, mode="same") / width)
    peak = int(np.argmax(smooth))
    level = _level_beside(smooth, peak)
    smooth, value = smooth - level, value - level
    if smooth[peak] < PIXEL_DETECTION_SIGMA * smooth_sigma[peak]:
        return None
    is_lit = smooth > np.maximum(PIXEL_DETECTION_SIGMA * smooth_sigma, WING * smooth[peak])
    first, last = _run_about(is_lit, peak)
    margin = round(MARGIN * (last - first + 1)) + width
    first, last = max(first - margin, 0), min(last + margin, len(value) - 1)
    inside = slice(first, last + 1)
    step_nm = np.gradient(wavelength_nm)[inside]
    weight = value[inside] * step_nm
    noise = np.hypot(sigma[inside], PIXEL_SCATTER * value[inside]) * step_nm
    light = float(weight.sum())
    centroid = float(weight @ wavelength_nm[inside] / light)
    beside = value.copy()
    beside[inside] = 0.0
    return LedBand(
        spectrum=_binned(name, wavelength_nm[inside], value[inside], sigma[inside]),
        light=light,
        sigma=float(np.linalg.norm(noise)),
        peak_nm=float(wavelength_nm[peak]),
        centroid_nm=centroid,
        centroid_nm_sigma=float(np.linalg.norm(noise * (wavelength_nm[inside] - centroid)) / light),
        beside=beside,
        wavelength_nm=wavelength_nm,
        value_sigma=sigma,
    )


def light_within(band: LedBand, low_nm: float, high_nm: float) -> tuple[float, float]:
    """Return light beside a band between two wavelengths, relative to the band's, and σ.

    Parameters
    ----------
    band
        Band of an LED.
    low_nm, high_nm
        Ends in nm.

    Returns
    -------
    tuple of float
        Light beside the band over that in it, and its standard uncertainty.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.leds import led_band, light_within
    >>> wavelength_nm = np.arange(350.0, 750.0, 0.4)
    >>> value = np.exp(-(((wavelength_nm - 400.0) / 10.0) ** 2))
    >>> value += 0.1 * np.exp(-(((wavelength_nm - 600.0) / 10.0) ** 2))
    >>> band = led_band("400 nm", wavelength_nm, value, np.full(len(value), 1e-4))
    >>> f"{light_within(band, 550.0, 650.0)[0]:.2f}"
    '0.10'
    """
    within = (band.wavelength_nm >= low_nm) & (band.wavelength_nm <= high_nm)
    within &= band.beside != 0.0
    step_nm = np.gradient(band.wavelength_nm)[within]
    light = float(band.beside[within] @ step_nm)
    return light / band.light, float(
        np.linalg.norm(band.value_sigma[within] * step_nm)
    ) / band.light


def _level_beside(smooth: FloatArray, peak: int) -> float:
    """Return the level of the pixels without light, by clipping those that differ from it.

    More than half of them are dark, whatever an LED and a dye send out.
    """
    dark = np.abs(smooth - smooth[peak]) > 0
    for _ in range(CLIPPINGS):
        level = float(np.median(smooth[dark]))
        spread = float(np.median(np.abs(smooth[dark] - level))) * MAD_SIGMA
        dark = np.abs(smooth - level) <= CLIP_SIGMA * spread
    return float(np.median(smooth[dark]))


def _run_about(is_lit: NDArray[np.bool_], peak: int) -> tuple[int, int]:
    """Return the first and the last place of the unbroken run about a place."""
    dark = np.flatnonzero(~is_lit)
    place = int(np.searchsorted(dark, peak))
    first = int(dark[place - 1]) + 1 if place > 0 else 0
    last = int(dark[place]) - 1 if place < len(dark) else len(is_lit) - 1
    return first, last


def _binned(name: str, wavelength_nm: FloatArray, value: FloatArray, sigma: FloatArray) -> Spectrum:
    """Average neighbouring pixels to steps of 1 nm; the largest value is 1."""
    number = ((wavelength_nm - wavelength_nm[0]) / STEP_NM).astype(np.intp)
    count = np.bincount(number)
    kept = count > 0
    mean_nm, mean, variance = (
        np.bincount(number, weights=column)[kept] / count[kept]
        for column in (wavelength_nm, value, sigma**2 + (PIXEL_SCATTER * value) ** 2)
    )
    return Spectrum(name, mean_nm, mean / mean.max(), np.sqrt(variance / count[kept]) / mean.max())
