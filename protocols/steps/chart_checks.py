"""Checks of frames of a ColorChecker while it still lies there."""

from collections.abc import Sequence

from labrig.record import FrameRecord
from labrig.reduce import find_colour_chart


def chart_found(frames: Sequence[FrameRecord]) -> str:
    """Return where the chart is, in words.

    Raises
    ------
    DataError
        No chart is found, see `find_colour_chart`.
    """
    # The shortest exposure of a bracket is metered: nothing clips.
    metered = min(frames, key=lambda frame: frame.exposure_s)
    patches = find_colour_chart(metered.path)
    middles = [(x + wide / 2, y + high / 2) for x, y, wide, high in patches]
    x, y = (sum(values) / len(values) for values in zip(*middles, strict=True))
    return f"{len(patches)} patches about {x:.0%} across and {y:.0%} down the frame"
