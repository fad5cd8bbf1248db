"""The light of an LED or a lamp as far as a rig file describes it."""

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.foundation import resources
from labrig.foundation.models import FrozenModel
from labrig.foundation.named_files import FilePath, ShippedOrFile
from labrig.foundation.quantity import DurationS
from labrig.optics import Spectrum, read_light, read_spectrum

FWHM_OVER_SIGMA = 2 * math.sqrt(2 * math.log(2))
#: Half width of the grid of a spectrum that is given by its centre and width, in widths.
TAIL_WIDTHS = 3.0


class LedLight(FrozenModel):
    """The light of an LED as far as it is known: keys that every bank of LEDs has for each of them.

    Attributes
    ----------
    spectrum
        File with the spectrum of the LED, in relative units per nm; given instead of `centre` and
        `fwhm`.
    centre
        Wavelength of the LED's peak in nm, together with `fwhm`.
    fwhm
        Full width at half maximum of the LED's band in nm.
    settling
        Time from switching on until the LED's light is steady, for example `0.5 s`; protocols wait
        for it.

    Raises
    ------
    ValueError
        Both a file and a band are given, or half of a band.

    Examples
    --------
    >>> from labrig.acquire import LedLight
    >>> blue = LedLight.model_validate({"centre": 450, "fwhm": 20, "settling": "0.5 s"})
    >>> blue.relative_spectrum().at([440.0, 450.0, 460.0]).round(2).tolist()
    [0.5, 1.0, 0.5]
    >>> blue.peak_nm(), blue.settling
    (450.0, 0.5)
    """

    spectrum: FilePath | None = None
    centre: Annotated[float, Field(ge=200, le=1200)] | None = None
    fwhm: Annotated[float, Field(ge=1, le=400)] | None = None
    settling: Annotated[DurationS, Field(ge=0, le=600)] = 0.0

    @model_validator(mode="after")
    def _one_description(self) -> Self:
        if (self.centre is None) != (self.fwhm is None):
            raise ValueError("expected 'centre' and 'fwhm' together")
        if self.spectrum is not None and self.centre is not None:
            raise ValueError("expected 'spectrum', or 'centre' and 'fwhm'; got both")
        return self

    def relative_spectrum(self) -> Spectrum | None:
        """Return the spectrum per nm in relative units, None if the rig file says nothing of it.

        A band that is given by centre and width is a normal distribution; a real one is skewed.

        Raises
        ------
        UsageError
            The file is missing or malformed.
        """
        if self.spectrum is not None:
            return read_spectrum(self.spectrum)
        if self.centre is None or self.fwhm is None:
            return None
        offset = np.linspace(-TAIL_WIDTHS, TAIL_WIDTHS, round(40 * TAIL_WIDTHS) + 1)
        shape = np.exp(-((offset * FWHM_OVER_SIGMA) ** 2) / 2)
        return Spectrum(f"{self.centre:g} nm", self.centre + offset * self.fwhm, shape)

    def peak_nm(self) -> float | None:
        """Return the wavelength of the peak in nm, None if the rig file says nothing of it.

        Raises
        ------
        UsageError
            The file of the spectrum is missing or malformed.
        """
        spectrum = self.relative_spectrum()
        if spectrum is None:
            return None
        return float(spectrum.wavelength_nm[spectrum.value.argmax()])


class Illuminant(LedLight):
    """The light of a lamp as far as it is known: keys of each lamp of a bank.

    Attributes
    ----------
    spectrum
        Spectrum of the lamp in relative units per nm: a CIE illuminant such as `D65`, the name of a
        shipped file such as `halogen_3000k`, or the path of a file; given instead of `centre` and
        `fwhm`.
    settling
        Time from switching on until the lamp is warm and its light steady, for example `10 min`;
        protocols wait for it.
    filter
        Colour filter that is fixed before the lamp, by its name in the rig's folder of filters.
        Default: none.

    Examples
    --------
    >>> from labrig.acquire import Illuminant
    >>> lamp = Illuminant.model_validate({"spectrum": "halogen_3000k", "settling": "10 min"})
    >>> lamp.settling, lamp.relative_spectrum().at([450.0, 650.0]).round(2).tolist()
    (600.0, [0.39, 1.49])
    """

    spectrum: ShippedOrFile | None = None
    settling: Annotated[DurationS, Field(ge=0, le=7200)] = 0.0
    filter: Annotated[str, Field(min_length=1)] | None = None

    def relative_spectrum(self) -> Spectrum | None:
        """Return the spectrum per nm without the filter, None if the rig file says nothing of it.

        Raises
        ------
        UsageError
            There is no such illuminant and no such file, or the file is malformed.
        """
        if self.spectrum is None:
            return super().relative_spectrum()
        shipped = resources.curve_path(self.spectrum)
        return read_light(shipped if shipped.exists() else self.spectrum)
