"""Spectral irradiance in W m⁻² nm⁻¹ from a lux reading and a lamp's relative spectrum."""

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.optics.colorimetry import CIE_1931, observer
from labrig.optics.spectrum import Spectrum

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
