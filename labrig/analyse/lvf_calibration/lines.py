"""Mercury lines along a strip, and the strip's place on the sample by them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from labrig.analyse.lvf_calibration.picture import FloatArray, Picture
from labrig.analyse.lvf_calibration.profile import StripProfile, strip_profile
from labrig.calibration.lvf_file import Strip
from labrig.errors import DataError, FitError
from labrig.fit.lvf import LocatedLines, WavelengthFit, fit_wavelengths, locate_lines
from labrig.optics import Lvf, WavelengthMap

#: From blue end to red end.
WHOLE = (0.0, 1.0)
#: Lines that excite phosphors, in nm; those of longer wavelength seldom do.
EXCITING_NM = (365.02, 404.6565, 407.7837, 435.8335, 546.0750)
#: Doors let the sample shift by no more, as a share of the strip's length.
MOST_SHIFT = 0.08
#: Stripes are seen if they explain this share of what varies along the strip.
LEAST_EXPLAINED = 0.7


@dataclass(frozen=True, eq=False)
class StripLines:
    """A strip under the mercury lamp.

    Attributes
    ----------
    strip
        With its wavelengths rising as they were found.
    profile
        From its left end to its right end.
    lines
        At positions from the blue end, 0, to the red end, 1.
    """

    strip: Strip
    profile: StripProfile
    lines: LocatedLines


def strip_lines(picture: Picture, strip: Strip, rising: bool | None) -> StripLines:
    """Locate the lines.

    Parameters
    ----------
    strip
        Which way its wavelengths rise is not asked.
    rising
        Which way they are expected to rise from left to right; None: as they do.

    Raises
    ------
    FitError
        There are none, or the strip is the wrong way round.
    """
    profile = strip_profile(picture, strip)
    lines = locate_lines(profile.position, profile.value, rising=rising)
    position = lines.position if lines.rising else 1 - lines.position
    return StripLines(
        strip.model_copy(update={"rising": lines.rising}),
        profile,
        replace(lines, position=position),
    )


def wavelengths_along(found: StripLines) -> WavelengthFit:
    """Position → wavelength from the blue end to the red end."""
    return fit_wavelengths(found.lines, WHOLE)


@dataclass(frozen=True, eq=False)
class Placed:
    """The strip on the sample.

    Attributes
    ----------
    strip
        Such that the map known from before the camera holds along it.
    residual_nm
        (l,) wavelength of the map there minus that of the line.
    sigma_nm
        Standard uncertainty of the strip's place, in the middle of the lines.
    """

    strip: Strip
    residual_nm: FloatArray
    sigma_nm: float


def place_on_sample(found: StripLines, wavelengths: WavelengthMap) -> Placed:
    """Move the ends of a strip until its lines are where the filter has them.

    The lamp comes in obliquely and the camera sees the strip from another distance: it is shifted
    and stretched, but the filter is the same.

    Raises
    ------
    DataError
        The strip would leave the frame.
    """
    lines = found.lines
    slope = np.abs(np.gradient(wavelengths.wavelength_nm(np.linspace(*WHOLE, 201)), 0.005)).mean()
    sigma = np.hypot(lines.sigma, 0.1 / slope)
    wanted = wavelengths.position(lines.wavelength_nm)
    (stretch, shift), covariance = np.polyfit(
        wanted, lines.position, 1, w=1 / sigma, cov="unscaled"
    )
    strip = _moved(found.strip, float(shift), float(shift + stretch))
    there = (lines.position - shift) / stretch
    at = np.array([wanted.mean(), 1.0])
    return Placed(
        strip,
        wavelengths.wavelength_nm(there) - lines.wavelength_nm,
        float(slope * np.sqrt(at @ covariance @ at)),
    )


def _moved(strip: Strip, blue: float, red: float) -> Strip:
    """The strip whose blue and red ends are at these positions along the old one."""
    start, end = (blue, red) if strip.rising else (1 - red, 1 - blue)
    left, right = np.array(strip.left), np.array(strip.right)
    ends = [left + share * (right - left) for share in (start, end)]
    # What leaves the frame at an end does so by a pixel or two of a strip that fills it.
    (x0, y0), (x1, y1) = (np.clip(point, 0.0, 1.0).tolist() for point in ends)
    try:
        return Strip(left=(x0, y0), right=(x1, y1), height=strip.height, rising=strip.rising)
    except ValueError:
        raise DataError(
            "by its mercury lines the strip on the sample would leave the frame; aim the camera so "
            "that all of it is seen"
        ) from None


@dataclass(frozen=True)
class Stripes:
    """How far the glow is from where the card was lit.

    Attributes
    ----------
    strip
        On the sample as the camera sees it.
    shift_nm, sigma_nm
        Along the strip, towards the red end.
    """

    strip: Strip
    shift_nm: float
    sigma_nm: float


def shifted_by_stripes(picture: Picture, strip: Strip, lvf: Lvf, nm_per_strip: float) -> Stripes:
    """Shift the strip until the stripes of glow are where the filter lets mercury lines through.

    Heights of the lines are free: how strongly each of them excites is not known yet.

    Raises
    ------
    FitError
        No stripes are seen.
    """
    profile = strip_profile(picture, strip)
    position = profile.position if strip.rising else 1 - profile.position
    glow = profile.value.sum(axis=1)
    shapes = lvf.transmission(np.array(EXCITING_NM)).T
    varies = float(((glow - glow.mean()) ** 2).sum())

    def left(shift: float) -> float:
        at = np.clip(position - shift, lvf.position[0], lvf.position[-1])
        columns = [np.interp(at, lvf.position, shape) for shape in shapes]
        design = np.column_stack([*columns, np.ones_like(at)])
        return float(nnls(design, glow)[1] ** 2)

    coarse = np.linspace(-MOST_SHIFT, MOST_SHIFT, 33)
    best = coarse[np.argmin([left(shift) for shift in coarse])]
    step = coarse[1] - coarse[0]
    found = minimize_scalar(left, bounds=(best - step, best + step), method="bounded")
    if not varies or found.fun > (1 - LEAST_EXPLAINED) * varies:
        raise FitError("no stripes of mercury lines are seen on the sample")
    shift = float(found.x)
    curvature = (left(shift + step) + left(shift - step) - 2 * found.fun) / step**2
    noise = found.fun / max(len(glow) - len(EXCITING_NM) - 2, 1)
    sigma = float(np.sqrt(2 * noise / curvature)) if curvature > 0 else MOST_SHIFT
    return Stripes(_moved(strip, shift, 1 + shift), shift * nm_per_strip, sigma * nm_per_strip)


def told(lines: LocatedLines) -> str:
    """In a few words."""
    way = "rising" if lines.rising else "falling"
    return f"{', '.join(f'{nm:.0f}' for nm in lines.wavelength_nm)} nm, {way} to the right"
