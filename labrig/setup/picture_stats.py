"""What a live picture says about exposure and focus.

It is an 8-bit JPEG with the camera's own tone curve: good for comparing one moment with the next,
not for measuring light.
"""

from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.errors import DeviceError
from labrig.region import Region, region_pixels

#: A JPEG's 255 rings a little below itself beside an edge. For display only: what a measurement
#: calls clipped is `labrig.reduce.saturation.is_clipped`.
CLIPPED_FROM = 250
#: Bars of the histogram, each two values wide.
BINS = 128

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class PictureStats:
    """Of one live picture.

    Attributes
    ----------
    width, height
        In pixels of the live picture.
    histogram
        Red, green, blue: fraction of the pixels in each bin; the bins span 0 to 255.
    clipped
        Red, green, blue: fraction of the pixels at `CLIPPED_FROM` or above.
    focus
        Of the whole picture, see `sharpness`.
    region_focus, region_clipped
        The same of the region asked for; `None` if none was. `region_clipped` is of the worst
        channel.
    """

    width: int
    height: int
    histogram: tuple[tuple[float, ...], ...]
    clipped: tuple[float, ...]
    focus: float
    region_focus: float | None
    region_clipped: float | None

    def to_json(self) -> dict[str, Any]:
        """As plain values, with what the page needs to mark clipped pixels."""
        return {**asdict(self), "clipped_from": CLIPPED_FROM}


def decode(jpeg: bytes) -> Picture:
    """A live picture's pixels, shape (height, width, 3): R, G, B.

    Raises
    ------
    DeviceError
        The camera sent something that is no JPEG.
    """
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) if jpeg else None
    if picture is None:
        raise DeviceError(
            f"expected a JPEG as live picture, got {len(jpeg)} bytes of something else: "
            "switch the camera off and on"
        )
    rgb: Picture = picture[:, :, ::-1].astype(np.uint8, copy=False)
    return rgb


def picture_stats(picture: Picture, region: Region | None = None) -> PictureStats:
    """Histogram, clipping and focus of a picture, and of a region of it.

    Raises
    ------
    UsageError
        The region leaves the picture.
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
    """Variance of the Laplacian of the luminance over its mean squared, ×1000; higher is sharper.

    Without the division a brighter picture would count as a sharper one. Variance of the Laplacian
    as focus measure: Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy" (2000).
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
