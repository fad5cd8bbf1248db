"""Exposure and focus of a live picture.

A live picture is an 8-bit JPEG with the camera's tone curve: suited for comparing one moment with
the next, not for photometry.
"""

from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import DeviceError
from labrig.foundation.picture_file import decoded
from labrig.foundation.region import Region, region_pixels

#: Level from which a pixel counts as clipped; JPEG artefacts lower 255 a little next to edges. For
#: display only: clipping of measurements is `labrig.reduce.saturation.is_clipped`.
CLIPPED_FROM = 250
#: Number of bins of the histogram, each two levels wide.
BINS = 128

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class PictureStats:
    """Statistics of one live picture.

    Attributes
    ----------
    width, height
        Size of the live picture in pixels.
    histogram
        Fraction of the pixels in each bin from 0 to 255, for red, green, blue.
    clipped
        Fraction of the pixels at `CLIPPED_FROM` or above, for red, green, blue.
    focus
        Sharpness of the whole picture, see `sharpness`.
    region_focus
        Sharpness of the region; None without a region.
    region_clipped
        Fraction of clipped pixels in the worst channel of the region; None without a region.
    """

    width: int
    height: int
    histogram: tuple[tuple[float, ...], ...]
    clipped: tuple[float, ...]
    focus: float
    region_focus: float | None
    region_clipped: float | None

    def to_json(self) -> dict[str, Any]:
        """Return plain values, with the level from which the page marks clipped pixels."""
        return {**asdict(self), "clipped_from": CLIPPED_FROM}


def decode(jpeg: bytes) -> Picture:
    """Return the pixels R, G, B of a live picture, shape (height, width, 3).

    Raises
    ------
    DeviceError
        If the camera sent something other than a JPEG.
    """
    picture = decoded(jpeg)
    if picture is None:
        raise DeviceError(
            f"expected a JPEG as live picture, got {len(jpeg)} bytes of something else: "
            "switch the camera off and on"
        )
    return picture


def picture_stats(picture: Picture, region: Region | None = None) -> PictureStats:
    """Return histogram, clipping and focus of a picture, and of a region of it.

    Raises
    ------
    UsageError
        If the region exceeds the picture.
    """
    height, width, _ = picture.shape
    inside = None
    if region is not None:
        x, y, wide, high = region_pixels(region, width, height)
        inside = picture[y : y + high, x : x + wide]
    return PictureStats(
        width=width,
        height=height,
        histogram=tuple(_histogram(picture[:, :, channel]) for channel in range(3)),
        clipped=_clipped(picture),
        focus=sharpness(picture),
        region_focus=None if inside is None else sharpness(inside),
        region_clipped=None if inside is None else max(_clipped(inside)),
    )


def sharpness(picture: Picture) -> float:
    """Return the variance of the Laplacian of the luminance over its squared mean, times 1000.

    Higher is sharper. Without the normalisation a brighter picture would count as a sharper one.

    References
    ----------
    Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy" (2000), for the variance of
    the Laplacian as focus measure.
    """
    grey = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY)
    mean = float(grey.mean())
    if mean == 0.0:
        return 0.0
    return 1e3 * float(cv2.Laplacian(grey, cv2.CV_32F).var()) / mean**2


def _histogram(channel: Picture) -> tuple[float, ...]:
    counts = np.bincount(channel.reshape(-1), minlength=256).reshape(BINS, -1).sum(axis=1)
    return tuple((counts / channel.size).round(6).tolist())


def _clipped(picture: Picture) -> tuple[float, ...]:
    return tuple((picture >= CLIPPED_FROM).mean(axis=(0, 1)).round(6).tolist())
