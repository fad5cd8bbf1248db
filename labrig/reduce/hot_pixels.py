"""Hot pixels of the sensor: those that are bright in the dark."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import DataError
from labrig.reduce.dark import SAME_EXPOSURE
from labrig.reduce.raw import RawFrame
from labrig.reduce.region_levels import OUTLIER_SIGMAS, PixelMask
from labrig.reduce.saturation import histogram
from labrig.reduce.workers.reduction import Exposure, reduce_frames

#: Frames in which a hot pixel is bright: a cosmic ray does not hit the same pixel twice.
HOT_FRAMES = 2
#: Most dark frames in which hot pixels are searched; reading more takes time.
_MAX_FRAMES = 5


@dataclass(frozen=True, eq=False)
class HotPixels:
    """Hot pixels of a sensor by their places, few numbers compared with a mask.

    Attributes
    ----------
    height, width
        Size of the frame in pixels.
    places
        Places of the hot pixels in a frame that is read row by row, rising.
    """

    height: int
    width: int
    places: npt.NDArray[np.int64]

    @classmethod
    def of(cls, mask: PixelMask) -> Self:
        """Return the hot pixels that a mask of shape (height, width) marks."""
        height, width = mask.shape
        return cls(height, width, np.flatnonzero(mask).astype(np.int64))

    @property
    def mask(self) -> PixelMask:
        """True where a pixel is hot, shape (height, width)."""
        mask = np.zeros(self.height * self.width, np.bool_)
        mask[self.places] = True
        return mask.reshape(self.height, self.width)


@dataclass(frozen=True)
class BrightPixels:
    """Search of one dark frame for pixels far above the median of their surroundings."""

    def __call__(self, frames: Iterator[RawFrame]) -> "BrightPlaces":
        """Return the bright pixels of the frame."""
        dark = next(frames)
        return BrightPlaces(HotPixels.of(_bright(dark)), dark.cfa)


@dataclass(frozen=True, eq=False)
class BrightPlaces:
    """Bright pixels of one dark frame.

    Attributes
    ----------
    pixels
        The pixels.
    cfa
        Colour filter array, as in `RawFrame`.
    """

    pixels: HotPixels
    cfa: str

    @property
    def kind(self) -> tuple[int, int, str]:
        """Height, width and colours, which frames of one sensor have in common."""
        return self.pixels.height, self.pixels.width, self.cfa


def hot_pixels(darks: Sequence[RawFrame]) -> PixelMask:
    """Find the pixels of the sensor that are bright in the dark.

    A pixel is hot if it exceeds the median of the 24 nearest pixels of its CFA position by more
    than 8 robust standard deviations in two frames.

    Parameters
    ----------
    darks
        Two or more dark frames, best those of the longest exposure.

    Returns
    -------
    ndarray of bool
        True where a pixel is hot, shape (height, width).

    Raises
    ------
    DataError
        There are fewer than two frames, or frames of different sizes or sensors.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import hot_pixels
    >>> run = labrig.read_run("runs/decay")
    >>> longest = run.frames("dark")[-4:]
    >>> mask = hot_pixels([labrig.read_raw(frame.path) for frame in longest])
    >>> mask.shape, int(mask.sum())
    ((64, 96), 1)
    """
    return _bright_in_several([BrightPixels()(iter((dark,))) for dark in darks]).mask


def hot_pixels_of(darks: Sequence[Exposure]) -> HotPixels | None:
    """Find the hot pixels in some of the longest dark frames on disk.

    Parameters
    ----------
    darks
        Dark frames of any exposure.

    Returns
    -------
    HotPixels or None
        The hot pixels; None if there are too few frames to tell them from cosmic rays.

    Raises
    ------
    DataError
        The frames are of different sizes or sensors, or one is damaged.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import SeriesFrame, hot_pixels_of
    >>> run = labrig.read_run("runs/decay")
    >>> darks = [SeriesFrame(dark.path, 0.0, dark.exposure_s) for dark in run.frames("dark")]
    >>> hot = hot_pixels_of(darks)
    >>> hot.places.size, hot.mask.shape
    (1, (64, 96))
    """
    longest_s = max((dark.exposure_s for dark in darks), default=0.0)
    longest = [dark for dark in darks if dark.exposure_s >= longest_s * (1 - SAME_EXPOSURE)]
    if len(longest) < HOT_FRAMES:
        return None
    return _bright_in_several(reduce_frames(longest[:_MAX_FRAMES], BrightPixels()))


def _bright_in_several(darks: Sequence[BrightPlaces]) -> HotPixels:
    if len(darks) < HOT_FRAMES:
        raise DataError(
            f"expected {HOT_FRAMES} or more dark frames to separate hot pixels from cosmic rays, "
            "got "
            f"{len(darks)}; take more"
        )
    kinds = {dark.kind for dark in darks}
    if len(kinds) > 1:
        raise DataError(
            f"expected dark frames of one size and sensor, got {sorted(kinds)}; leave some out"
        )
    places, times_bright = np.unique(
        np.concatenate([dark.pixels.places for dark in darks]), return_counts=True
    )
    first = darks[0].pixels
    return HotPixels(first.height, first.width, places[times_bright >= HOT_FRAMES])


def _bright(dark: RawFrame) -> PixelMask:
    """Mark the pixels far above the median of their surroundings."""
    import cv2  # its median filter is the fast one

    side = dark.cfa_side
    bright = np.zeros(dark.mosaic.shape, bool)
    for row in range(side):
        for column in range(side):
            position = (slice(row, None, side), slice(column, None, side))
            plane = np.ascontiguousarray(dark.mosaic[position])
            median = cv2.medianBlur(plane, 5)
            deviation = 1.4826 * _median(histogram(np.asarray(cv2.absdiff(plane, median))))
            # Whole numbers: a quiet sensor's median deviation may be 0 though it is not silent.
            limit = int(OUTLIER_SIGMAS * max(deviation, _uncut_noise(dark), 1.0))
            bright[position] = np.asarray(cv2.subtract(plane, median)) > limit
    return bright


def _uncut_noise(dark: RawFrame) -> float:
    """Return the read noise in DN that the median does not see where half of it is cut off."""
    return 0.0 if dark.cut_off is None else dark.cut_off.read_dn


def _median(counts: npt.NDArray[np.int64]) -> float:
    """Return the median of the whole numbers 0, 1, … that occur `counts` times."""
    up_to = np.cumsum(counts)
    middle = np.searchsorted(up_to, [(up_to[-1] + 1) // 2, up_to[-1] // 2 + 1])
    return float(middle.mean())
