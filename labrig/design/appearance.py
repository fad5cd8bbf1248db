"""How different two glows look."""

import numpy as np

from labrig.design.smooth_spectrum import XYZ_OF_RGB
from labrig.foundation.arrays import FloatArray
from labrig.material import REFERENCE_Y
from labrig.optics import CIE_1931, delta_e, lab, observer, white_xyz


def key_differences(
    wanted_rgb: FloatArray, got_rgb: FloatArray, luminance: FloatArray
) -> FloatArray:
    """Return colour differences of glows, each judged by an eye that is used to its brightness.

    Both are scaled so that what is wanted has half the luminance of a white under D65, so that a
    faint glow counts as much as a bright one.

    Parameters
    ----------
    wanted_rgb, got_rgb
        Linear sRGB, shape (n, 3).
    luminance
        Luminance of what is wanted, above 0 for black as well, shape (n,).

    Returns
    -------
    ndarray
        ΔE2000, shape (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import key_differences
    >>> wanted = np.array([[0.0, 0.1, 0.0], [0.0, 0.001, 0.0]])
    >>> key_differences(wanted, 1.02 * wanted, luminance=wanted[:, 1] * 0.7152).round(2).tolist()
    [0.46, 0.46]
    """
    scale = (REFERENCE_Y / luminance)[:, np.newaxis]
    white = white_xyz("D65", observer(CIE_1931))
    first, second = (lab(scale * rgb @ XYZ_OF_RGB.T, white) for rgb in (wanted_rgb, got_rgb))
    return np.atleast_1d(delta_e(first, second))
