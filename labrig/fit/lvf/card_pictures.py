"""Comparison of two pictures of a lit card through the same variable filter."""

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.optics import Strip
from labrig.results import Measured, PictureChange, StripProfile

#: Wavelengths in nm between which the change of the lamp's colour is given.
BLUE_NM, RED_NM = 420.0, 680.0
#: Light of a place, as a fraction of the brightest one's, below which it is not compared.
BRIGHT = 0.02
#: σ of the brightness of one picture: lamp, shutter and aperture flicker.
FLICKER = 0.005
#: σ of the place of an end of the strip in a frame, in pixels.
EDGE_PIXELS = 0.5


def place_means(profile: StripProfile, places: int) -> FloatArray:
    """Average a profile along a strip over places of equal length.

    Parameters
    ----------
    profile
        Light along the strip.
    places
        Number of places.

    Returns
    -------
    ndarray, shape (places, channels)
        Mean signal in DN/s, from left to right.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.lvf import place_means
    >>> from labrig.results import StripProfile
    >>> profile = StripProfile(np.array([0.125, 0.375, 0.625, 0.875]), np.arange(4.0)[:, None])
    >>> place_means(profile, 2).ravel().tolist()
    [0.5, 2.5]
    """
    value = profile.value_dn_per_s
    ends = np.linspace(0.0, 1.0, len(value) + 1)
    until = np.vstack([np.zeros(value.shape[1]), np.cumsum(value, axis=0) / len(value)])
    edges = np.linspace(0.0, 1.0, places + 1)
    at_edges = np.stack([np.interp(edges, ends, column) for column in until.T], axis=1)
    return np.asarray(np.diff(at_edges, axis=0) * places)


def compare_card_pictures(
    wavelength_nm: ArrayLike,
    before_dn_per_s: ArrayLike,
    now_dn_per_s: ArrayLike,
    strips: tuple[Strip, Strip],
    width: float,
) -> PictureChange:
    """Compare the light of a card through a filter with that of an earlier picture.

    The logarithm of the ratio is a constant, the brightness, and a multiple of 1/λ, by which a
    black-body emitter changes with its temperature (Wien's law); what is left is unevenness. Each
    place is compared in its brightest channel.

    Parameters
    ----------
    wavelength_nm
        Wavelengths of the places in nm, shape (p,).
    before_dn_per_s, now_dn_per_s
        Signal of the places at the same camera settings in DN/s, shape (p, channels).
    strips
        Position of the filter in the frame before and now.
    width
        Width of the frame in pixels.

    Returns
    -------
    PictureChange
        Brightness, colour, shift and unevenness.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.lvf import compare_card_pictures
    >>> from labrig.optics import Strip
    >>> strip = Strip(left=(0.1, 0.5), right=(0.9, 0.5), height=0.2, rising=True)
    >>> nm = np.linspace(400.0, 700.0, 31)
    >>> before = np.full((31, 1), 100.0)
    >>> redder = before * (nm[:, None] / 550) ** 0.5
    >>> change = compare_card_pictures(nm, before, redder, (strip, strip), 1000)
    >>> f"{change.brightness.value:.2f}, {change.colour.value:.2f}, {change.shift_nm.value:.0f}"
    '1.00, 0.78, 0'
    """
    nm = np.asarray(wavelength_nm, dtype=np.float64)
    before, now = (np.asarray(x, dtype=np.float64) for x in (before_dn_per_s, now_dn_per_s))
    every = np.arange(len(nm))
    brightest = before.argmax(axis=1)
    light = before[every, brightest]
    lit = light > BRIGHT * light.max()
    ratio = np.maximum(now[every, brightest][lit], 1e-6 * light.max()) / light[lit]
    inverse = (1 / nm[lit] - (1 / nm[lit]).mean()) / (1 / BLUE_NM - 1 / RED_NM)
    design = np.column_stack([np.ones_like(inverse), inverse])
    (level, slope), *_ = np.linalg.lstsq(design, np.log(ratio), rcond=None)
    left = np.log(ratio) - design @ (level, slope)
    scatter = float(np.sqrt((left**2).sum() / (len(left) - 2)))
    level_sigma = float(np.hypot(FLICKER * np.sqrt(2.0), scatter / np.sqrt(len(left))))
    slope_sigma = scatter / float(np.sqrt((inverse**2).sum()))
    brightness, colour = float(np.exp(level)), float(np.exp(slope))
    return PictureChange(
        Measured(brightness, brightness * level_sigma),
        Measured(colour, colour * slope_sigma),
        _shift_nm(*strips, float(np.ptp(nm)), width),
        nm[lit],
        np.expm1(left),
    )


def _shift_nm(before: Strip, now: Strip, span_nm: float, width: float) -> Measured:
    """Return the larger shift of the strip's two ends along it."""
    length = before.right[0] - before.left[0]
    shift = max((end_now[0] - end_before[0] for end_before, end_now in _ends(before, now)), key=abs)
    sigma_pixels = EDGE_PIXELS * np.sqrt(2.0)
    nm_of_frame = span_nm / length
    return Measured(float(shift * nm_of_frame), float(sigma_pixels / width * nm_of_frame))


def _ends(before: Strip, now: Strip) -> tuple[tuple[tuple[float, float], tuple[float, float]], ...]:
    return (before.left, now.left), (before.right, now.right)
