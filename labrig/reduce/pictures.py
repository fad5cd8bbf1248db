"""RAW frames binned to small pictures."""

import numpy as np
from numpy.typing import NDArray

from labrig.reduce.frame import cell_means_dn
from labrig.reduce.raw import RawFrame

Picture = NDArray[np.float32]

JPEG_QUALITY = 88


def is_grey(raw: RawFrame) -> bool:
    """Whether the sensor knows no colours."""
    return len(raw.channels) == 1


def binned(raw: RawFrame) -> Picture:
    """R, G, B of every cell above black, 1 = saturated; (height / 2, width / 2, 3) of Bayer."""
    picture = cell_means_dn(raw) / np.float32(raw.white - max(raw.black))
    return np.repeat(picture, 3, axis=-1) if is_grey(raw) else picture


def small(picture: Picture, width: int) -> Picture:
    """Averaged down to `width` or a little less; never enlarged."""
    import cv2  # takes a tenth of a second to load

    height_in, width_in = picture.shape[:2]
    if width_in <= width:
        return picture
    size = (width, max(1, round(height_in * width / width_in)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))


def jpeg(rgb: NDArray[np.uint8]) -> bytes:
    """A JPEG file of (height, width, 3)."""
    import cv2

    good, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not good:
        raise RuntimeError("OpenCV could not encode a JPEG")
    return data.tobytes()
