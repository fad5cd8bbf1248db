"""Oklab, the perceptual colour space in which colours of one hue mix without a change of it."""

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Linear sRGB to cone responses, and these to Oklab (Ottosson 2020, "A perceptual color space for
#: image processing").
_TO_CONES = np.array(
    [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
     [0.0883024619, 0.2817188376, 0.6299787005]]
)  # fmt: skip
_TO_OKLAB = np.array(
    [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
     [0.0259040371, 0.7827717662, -0.8086757660]]
)  # fmt: skip


def oklab(linear: FloatArray) -> FloatArray:
    """Return the coordinates in Oklab of linear sRGB.

    Parameters
    ----------
    linear
        Linear sRGB, shape (…, 3).

    Returns
    -------
    ndarray
        Lightness L, 1 for white, and a and b, shape (…, 3).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import oklab
    >>> oklab(np.array([1.0, 0.0, 0.0])).round(3).tolist()
    [0.628, 0.225, 0.126]
    """
    return np.asarray(np.cbrt(linear @ _TO_CONES.T) @ _TO_OKLAB.T)


def from_oklab(lab: FloatArray) -> FloatArray:
    """Return linear sRGB of coordinates in Oklab.

    Parameters
    ----------
    lab
        L, a and b, shape (…, 3).

    Returns
    -------
    ndarray
        Linear sRGB, outside of 0 to 1 for colours out of gamut, shape (…, 3).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import from_oklab, oklab
    >>> from_oklab(oklab(np.array([0.1, 0.5, 0.9]))).round(6).tolist()
    [0.1, 0.5, 0.9]
    """
    return np.asarray((lab @ np.linalg.inv(_TO_OKLAB).T) ** 3 @ np.linalg.inv(_TO_CONES).T)
