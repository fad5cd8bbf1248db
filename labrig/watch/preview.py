"""One frame at a glance: its patches' values and a small picture, in a fraction of a second."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.reduce import binned, measure, read_raw, small
from labrig.region import Region

#: Brought to full brightness: this quantile of the pixels, so that hot ones do not decide.
BRIGHT_QUANTILE = 0.995
#: Noise brightened more than this tells nothing.
MOST_BRIGHTENED = 4096.0
GAMMA = 2.2


@dataclass(frozen=True)
class Preview:
    """What a frame shows.

    Attributes
    ----------
    values
        Patch → channel → mean in DN above the file's black; nothing else is subtracted.
    clipped
        Patches that are.
    picture
        (height, width, 3), brightened by `brightened`; in the camera's own colours.
    """

    values: Mapping[str, Mapping[str, float]]
    clipped: tuple[str, ...]
    picture: NDArray[np.uint8]
    brightened: float


def glance(path: Path, patches: Mapping[str, Region], width: int) -> Preview:
    """Look at the frame at `path`; the picture is `width` pixels wide at most.

    Raises
    ------
    FrameError
        The frame cannot be read.
    UsageError
        A patch lies outside it.
    """
    raw = read_raw(path)
    measured = {name: measure(raw, region) for name, region in patches.items()}
    linear = np.clip(small(binned(raw), width), 0.0, None)
    level = float(np.quantile(linear.max(axis=-1), BRIGHT_QUANTILE))
    brightened = min(1 / max(level, 1e-9), MOST_BRIGHTENED)
    shown = 255 * np.clip(linear * brightened, 0.0, 1.0) ** (1 / GAMMA)
    return Preview(
        values={
            name: {channel: stats.mean for channel, stats in one.channels.items()}
            for name, one in measured.items()
        },
        clipped=tuple(name for name, one in measured.items() if one.clipped),
        picture=shown.round().astype(np.uint8),
        brightened=float(f"{brightened:.2g}"),
    )
