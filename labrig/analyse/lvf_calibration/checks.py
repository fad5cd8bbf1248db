"""What a run's pictures are held against while the bench is still as it was photographed."""

from collections.abc import Sequence

import numpy as np

from labrig.analyse.lvf_calibration.finder import find_strip
from labrig.analyse.lvf_calibration.lines import strip_lines, told
from labrig.analyse.lvf_calibration.picture import Photograph, read_picture
from labrig.analyse.lvf_calibration.profile import strip_profile

#: Pictures are alike if nearly all of their strips agree to this; two gels do not.
ALIKE = 0.02
_NEARLY_ALL = 90
#: Dimmer than this share of the brightest, a place along the strip says nothing.
_BRIGHT = 0.05


def strip_found(frames: Sequence[Photograph]) -> str:
    """Where the strip is, in words.

    Raises
    ------
    DataError
        As `find_strip`.
    """
    found = find_strip(read_picture(frames))
    return f"{found.length:.0f} x {found.height:.0f} pixels, tilted by {found.tilt_degrees:+.1f}°"


def lines_found(
    frames: Sequence[Photograph], of_strip: Sequence[Photograph], rising: bool | None
) -> str:
    """Which lines are seen, in words.

    Raises
    ------
    FitError
        As `strip_lines`: none are, or the filter is the wrong way round.
    """
    strip = find_strip(read_picture(of_strip)).strip(rising=True)
    return told(strip_lines(read_picture(frames), strip, rising).lines)


def look_alike(
    frames: Sequence[Photograph], others: Sequence[Photograph], of_strip: Sequence[Photograph]
) -> bool:
    """Whether a strip looks the same in two sets of pictures, brightness included."""
    strip = find_strip(read_picture(of_strip)).strip(rising=True)
    one, other = (strip_profile(read_picture(some), strip).value for some in (frames, others))
    bright = other > _BRIGHT * other.max(axis=0)
    apart = np.abs(one[bright] / other[bright] - 1)
    return bool(np.percentile(apart, _NEARLY_ALL) < ALIKE)
