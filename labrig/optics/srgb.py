"""sRGB: its primaries and its curve (IEC 61966-2-1)."""

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

#: CIE XYZ, white D65 at Y = 1, to linear sRGB, as the standard rounds it.
XYZ_TO_SRGB = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def srgb_bytes(linear: FloatArray) -> NDArray[np.uint8]:
    """Return linear sRGB as bytes with the curve of IEC 61966-2-1.

    Parameters
    ----------
    linear
        Values, of any shape; those outside of 0 to 1 are clipped.

    Returns
    -------
    ndarray
        Bytes from 0 to 255, of the same shape.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import srgb_bytes
    >>> srgb_bytes(np.array([0.0, 0.18, 0.5, 1.2])).tolist()
    [0, 118, 188, 255]
    """
    linear = np.clip(linear, 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * curve), dtype=np.uint8)
