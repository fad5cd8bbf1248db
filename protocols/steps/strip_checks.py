"""Checks of frames of a filter's strip while the bench is still arranged for them."""

from collections.abc import Sequence

import numpy as np

from labrig.fit.lvf import locate_lines
from labrig.optics import Strip
from labrig.reduce import Exposure, find_strip, read_hdr_frame, strip_profile
from labrig.results import StripProfile

#: Percentage of the strip that agrees within this limit in like scenes; two gels do not.
NEARLY_ALL, ALIKE = 90, 0.02
#: Fraction of the brightest place below which a place along the strip is not compared.
BRIGHT = 0.05


def strip_found(frames: Sequence[Exposure]) -> str:
    """Return the place of the strip, in words.

    Raises
    ------
    DataError
        No strip is found, see `find_strip`.
    """
    return str(find_strip(read_hdr_frame(frames)))


def lines_found(
    frames: Sequence[Exposure], strip_frames: Sequence[Exposure], rising: bool | None
) -> str:
    """Return the mercury lines that are found, in words.

    Raises
    ------
    FitError
        No lines are found, or the filter is the wrong way round, see `locate_lines`.
    """
    profile = _profile(frames, _strip(strip_frames))
    return str(locate_lines(profile.position, profile.value_dn_per_s, rising=rising))


def look_alike(
    frames: Sequence[Exposure],
    previous_frames: Sequence[Exposure],
    strip_frames: Sequence[Exposure],
) -> bool:
    """Return whether the strip looks the same in two sets of frames, brightness included."""
    strip = _strip(strip_frames)
    present, previous = (
        _profile(exposures, strip).value_dn_per_s for exposures in (frames, previous_frames)
    )
    bright = previous > BRIGHT * previous.max(axis=0)
    deviation = np.abs(present[bright] / previous[bright] - 1)
    return bool(np.percentile(deviation, NEARLY_ALL) < ALIKE)


def _strip(frames: Sequence[Exposure]) -> Strip:
    return find_strip(read_hdr_frame(frames)).strip(rising=True)


def _profile(frames: Sequence[Exposure], strip: Strip) -> StripProfile:
    return strip_profile(read_hdr_frame(frames), strip)
