"""Mercury lines along a strip, and the strip's place on the sample by them."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from labrig.fit.lvf import WavelengthFit, fit_wavelengths, locate_lines
from labrig.foundation.errors import DataError, FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.optics import Lvf, Strip, WavelengthMap
from labrig.protocols.lvf_calibration.result import PlacedStrip, Stripes, StripLines
from labrig.results import StripProfile

#: Range of positions, from the blue end to the red end.
WHOLE = (0.0, 1.0)
#: Mercury lines in nm that excite phosphors; those of longer wavelength seldom do.
EXCITING_NM = (365.02, 404.6565, 407.7837, 435.8335, 546.0750)
#: Largest shift of the sample by the door, as a fraction of the strip's length.
MAX_SHIFT = 0.08
#: Fraction of the variance along the strip that detected stripes explain at least.
MIN_EXPLAINED = 0.7


def strip_lines(profile: StripProfile, strip: Strip, rising: bool | None) -> StripLines:
    """Locate the lines.

    Parameters
    ----------
    profile
        Light of the mercury lamp along the strip.
    strip
        Place of the strip; the direction of its wavelengths does not matter.
    rising
        Whether wavelengths are expected to rise from left to right; None accepts both directions.

    Raises
    ------
    FitError
        There are no lines, or the strip is the wrong way round.
    """
    lines = locate_lines(profile.position, profile.value_dn_per_s, rising=rising)
    position = lines.position if lines.rising else 1 - lines.position
    return StripLines(
        strip.model_copy(update={"rising": lines.rising}),
        profile,
        replace(lines, position=position),
    )


def wavelengths_along(lamp_strip: StripLines) -> WavelengthFit:
    """Fit the wavelength by the position from the blue end to the red end."""
    return fit_wavelengths(lamp_strip.lines, WHOLE)


def place_on_sample(lamp_strip: StripLines, wavelengths: WavelengthMap) -> PlacedStrip:
    """Move the ends of a strip until its lines agree with the filter's map.

    The lamp's light is oblique and the camera sees the strip from another distance: it is shifted
    and stretched, but the filter is the same.

    Raises
    ------
    DataError
        The strip would leave the frame.
    """
    lines = lamp_strip.lines
    slope = np.abs(np.gradient(wavelengths.wavelength_nm(np.linspace(*WHOLE, 201)), 0.005)).mean()
    sigma = np.hypot(lines.sigma, 0.1 / slope)
    map_position = wavelengths.position(lines.wavelength_nm)
    (stretch, shift), covariance = np.polyfit(
        map_position, lines.position, 1, w=1 / sigma, cov="unscaled"
    )
    strip = _move_ends(lamp_strip.strip, float(shift), float(shift + stretch))
    position = (lines.position - shift) / stretch
    terms = np.array([map_position.mean(), 1.0])
    return PlacedStrip(
        strip,
        wavelengths.wavelength_nm(position) - lines.wavelength_nm,
        float(slope * np.sqrt(terms @ covariance @ terms)),
    )


def _move_ends(strip: Strip, blue: float, red: float) -> Strip:
    """Return the strip whose blue and red ends are at these positions along the old one."""
    start, end = (blue, red) if strip.rising else (1 - red, 1 - blue)
    left, right = np.array(strip.left), np.array(strip.right)
    ends = [left + fraction * (right - left) for fraction in (start, end)]
    # What leaves the frame at an end does so by a pixel or two of a strip that fills it.
    (x0, y0), (x1, y1) = (np.clip(point, 0.0, 1.0).tolist() for point in ends)
    try:
        return Strip(left=(x0, y0), right=(x1, y1), height=strip.height, rising=strip.rising)
    except ValueError:
        raise DataError(
            "by its mercury lines the strip on the sample would leave the frame; aim the camera so "
            "that all of it is seen"
        ) from None


def shifted_by_stripes(
    profile: StripProfile, strip: Strip, lvf: Lvf, nm_per_strip: float
) -> Stripes:
    """Shift the strip until the stripes of glow lie where the filter transmits mercury lines.

    Heights of the lines are free: how strongly each of them excites is unknown here.

    Raises
    ------
    FitError
        No stripes are detected.
    """
    position = profile.position if strip.rising else 1 - profile.position
    glow = profile.value_dn_per_s.sum(axis=1)
    shapes = lvf.transmission(np.array(EXCITING_NM)).T
    variation = float(((glow - glow.mean()) ** 2).sum())

    def residual_square(shift: float) -> float:
        unshifted = np.clip(position - shift, lvf.position[0], lvf.position[-1])
        columns = [np.interp(unshifted, lvf.position, shape) for shape in shapes]
        design = np.column_stack([*columns, np.ones_like(unshifted)])
        residual = glow - design @ nonnegative_least_squares(design, glow)
        return float(residual @ residual)

    coarse = np.linspace(-MAX_SHIFT, MAX_SHIFT, 33)
    best = coarse[np.argmin([residual_square(shift) for shift in coarse])]
    step = coarse[1] - coarse[0]
    # Least squares, but of curves with a kink at every position of the filter: without slopes.
    result = minimize_scalar(residual_square, bounds=(best - step, best + step), method="bounded")
    if not variation or result.fun > (1 - MIN_EXPLAINED) * variation:
        raise FitError("no stripes of mercury lines are seen on the sample")
    shift = float(result.x)
    curvature = (
        residual_square(shift + step) + residual_square(shift - step) - 2 * result.fun
    ) / step**2
    noise = result.fun / max(len(glow) - len(EXCITING_NM) - 2, 1)
    sigma = float(np.sqrt(2 * noise / curvature)) if curvature > 0 else MAX_SHIFT
    return Stripes(_move_ends(strip, shift, 1 + shift), shift * nm_per_strip, sigma * nm_per_strip)
