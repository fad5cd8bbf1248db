"""Preview of a frame: means of its patches and a small picture, in a fraction of a second."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.region import Region
from labrig.reduce import binned, measure, read_raw, small

#: Quantile of the pixels that becomes full brightness, so that hot pixels have no influence.
BRIGHT_QUANTILE = 0.995
#: Largest factor of brightening; more would only show noise.
MAX_BRIGHTENED = 4096.0
GAMMA = 2.2


@dataclass(frozen=True)
class Preview:
    """Preview of a frame.

    Attributes
    ----------
    values
        Means in DN above black by patch and channel; nothing else is subtracted.
    clipped
        Names of the patches that clip.
    picture
        Picture in the camera's own colours, shape (height, width, 3).
    brightened
        Factor by which the linear values of the picture were multiplied.
    """

    values: Mapping[str, Mapping[str, float]]
    clipped: tuple[str, ...]
    picture: NDArray[np.uint8]
    brightened: float


def glance(path: Path, patches: Mapping[str, Region], width: int) -> Preview:
    """Read the frame at `path`, measure its patches and render it at most `width` pixels wide.

    Raises
    ------
    FrameError
        If the frame cannot be read.
    UsageError
        If a patch lies outside the frame.
    """
    raw = read_raw(path)
    measured = {name: measure(raw, region) for name, region in patches.items()}
    linear = np.clip(small(binned(raw), width), 0.0, None)
    level = float(np.quantile(linear.max(axis=-1), BRIGHT_QUANTILE))
    brightened = min(1 / max(level, 1e-9), MAX_BRIGHTENED)
    picture = 255 * np.clip(linear * brightened, 0.0, 1.0) ** (1 / GAMMA)
    return Preview(
        values={
            name: {channel: stats.mean for channel, stats in measurement.channels.items()}
            for name, measurement in measured.items()
        },
        clipped=tuple(name for name, measurement in measured.items() if measurement.clipped),
        picture=picture.round().astype(np.uint8),
        brightened=float(f"{brightened:.2g}"),
    )
