"""The LEDs' file: spectrum and brightness of every LED at a white reference."""

from itertools import pairwise
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive
from labrig.optics import Spectrum

#: Wavelength in nm below which a camera with colour filters says nothing of a brightness.
UV_NM = 400.0

#: Whether brightnesses are on a scale of their own, or irradiances in W m⁻².
Scale = Literal["relative", "absolute"]
#: Whether the brightness of LEDs below `UV_NM` is on the scale of the others; none: there are none.
UvScale = Literal["measured", "unknown", "none"]


#: Origin of a spectrum.
LedSource = Literal["spectrometer", "camera", "rig file"]


class CalibratedLed(FrozenModel):
    """Light of one LED.

    Attributes
    ----------
    wavelength_nm
        Rising wavelengths of the spectrum in nm.
    value
        Its values per nm, the largest 1.
    sigma
        Standard uncertainty of the values; null where the spectrum was not measured.
    brightness
        Brightness on the scale of the file; null where it is unknown.
    brightness_sigma
        Standard uncertainty of the brightness; null where that is unknown.
    wavelength_sigma_nm
        Standard uncertainty in nm of an error that all wavelengths have in common.
    source
        Origin of the spectrum: measured by the `spectrometer`, or that of the `rig file`, shifted
        as the `camera` told.
    """

    wavelength_nm: tuple[Positive, ...]
    value: tuple[Finite, ...]
    sigma: tuple[NotNegative, ...] | None = None
    brightness: Positive | None = None
    brightness_sigma: NotNegative | None = None
    wavelength_sigma_nm: NotNegative
    source: LedSource

    @model_validator(mode="after")
    def _is_a_spectrum(self) -> Self:
        steps = [right - left for left, right in pairwise(self.wavelength_nm)]
        if not steps or min(steps) <= 0:
            raise ValueError("expected two or more rising numbers in 'wavelength_nm'")
        columns = (self.value,) if self.sigma is None else (self.value, self.sigma)
        if any(len(column) != len(self.wavelength_nm) for column in columns):
            raise ValueError(
                f"expected {len(self.wavelength_nm)} numbers in 'value' and 'sigma', one a "
                "wavelength"
            )
        if max(self.value) <= 0:
            raise ValueError("expected light in 'value', got none above 0")
        if (self.brightness is None) != (self.brightness_sigma is None):
            raise ValueError("expected 'brightness' and 'brightness_sigma' together")
        return self

    def spectrum(self, name: str) -> Spectrum:
        """Return the spectrum under a name."""
        sigma = None if self.sigma is None else np.array(self.sigma)
        return Spectrum(name, np.array(self.wavelength_nm), np.array(self.value), sigma)


class LedsFile(FrozenModel):
    """Spectra and brightnesses of a bank of LEDs at a white reference.

    Attributes
    ----------
    leds
        Spectrum and brightness of each LED by its name in the rig file; those that did not light
        are missing.
    scale
        Unit of the brightnesses: `relative`, the brightest is 1, or `absolute`, W m⁻².
    common_sigma
        Relative standard uncertainty that all brightnesses have in common.
    uv_scale
        Whether the brightness of LEDs with their peak below 400 nm is on the scale of the others:
        `measured` by a spectrometer, `unknown` without one; `none`: there is no such LED.
    source, run
        Origin of the numbers.

    Examples
    --------
    >>> from labrig.calibration import CalibratedLed, LedsFile
    >>> blue = CalibratedLed(
    ...     wavelength_nm=(440.0, 450.0, 460.0), value=(0.0, 1.0, 0.0), brightness=1.0,
    ...     brightness_sigma=0.02, wavelength_sigma_nm=0.1, source="spectrometer",
    ... )
    >>> file = LedsFile(leds={"450 nm": blue}, scale="relative", uv_scale="none")
    >>> file.leds["450 nm"].spectrum("450 nm").at([445.0, 450.0]).tolist()
    [0.5, 1.0]
    """

    kind: Literal["leds"] = "leds"
    leds: dict[str, CalibratedLed] = Field(min_length=1)
    scale: Scale
    common_sigma: NotNegative = 0.0
    uv_scale: UvScale
    source: str = ""
    run: str | None = None


LEDS_KIND = CalibrationKind(
    name="leds",
    protocol="led_brightness",
    optics_key="leds",
    file_name="leds.yaml",
    model=LedsFile,
)
