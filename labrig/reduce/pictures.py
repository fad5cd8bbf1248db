"""RAW frames binned to small pictures."""

import numpy as np
from numpy.typing import NDArray

from labrig.reduce.raw import RawFrame

Picture = NDArray[np.float32]

JPEG_QUALITY = 88


def is_grey(raw: RawFrame) -> bool:
    """Whether the sensor knows no colours."""
    return len(raw.channels) == 1


def _cell(raw: RawFrame) -> int:
    """Side of the cells of the CFA that become a pixel each; 2 if there is no CFA."""
    return max(raw.cfa_side, 2)


def binned(raw: RawFrame) -> Picture:
    """R, G, B of every cell above black, 1 = saturated, shape (height / 2, width / 2, 3) of Bayer.

    Binning and not demosaicing: the picture is shown smaller anyway, and nothing is invented.
    """
    side = _cell(raw)
    rows, columns = raw.height // side, raw.width // side
    picture = np.zeros((rows, columns, 3), np.float32)
    times = side**2 // len(raw.cfa)
    colours, black = raw.cfa * times, raw.black * times
    for position, colour in enumerate(colours):
        y, x = divmod(position, side)
        plane = raw.mosaic[y : side * rows : side, x : side * columns : side]
        scale = 1 / colours.count(colour) / (raw.white - black[position])
        shown = (plane - np.float32(black[position])) * np.float32(scale)
        for channel in range(3) if is_grey(raw) else ["RGB".index(colour)]:
            picture[..., channel] += shown
    return picture


def saturated_cells(raw: RawFrame) -> Picture:
    """1 where one of the pixels of a cell is saturated, else 0."""
    side = _cell(raw)
    rows, columns = raw.height // side, raw.width // side
    cells = (raw.mosaic[: side * rows, : side * columns] >= raw.white).reshape(
        rows, side, columns, side
    )
    return np.asarray(cells.any(axis=(1, 3)), dtype=np.float32)


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
