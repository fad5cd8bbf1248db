"""From a camera's raw values to colours on a screen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.optics import CameraResponse

FloatArray = NDArray[np.float64]
Bytes = NDArray[np.uint8]

#: XYZ (D65) to linear sRGB, IEC 61966-2-1.
_XYZ_TO_SRGB = np.array(
    [
        [3.2406, -1.5372, -0.4986],
        [-0.9689, 1.8758, 0.0415],
        [0.0557, -0.2040, 1.0570],
    ]
)
#: Rec. 709 luminance of linear sRGB.
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
#: Colour temperature of a tungsten halogen lamp, the usual one for charging.
HALOGEN_K = 3200.0
#: Second radiation constant, nm K.
_C2_NM_K = 1.438777e7


@dataclass(frozen=True, eq=False)
class Screen:
    """How raw linear (R, G, B) of one camera become linear sRGB.

    Parameters
    ----------
    glow
        Shape (3, 3), for what shines by itself: no white balance, daylight would be white.
    lamp_lit
        Shape (3, 3), for what a halogen lamp shines on, white balanced: a white surface whose
        highest raw value is 1 comes out as (1, 1, 1).
    known
        Whether the camera's sensitivity is known; if not, raw values are shown as they are.
    """

    glow: FloatArray
    lamp_lit: FloatArray
    known: bool


def screen_for(camera: CameraResponse | None) -> Screen:
    """The way to the screen for a camera."""
    if camera is None:
        return Screen(np.eye(3), np.eye(3), known=False)
    glow = _XYZ_TO_SRGB @ camera.camera_to_xyz()
    halogen = camera.wavelength_nm**-5.0 / np.expm1(_C2_NM_K / HALOGEN_K / camera.wavelength_nm)
    under_lamp = camera.response(halogen)
    equal_energy = camera.response(np.ones_like(camera.wavelength_nm))
    # Von Kries in the camera's own channels, then the colour matrix with its rows scaled to white.
    matrix = glow * (equal_energy / under_lamp * under_lamp.max())
    white = matrix @ (under_lamp / under_lamp.max())
    return Screen(glow, matrix / white[:, np.newaxis], known=True)


def into_gamut(linear: FloatArray) -> FloatArray:
    """Linear sRGB, shape (…, 3), as near as a screen can show it.

    Colours outside are mixed with grey until they are inside. Luminance stays; what is negative in
    all (noise about black) becomes black.
    """
    luminance = np.maximum(linear @ _LUMINANCE, 0.0)[..., np.newaxis]
    lowest = linear.min(axis=-1, keepdims=True)
    share = np.where(lowest < 0, -lowest / np.maximum(luminance - lowest, 1e-12), 0.0)
    mixed: FloatArray = linear + share * (luminance - linear)
    return np.maximum(mixed, 0.0)


def encoded(linear: FloatArray) -> Bytes:
    """Linear sRGB as bytes with sRGB's transfer curve; more than 1 is cut off."""
    clipped = np.clip(linear, 0.0, 1.0)
    curve = np.where(
        clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055
    )
    rounded: Bytes = np.rint(255 * curve).astype(np.uint8)
    return rounded


def css_colour(linear: FloatArray) -> str:
    """One linear sRGB colour as `#rrggbb`."""
    return "#" + bytes(encoded(linear)).hex()
