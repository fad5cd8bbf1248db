"""Conversion of a camera's raw values to colours on a screen."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import rounded
from labrig.optics import (
    CIE_1931,
    XYZ_TO_SRGB,
    CameraResponse,
    Observer,
    observer,
    srgb_bytes,
)
from labrig.results import Series

#: Colour temperature in K of a tungsten halogen lamp, the usual lamp for charging.
HALOGEN_K = 3200.0
#: Second radiation constant of Planck's law in nm K.
SECOND_RADIATION_NM_K = 1.438777e7


@dataclass(frozen=True, eq=False)
class Screen:
    """Matrices from raw linear (R, G, B) of one camera to linear sRGB.

    Attributes
    ----------
    glow
        Matrix for light that the sample emits, shape (3, 3); it has no white balance, so that
        daylight would be white.
    lamp_lit
        Matrix for surfaces lit by a halogen lamp, shape (3, 3); it is white balanced: a white
        surface whose highest raw value is 1 becomes (1, 1, 1).
    known
        Whether the camera's sensitivity is known; if not, raw values are shown as they are.
    """

    glow: FloatArray
    lamp_lit: FloatArray
    known: bool


def screen_for(camera: CameraResponse | None) -> Screen:
    """Return the matrices for a camera; unit matrices if its responses are not known."""
    if camera is None:
        return Screen(np.eye(3), np.eye(3), known=False)
    glow = XYZ_TO_SRGB @ camera_to_xyz(camera)
    nm = camera.wavelength_nm
    halogen = nm**-5 / np.expm1(SECOND_RADIATION_NM_K / (HALOGEN_K * nm))
    under_lamp = camera.response(halogen)
    equal_energy = camera.response(np.ones_like(camera.wavelength_nm))
    # Von Kries in the camera's own channels, then the colour matrix with its rows scaled to white.
    matrix = glow * (equal_energy / under_lamp * under_lamp.max())
    white = matrix @ (under_lamp / under_lamp.max())
    return Screen(glow, matrix / white[:, np.newaxis], known=True)


def camera_to_xyz(camera: CameraResponse) -> FloatArray:
    """Return the matrix M with CIE 1931 XYZ ≈ M · (R, G, B) of raw linear camera values.

    The colour-matching functions are fitted by the sensitivities in least squares over all
    wavelengths (spectra of any shape are equally likely), under the condition that equal energy is
    reproduced exactly (white-point preserving least squares). The scale is such that the
    equal-energy spectrum that gives the camera's highest channel 1 gives Y = 1.

    Parameters
    ----------
    camera
        Spectral responses of the camera, in the channels R, G, B.

    Returns
    -------
    numpy.ndarray
        Matrix M, shape (3, 3).

    Notes
    -----
    No camera is an observer, so narrow-band light is displaced: for the EOS 5D Mark II the residual
    is 9, 9 and 16 % RMS of x̄, ȳ, z̄; emissions 50-100 nm wide are reproduced within a median ΔE*ab
    of 18, daylight within 1 %. The matrix is good for showing a glow, not for measuring its colour.

    References
    ----------
    Finlayson and Drew, *Color constancy and white-point preserving least squares*,
    J. Imaging Sci. Technol. 41, 1997.

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import camera_to_xyz
    >>> xyz = camera_to_xyz(labrig.read_camera("canon_eos_5d_mark_ii")) @ [0.10, 0.80, 0.50]
    >>> [f"{value:.2f}" for value in xyz]
    ['0.25', '0.58', '0.62']
    """
    step_nm = np.gradient(camera.wavelength_nm)
    target = colour_matching(camera.wavelength_nm)
    weighted = camera.sensitivity.T * step_nm
    gram = weighted @ camera.sensitivity
    fitted = np.linalg.solve(gram, weighted @ target).T
    white, target_white = weighted.sum(axis=1), step_nm @ target
    direction = np.linalg.solve(gram, white)
    matrix = fitted + np.outer(target_white - fitted @ white, direction / (white @ direction))
    return np.asarray(matrix * white.max() / target_white[1])


def colour_matching(wavelength_nm: FloatArray) -> FloatArray:
    """Return x̄, ȳ, z̄ of the CIE 1931 2° observer, shape (n, 3); 0 outside of its table."""
    eye = _eye()
    return np.stack(
        [
            np.interp(wavelength_nm, eye.wavelength_nm, column, left=0.0, right=0.0)
            for column in eye.functions.T
        ],
        axis=1,
    )


@cache
def _eye() -> Observer:
    return observer(CIE_1931)


def spectrum_colour(wavelength_nm: FloatArray, value: FloatArray) -> str:
    """Return the colour of a spectrum (n,) at full brightness, as `#rrggbb` clipped to sRGB."""
    xyz = colour_matching(wavelength_nm).T @ (value * np.gradient(wavelength_nm))
    linear = into_gamut(XYZ_TO_SRGB @ xyz)
    return css_colour(linear / max(float(linear.max()), 1e-12))


def into_gamut(linear: FloatArray) -> FloatArray:
    """Return linear sRGB within the gamut of a screen, with negative values set to 0.

    Mixing with grey of the same luminance would keep the hue of narrow-band light better, but the
    luminance of deep blue is so small, and so uncertain from a camera, that it would turn black.

    Parameters
    ----------
    linear
        Colours in linear sRGB, shape (…, 3).

    Returns
    -------
    numpy.ndarray
        Colours without negative values, shape (…, 3); values above 1 are kept.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.report import into_gamut
    >>> laser_532_nm = np.array([-0.4, 1.0, -0.1])  # greener than a screen can show
    >>> into_gamut(laser_532_nm).tolist()
    [0.0, 1.0, 0.0]
    """
    return np.maximum(linear, 0.0)


def css_colour(linear: FloatArray) -> str:
    """Return a linear sRGB colour as CSS writes it.

    Parameters
    ----------
    linear
        Colour in linear sRGB, shape (3,); values outside of 0 to 1 are clipped.

    Returns
    -------
    str
        Colour with the transfer curve of sRGB, as `#rrggbb`.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.report import css_colour
    >>> css_colour(np.array([0.0, 0.5, 1.0]))  # half the light is more than half the byte
    '#00bcff'
    """
    return "#" + bytes(srgb_bytes(linear)).hex()


#: Number of swatches that fit side by side on a desktop with a legible time below each.
MAX_SWATCHES = 18
#: Signal-to-noise ratio below which no hue is shown.
MIN_FOR_HUE = 5.0
_RGB = ("R", "G", "B")


@dataclass(frozen=True)
class Swatch:
    """Colour of the glow at one time.

    Attributes
    ----------
    time
        Start of the exposure in seconds after lamp off, as text.
    glow
        CSS colour on the scale of all times; black where there is nothing but noise.
    hue
        CSS colour at full brightness; empty where noise hides it.
    measured
        Measured signals as text, such as `R 170, G 4200, B 7700 DN/s`.
    is_brightest
        Whether this is the brightest swatch, which just fills the display.
    """

    time: str
    glow: str
    hue: str
    measured: str
    is_brightest: bool


def swatches(series: Series, screen: Screen) -> tuple[Swatch, ...]:
    """Return swatches of evenly chosen usable frames of the first unit.

    There are none for channels other than R, G, B.
    """
    rows = np.flatnonzero(series.usable & (np.array(series.unit) == series.unit[0]))
    if series.channels != _RGB or not len(rows):
        return ()
    rows = rows[np.argsort(series.t_s[rows], kind="stable")]
    if len(rows) > MAX_SWATCHES:
        rows = rows[np.rint(np.linspace(0, len(rows) - 1, MAX_SWATCHES)).astype(int)]
    values, sigma = series.values[rows], series.sigma[rows]
    linear = into_gamut(values @ screen.glow.T)
    signal_to_noise = np.sqrt(np.sum((values / sigma) ** 2, axis=1))
    # Without a known σ there is no reason to doubt.
    visible = ~(signal_to_noise < MIN_FOR_HUE) & (linear.max(axis=1) > 0)
    linear[~visible] = 0.0
    brightest = linear.max(axis=1)
    full_scale = max(float(brightest.max()), 1e-12)
    return tuple(
        Swatch(
            time=rounded(float(series.t_s[row]), 3),
            glow=css_colour(colour / full_scale),
            hue=css_colour(colour / peak) if is_visible else "",
            measured=_signals_text(series.values[row]),
            is_brightest=peak == full_scale,
        )
        for row, colour, peak, is_visible in zip(rows, linear, brightest, visible, strict=True)
    )


def _signals_text(values: FloatArray) -> str:
    """Return the signals R, G, B in DN/s as text."""
    pairs = zip(_RGB, values, strict=True)
    return ", ".join(f"{name} {rounded(float(value), 3)}" for name, value in pairs) + " DN/s"
