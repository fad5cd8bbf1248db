"""Size and colours of a sensor, without the pixels of a frame."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labrig.foundation.region import Region, region_pixels
from labrig.reduce.dng import channels_of, side_of
from labrig.reduce.frame_reduction import StoredFrame, reduce_frames
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import RawFrame


@dataclass(frozen=True)
class SensorLayout:
    """Size and colours of a sensor.

    Attributes
    ----------
    width, height
        Size of the frame in pixels.
    cfa
        Colour filter array, as in `RawFrame`.
    """

    width: int
    height: int
    cfa: str

    @property
    def cfa_side(self) -> int:
        """Period of `cfa` in pixels, down and across."""
        return side_of(self.cfa)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels: R, G and B, or L."""
        return channels_of(self.cfa)

    def middle_columns(self, region: Region) -> Floats:
        """Return the mean column of each channel's pixels, shape (C,); pixel centres are at .5."""
        first, weights = self.column_weights(region)
        return np.asarray(weights @ (first + np.arange(weights.shape[1]) + 0.5))

    def column_weights(self, region: Region) -> tuple[int, Floats]:
        """Return the first column of a region, and the weight of each in a channel's mean, (C, w).

        Some of a cell's colours lie in some columns only.
        """
        x, y, width, height = region_pixels(region, self.width, self.height)
        side, channels = self.cfa_side, self.channels
        pixels = np.zeros((len(channels), width))
        for row, column in np.ndindex(side, side):
            letter = self.cfa[side * ((y + row) % side) + (x + column) % side]
            pixels[channels.index(letter), column::side] += len(range(row, height, side))
        return x, pixels / pixels.sum(axis=1, keepdims=True)


@dataclass(frozen=True)
class ReadLayout:
    """Reading of a frame for the layout of its sensor alone."""

    def __call__(self, frames: Iterator[RawFrame]) -> SensorLayout:
        """Return the layout of the frame's sensor."""
        raw = next(frames)
        return SensorLayout(raw.width, raw.height, raw.cfa)


def sensor_layout(frame: StoredFrame) -> SensorLayout:
    """Read the layout of the sensor from a frame on disk.

    Parameters
    ----------
    frame
        Any frame of the camera.

    Returns
    -------
    SensorLayout
        Size and colours of the sensor.

    Raises
    ------
    FrameError
        The file is no RAW file, or is damaged.
    UsageError, DiskError
        The file cannot be read.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import sensor_layout
    >>> sensor_layout(labrig.read_run("runs/decay").frames("decay")[0])
    SensorLayout(width=96, height=64, cfa='RGGB')
    """
    return reduce_frames([frame], ReadLayout())[0]
