"""Luminous efficacy of light: photopic, scotopic, and mesopic by CIE 191."""

import math
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.foundation.input_file import read_text
from labrig.optics.colorimetry import CIE_1931, observer

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
