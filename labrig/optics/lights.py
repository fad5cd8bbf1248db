"""Lights by name: CIE illuminants, narrow bands, measured spectra."""

import os
import re

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import is_path
from labrig.optics.colorimetry import illuminant
from labrig.optics.curve_file import read_spectrum
from labrig.optics.piecewise import band_integrals
from labrig.optics.spectrum import Spectrum

#: Full width at half maximum in nm of a light that is given by its wavelength alone.
NARROW_FWHM_NM = 10.0
#: Equivalent width in nm below which a light leaves most surfaces without a colour of their own.
NARROW_NM = 50.0
_WAVELENGTH = re.compile(r"(\d+(?:\.\d+)?) ?nm")


def read_light(name_or_path: str | os.PathLike[str]) -> Spectrum:
    """Return a light.

    Parameters
    ----------
    name_or_path
        A CIE illuminant such as `D65` or `A`; a wavelength such as `450nm`, for a narrow light of
        10 nm full width at half maximum, triangular; or the path of a file with one spectrum.

    Returns
    -------
    Spectrum
        Relative power per nm.

    Raises
    ------
    UsageError
        There is no such illuminant and no such file, the wavelength is not from 200 nm to 2000 nm,
        or the file is malformed.

    Examples
    --------
    >>> from labrig.optics import read_light
    >>> read_light("450nm").at([445.0, 450.0, 460.0]).tolist()
    [0.5, 1.0, 0.0]
    """
    text = os.fspath(name_or_path)
    wavelength = _WAVELENGTH.fullmatch(text.strip())
    if wavelength is not None:
        centre_nm = float(wavelength[1])
        if not 200 <= centre_nm <= 2000:
            raise UsageError(f"expected a light from 200 nm to 2000 nm, got '{text}'")
        grid_nm = centre_nm + NARROW_FWHM_NM * np.array([-1.0, 0.0, 1.0])
        return Spectrum(text, grid_nm, np.array([0.0, 1.0, 0.0]))
    if is_path(text):
        return read_spectrum(text)
    try:
        return illuminant(text)
    except UsageError as error:
        raise UsageError(f"{error}; or give a wavelength such as 450nm, or a file") from None


def is_narrow(light: Spectrum) -> bool:
    """Return whether a light is so narrow that reflection alone has no colour under it.

    Parameters
    ----------
    light
        Power per nm, not negative and somewhere above zero.

    Returns
    -------
    bool
        Whether its equivalent width, the integral over the maximum, is below 50 nm.

    Examples
    --------
    >>> from labrig.optics import is_narrow, read_light
    >>> is_narrow(read_light("395nm")), is_narrow(read_light("A"))
    (True, False)
    """
    ends_nm = light.wavelength_nm[[0, -1]]
    power = float(band_integrals(light.wavelength_nm, light.value, ends_nm)[0])
    return power < NARROW_NM * float(light.value.max())
