"""Small pictures of frames on disk, and how much of a frame is saturated."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.reduce.frame import LinearFrame, saturated_cells
from labrig.reduce.pictures import binned, is_grey, small
from labrig.reduce.raw import RawFrame


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """A small picture of a frame.

    Attributes
    ----------
    rgb
        R, G and B above black as fractions of the saturation level, shape (rows, columns, 3). Half
        precision, 11 bits at any brightness, is finer than what a screen shows.
    is_saturated
        Whether most cells in each pixel are saturated, shape (rows, columns).
    is_grey
        Whether the sensor is monochrome.
    width, height
        Size of the frame in pixels.
    make, model
        Camera by EXIF; None where absent.
    """

    rgb: NDArray[np.float16]
    is_saturated: NDArray[np.bool_]
    is_grey: bool
    width: int
    height: int
    make: str | None
    model: str | None


@dataclass(frozen=True)
class MakeThumbnail:
    """Averaging of a frame to a small picture.

    Attributes
    ----------
    columns
        Width of the picture in pixels.
    """

    columns: int

    def __call__(self, frames: Iterator[RawFrame]) -> Thumbnail:
        """Average the frame to a small picture."""
        raw = next(frames)
        return Thumbnail(
            small(binned(raw), self.columns).astype(np.float16),
            small(saturated_cells(raw).astype(np.float32), self.columns) > 0.5,
            is_grey(raw),
            raw.width,
            raw.height,
            raw.make,
            raw.model,
        )


@dataclass(frozen=True)
class SaturatedFraction:
    """Count of the saturated pixels of a frame."""

    def __call__(self, frames: Iterator[RawFrame]) -> float:
        """Return the fraction of the frame's pixels that are saturated."""
        return float(LinearFrame(next(frames)).is_saturated().mean())
