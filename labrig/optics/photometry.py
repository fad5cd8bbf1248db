"""Photometry: luminous efficacy by day and night, and irradiance from a lux reading."""

import math
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.optics.colorimetry import CIE_1931, observer
from labrig.optics.spectrum import Spectrum

#: Luminous efficacies of monochromatic light at their maxima in lm/W (CIE 18:2019).
PHOTOPIC_LM_PER_W, SCOTOPIC_LM_PER_W = 683.0, 1700.0
#: Scotopic efficiency at 555 nm as CIE 191 takes it, its rule for m, and its first guess.
_SCOTOPIC_555 = 683.0 / 1699.0
_MESOPIC_START, _MESOPIC_SLOPE, _MESOPIC_CONSTANT = 0.5, 0.3334, 0.767
#: Iterations of that rule, which converges by a factor of about 5 each time.
_ITERATIONS = 60

_SCOTOPIC = Path(__file__).with_name("cie_1951_scotopic.csv")


@cache
def _scotopic_table() -> tuple[FloatArray, FloatArray]:
    lines = read_text(_SCOTOPIC).splitlines()
    nm, efficiency = np.loadtxt(lines, delimiter=",", skiprows=2, unpack=True, encoding="utf-8")
    return nm, efficiency


def photopic_efficacy(wavelength_nm: ArrayLike) -> FloatArray:
    """Return 683 lm/W × V(λ) of the CIE 1924 observer.

    Parameters
    ----------
    wavelength_nm
        Wavelengths in nm, of any shape.

    Returns
    -------
    ndarray
        Luminous efficacy in lm/W, 0 beyond the table.

    Examples
    --------
    >>> from labrig.optics import photopic_efficacy
    >>> photopic_efficacy([500.0, 555.0]).round(1).tolist()
    [220.6, 683.0]
    """
    table = observer(CIE_1931)
    efficiency = table.functions[:, 1]
    return PHOTOPIC_LM_PER_W * _interpolated(wavelength_nm, table.wavelength_nm, efficiency)


def scotopic_efficacy(wavelength_nm: ArrayLike) -> FloatArray:
    """Return 1700 lm/W × V′(λ) of the CIE 1951 scotopic observer.

    Parameters
    ----------
    wavelength_nm
        Wavelengths in nm, of any shape.

    Returns
    -------
    ndarray
        Scotopic luminous efficacy in lm/W, 0 beyond the table.

    Examples
    --------
    >>> from labrig.optics import scotopic_efficacy
    >>> scotopic_efficacy([507.0, 555.0]).round().tolist()
    [1700.0, 683.0]
    """
    return SCOTOPIC_LM_PER_W * _interpolated(wavelength_nm, *_scotopic_table())


def mesopic_adaptation(luminance_cd_per_m2: float, scotopic_over_photopic: float) -> float:
    """Return the coefficient m by which eyes are adapted: 1 photopic, 0 scotopic.

    Parameters
    ----------
    luminance_cd_per_m2
        Photopic luminance of the adaptation field in cd/m².
    scotopic_over_photopic
        Ratio S/P of that field's light.

    Returns
    -------
    float
        Coefficient m from 0 to 1.

    References
    ----------
    CIE 191:2010, *Recommended System for Mesopic Photometry Based on Visual Performance*.

    Examples
    --------
    >>> from labrig.optics import mesopic_adaptation
    >>> round(mesopic_adaptation(0.3, 1.4), 3), mesopic_adaptation(6.0, 1.0)
    (0.604, 1.0)
    """
    m = _MESOPIC_START
    for _ in range(_ITERATIONS):
        adapted = mesopic_ratio(m, scotopic_over_photopic) * luminance_cd_per_m2
        m = min(max(_MESOPIC_CONSTANT + _MESOPIC_SLOPE * math.log10(adapted), 0.0), 1.0)
    return m


def mesopic_ratio(adaptation: float, scotopic_over_photopic: float) -> float:
    """Return the mesopic over the photopic luminance of a light.

    Parameters
    ----------
    adaptation
        Coefficient m of `mesopic_adaptation`.
    scotopic_over_photopic
        Ratio S/P of the light.

    Returns
    -------
    float
        Ratio, 1 for m = 1 and S/P for m = 0.

    References
    ----------
    CIE 191:2010, equation 2.

    Examples
    --------
    >>> from labrig.optics import mesopic_ratio
    >>> mesopic_ratio(1.0, 3.0), round(mesopic_ratio(0.0, 3.0), 6)
    (1.0, 3.0)
    """
    scotopic = (1 - adaptation) * _SCOTOPIC_555
    return (adaptation + scotopic * scotopic_over_photopic) / (adaptation + scotopic)


def _interpolated(wavelength_nm: ArrayLike, nm: FloatArray, value: FloatArray) -> FloatArray:
    target_nm = np.asarray(wavelength_nm, dtype=np.float64)
    return np.interp(target_nm, nm, value, left=0.0, right=0.0)


#: Luminous efficacy of radiation of 540 THz in lm/W, by the definition of the candela.
LUMENS_PER_WATT = 683.0


def absolute_irradiance(lux: float, lamp: Spectrum) -> Spectrum:
    """Return the spectral irradiance of a lamp that a meter reads as so many lux.

    E_v = 683 lm/W ∫ V(λ) E(λ) dλ, with V(λ) of the CIE 1931 observer. What the lamp has outside of
    the visible follows from its relative spectrum alone.

    Parameters
    ----------
    lux
        Illuminance in lux.
    lamp
        Relative spectrum of the lamp.

    Returns
    -------
    Spectrum
        Irradiance in W m⁻² nm⁻¹ on the lamp's wavelengths.

    Raises
    ------
    UsageError
        The lamp has no visible light.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import Spectrum, absolute_irradiance
    >>> green = Spectrum("green", np.array([554.0, 555.0, 556.0]), np.array([0.0, 1.0, 0.0]))
    >>> lamp = absolute_irradiance(683.0, green)
    >>> f"{np.trapezoid(lamp.value, lamp.wavelength_nm):.3f} W/m²"
    '1.000 W/m²'
    """
    eye = observer(CIE_1931)
    nm = np.union1d(eye.wavelength_nm, lamp.wavelength_nm)
    seen = lamp.at(nm) * np.interp(nm, eye.wavelength_nm, eye.functions[:, 1], left=0, right=0)
    lumens = LUMENS_PER_WATT * float(np.trapezoid(seen, nm))
    if not lumens > 0:
        raise UsageError(
            f"{lamp.name}: expected a lamp with visible light beside a reading in lux, got none"
        )
    factor = lux / lumens
    sigma = None if lamp.sigma is None else factor * lamp.sigma
    return Spectrum(lamp.name, lamp.wavelength_nm, factor * lamp.value, sigma)
