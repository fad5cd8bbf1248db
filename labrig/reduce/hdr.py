"""Several exposures of one scene combined into one frame of larger range."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.reduce.linear_frame import LinearFrame
from labrig.reduce.raw import RawFrame, read_raw
from labrig.reduce.region_levels import PixelMask
from labrig.reduce.workers.reduction import Exposure

Image = NDArray[np.float32]

#: Fraction of the range above which single pixels are left out: noise carries some of those at the
#: same light beyond the range, which `is_clipped` allows a mean over many.
FULL = 0.95
#: Rows that are combined at once, so that only the sums take much memory.
_ROWS_AT_ONCE = 256


@dataclass(frozen=True, eq=False)
class HdrFrame:
    """Undemosaiced frame of combined exposures.

    Attributes
    ----------
    rate
        Signal in DN/s above black, shape (height, width); NaN where all exposures clip, or a pixel
        is hot.
    cfa, cfa_side, channels
        Colour filter array, its period in pixels and its channels, as in `RawFrame`.
    """

    rate: Image
    cfa: str
    cfa_side: int
    channels: tuple[str, ...]

    def light(self) -> Image:
        """Return the mean of the colours about every pixel in DN/s, shape (height, width).

        Pixels that are NaN count as bright.
        """
        import cv2  # plans and lists of runs need no OpenCV

        filled = np.where(np.isnan(self.rate), np.nanmax(self.rate), self.rate)
        size = (max(self.cfa_side, 2),) * 2
        smoothed = cv2.blur(filled.astype(np.float32), size, borderType=cv2.BORDER_REFLECT)
        return np.asarray(cv2.medianBlur(smoothed, 3), dtype=np.float32)


def read_hdr_frame(frames: Iterable[Exposure], hot: PixelMask | None = None) -> HdrFrame:
    """Read several exposures of one scene and combine them into one frame of larger range.

    Parameters
    ----------
    frames
        Frames on disk, with their actual exposure times in seconds.
    hot
        Hot pixels to leave out, shape (height, width); None leaves out none.

    Returns
    -------
    HdrFrame
        Signal of each pixel in DN/s above black, NaN where all exposures clip or the pixel is hot.

    Raises
    ------
    DataError
        There is no frame, or the frames are of different sensors.
    UsageError, FrameError
        A file cannot be read, or is no RAW file of a known sensor.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.reduce import read_hdr_frame
    >>> run = labrig.read_run("runs/decay")
    >>> bracketed = run.frames("meter")
    >>> [f"{frame.exposure_s:.4f} s" for frame in bracketed]
    ['0.0008 s', '0.0062 s', '0.0496 s', '0.3969 s', '3.1748 s']
    >>> hdr = read_hdr_frame(bracketed)
    >>> hdr.rate.shape, f"{np.nanmax(hdr.rate):.2g} DN/s"
    ((64, 96), '3.9e+03 DN/s')
    """
    return hdr_frame(((read_raw(frame.path), frame.exposure_s) for frame in frames), hot)


def hdr_frame(frames: Iterable[tuple[RawFrame, float]], hot: PixelMask | None = None) -> HdrFrame:
    """Combine frames where they do not clip: the sum of their signals over that of their exposures.

    Parameters
    ----------
    frames
        Frames of one scene and their exposure times in seconds.
    hot
        Hot pixels to leave out, shape (height, width).

    Raises
    ------
    DataError
        There is no frame, or the frames are of different sensors.
    """
    counts: FloatArray | None = None
    for raw, exposure_s in frames:
        if counts is None:
            reference, counts = raw, np.zeros(raw.mosaic.shape)
            seconds = np.zeros(raw.mosaic.shape)
        if raw.mosaic.shape != counts.shape or raw.cfa != reference.cfa:
            raise DataError("expected frames of one sensor and size; choose those of one camera")
        for first in range(0, raw.height, _ROWS_AT_ONCE):
            rows = slice(first, min(first + _ROWS_AT_ONCE, raw.height))
            light = LinearFrame(raw).value_dn((0, first, raw.width, rows.stop - first))
            is_unclipped = light < FULL * (raw.white - max(raw.black))
            counts[rows] += np.where(is_unclipped, light, 0.0)
            seconds[rows] += np.where(is_unclipped, exposure_s, 0.0)
    if counts is None:
        raise DataError("expected frames of the strip, got none; take them again")
    if hot is not None:
        seconds[hot] = 0.0
    rate = np.full(counts.shape, np.nan, dtype=np.float32)
    np.divide(counts, seconds, out=rate, where=seconds > 0, casting="same_kind")
    return HdrFrame(rate, reference.cfa, reference.cfa_side, reference.channels)
