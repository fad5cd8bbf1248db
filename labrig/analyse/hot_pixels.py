"""The hot pixels of a run, from the longest of its dark frames."""

from collections.abc import Sequence

from labrig.reduce import PixelMask, SeriesFrame, hot_pixels, read_raw

#: As many tell; reading more takes time.
ENOUGH = 5


def hot_pixels_of(darks: Sequence[SeriesFrame]) -> PixelMask | None:
    """Pixels that are bright in the dark; None where there are too few frames to tell."""
    longest_s = max((dark.exposure_s for dark in darks), default=0.0)
    longest = [dark for dark in darks if dark.exposure_s == longest_s]
    if len(longest) < 2:
        return None
    return hot_pixels([read_raw(dark.path) for dark in longest[:ENOUGH]])
