"""Model of how a camera body and lens turn light and settings into signal, used by a reduction."""

import math
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive
from labrig.foundation.region import Region, region_pixels

Numbers = tuple[Finite, ...]

#: Relative difference below which settings are the same: a Canon's dial shows 1/60 s for 1/64 s.
SAME_SETTING = 0.02
#: Number of points along each side of a region over which a flat field is averaged.
POINTS = 24


class Flat(FrozenModel):
    """Flat field 1 + Σ_k c_k ρ^(2k), k = 1, 2 …, ρ the distance from the centre per half diagonal.

    The part even about the centre is taken for the lens's vignetting. The odd part, `gradient`, is
    the lamp's: it is recorded, not divided out. An even part of the lamp's illumination cannot be
    distinguished from the lens's vignetting.

    Attributes
    ----------
    f_number
        The f-number; null for a lens that does not report it.
    falloff
        Coefficients c_k, a row for each channel.
    gradient
        Relative slope of the illuminated card's signal along x and y, per half diagonal, a row for
        each channel.
    sigma
        Relative scatter between the card's signal and this model over the frame, one standard
        deviation.
    """

    f_number: Annotated[float, Field(gt=0)] | None
    falloff: tuple[Numbers, ...]
    gradient: tuple[tuple[Finite, Finite], ...] = ()
    sigma: Annotated[float, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _falls_off(self) -> Self:
        if not self.falloff or len({len(row) for row in self.falloff}) != 1:
            raise ValueError("expected 'falloff' to have a row of the same length for each channel")
        if (self.at(np.linspace(0, 1, 21)) <= 0).any():
            raise ValueError("expected a 'falloff' that leaves some light everywhere in the frame")
        return self

    def at(self, rho2: ArrayLike) -> FloatArray:
        """Return the flat field at squared distances ρ² (…,), shape (…, channels)."""
        squared = np.asarray(rho2, dtype=np.float64)
        powers = squared[..., None] ** np.arange(1, len(self.falloff[0]) + 1)
        result: FloatArray = 1 + powers @ np.array(self.falloff).T
        return result

    def mean(self, region: Region, width: int, height: int) -> FloatArray:
        """Average the flat field over a region of a `width` × `height` frame, shape (channels,)."""
        left, top, wide, high = region_pixels(region, width, height)
        steps = (np.arange(POINTS) + 0.5) / POINTS
        x, y = np.meshgrid(left + steps * wide, top + steps * high)
        mean: FloatArray = self.at(rho_squared(x, y, width, height)).mean(axis=(0, 1))
        return mean


class Factor(FrozenModel):
    """Actual over nominal effect of a setting, with one standard deviation."""

    setting: Positive
    factor: Positive
    sigma: NotNegative


class Glare(FrozenModel):
    """Veiling glare: part of the frame's mean light that lies evenly over all of it.

    Attributes
    ----------
    fraction, sigma
        That fraction of the mean light, common to all channels and apertures, and σ.
    """

    fraction: Annotated[float, Field(ge=0, lt=1)]
    sigma: NotNegative


class CameraModel(FrozenModel):
    """A calibrated camera body and lens.

    Attributes
    ----------
    iso, f_number
        Settings at which all factors are 1; `f_number` is null for a lens that does not report it.
    channels
        Names of the sensor's channels.
    shutter
        Actual over nominal exposure time, by the nominal one in s; 1 at the longest.
    iso_gain
        Signal of the same light over that at `iso` times the ratio of the nominal values.
    aperture
        Light over that at `f_number` times the squared ratio of the nominal values.
    flats
        Flat fields, one for each f-number.
    glare
        Veiling glare of the lens; null if it was not measured.
    """

    iso: Positive
    f_number: Positive | None
    channels: tuple[str, ...]
    shutter: tuple[Factor, ...] = ()
    iso_gain: tuple[Factor, ...] = ()
    aperture: tuple[Factor, ...] = ()
    flats: Annotated[tuple[Flat, ...], Field(min_length=1)]
    glare: Glare | None = None

    def exposure_s(self, nominal_s: float) -> tuple[float, float]:
        """Return the actual exposure time of a nominal one in s, and its relative σ.

        The factor is interpolated in the logarithm of the nominal time and constant below the
        shortest calibrated one. Beyond the longest one the nominal time holds, since a shutter's
        error is of milliseconds.
        """
        if not self.shutter:
            return nominal_s, 0.0
        log_nominal = np.log([factor.setting for factor in self.shutter])
        log_time = math.log(nominal_s)
        longest = self.shutter[-1].setting
        sigma = float(np.interp(log_time, log_nominal, [factor.sigma for factor in self.shutter]))
        if nominal_s > longest * (1 + SAME_SETTING):
            return nominal_s, sigma * longest / nominal_s
        return nominal_s * float(
            np.interp(log_time, log_nominal, [factor.factor for factor in self.shutter])
        ), sigma

    def scale(self, iso: float, f_number: float | None) -> tuple[float, float]:
        """Return the signal at these settings over that at the model's own, and its relative σ.

        The σ is common to all frames at these settings. A setting that was not calibrated takes its
        nominal value.
        """
        gain, gain_sigma = _factor_at(self.iso_gain, iso)
        scale, sigma = gain * iso / self.iso, gain_sigma
        if f_number is not None and self.f_number is not None:
            light, light_sigma = _factor_at(self.aperture, f_number)
            scale *= light * (self.f_number / f_number) ** 2
            sigma = math.hypot(sigma, light_sigma)
        return scale, sigma

    def flat(self, f_number: float | None, region: Region, width: int, height: int) -> FloatArray:
        """Return the light in a region over that at the centre of the lens, shape (channels,).

        Parameters
        ----------
        f_number
            The f-number; None for a lens that does not report it.
        region
            Region of the frame.
        width, height
            Width and height of the frame in pixels.

        Raises
        ------
        DataError
            The aperture was not calibrated.
        """
        flat = self.flat_at(f_number)
        if flat is None:
            raise DataError(f"the camera file has no flat field at {f_number_text(f_number)}")
        return flat.mean(region, width, height)

    def flat_at(self, f_number: float | None) -> Flat | None:
        """Return the flat field of an aperture, or None if it was not calibrated."""
        return next((flat for flat in self.flats if _is_same(flat.f_number, f_number)), None)


def rho_squared(x: FloatArray, y: FloatArray, width: int, height: int) -> FloatArray:
    """Return ρ², the squared distance from the image centre over that of a corner.

    Parameters
    ----------
    x, y
        Positions in pixels from the upper left corner, of any shape.
    width, height
        Width and height of the frame in pixels.

    Returns
    -------
    ndarray
        Values of ρ², in the shape of `x`: 0 at the centre, 1 in the corners.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import rho_squared
    >>> x, y = np.array([320, 640, 640]), np.array([240, 240, 480])
    >>> rho_squared(x, y, 640, 480).round(3).tolist()
    [0.0, 0.64, 1.0]
    """
    across, down = x - width / 2, y - height / 2
    return (across**2 + down**2) / ((width / 2) ** 2 + (height / 2) ** 2)


def _factor_at(factors: tuple[Factor, ...], setting: float) -> tuple[float, float]:
    for factor in factors:
        if _is_same(factor.setting, setting):
            return factor.factor, factor.sigma
    return 1.0, 0.0


def _is_same(first: float | None, second: float | None) -> bool:
    if first is None or second is None:
        return first is second
    return abs(math.log(first / second)) < SAME_SETTING


def f_number_text(f_number: float | None) -> str:
    """Format an aperture for messages and reports.

    Parameters
    ----------
    f_number
        The f-number; None for a lens that does not report it.

    Returns
    -------
    str
        The aperture, such as `f/4`.

    Examples
    --------
    >>> from labrig.optics import f_number_text
    >>> f_number_text(5.6)
    'f/5.6'
    >>> f_number_text(None)
    'an unknown aperture'
    """
    return "an unknown aperture" if f_number is None else f"f/{f_number:g}"
