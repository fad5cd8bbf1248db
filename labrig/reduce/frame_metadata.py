"""Metadata of frames on disk without their pixels: EXIF, size and colours of the sensor."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import open_regular
from labrig.foundation.region import Region, region_pixels
from labrig.record import FRAMES
from labrig.reduce.dng import channels_of, side_of
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import Exif, RawFrame, read_exif
from labrig.reduce.workers.kept import ReductionCache, decoded, encoded
from labrig.reduce.workers.reduction import StoredFrame, reduce_frames


@dataclass(frozen=True)
class ReadExif:
    """Reading of EXIF alone, without the picture."""


def frames_exif(frames: Sequence[StoredFrame]) -> list[Exif]:
    """Return the EXIF of frames; of a frame that cannot be read or has none, nothing is in it.

    Parameters
    ----------
    frames
        Frames on disk.

    Returns
    -------
    list of Exif
        Settings, camera and time of each frame.

    Examples
    --------
    >>> import labrig
    >>> from labrig.reduce import frames_exif
    >>> glow = labrig.read_run("runs/decay").frames("decay")
    >>> [exif.exposure_s for exif in frames_exif(glow[:2])]
    [0.5, 0.5]
    """
    folders = {frame.path.parent.parent for frame in frames if frame.path.parent.name == FRAMES}
    kept = {folder: ReductionCache(folder, ReadExif()) for folder in folders}
    read = [_exif(frame, kept.get(frame.path.parent.parent)) for frame in frames]
    for reductions in kept.values():
        reductions.write()
    return read


def _exif(frame: StoredFrame, kept: ReductionCache | None) -> Exif:
    text = kept.get(frame.sha256) if kept and frame.sha256 else None
    if text is not None:
        with suppress(ValueError):
            exif: Exif = decoded(text, Exif)
            return exif
    try:
        with open_regular(frame.path) as file:
            exif = read_exif(file)
    except (UsageError, OSError):
        return Exif()
    if kept and frame.sha256:
        kept.add(frame.sha256, encoded(exif))
    return exif


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
