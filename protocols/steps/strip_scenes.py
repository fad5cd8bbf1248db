"""The strip of the variable filter under a halogen lamp, and checks while it lies there."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from labrig.acquire import Session
from labrig.optics import Strip
from labrig.reduce import Exposure, find_strip, read_hdr_frame, strip_profile
from labrig.results import StripProfile

from .bracketing import SceneUnit


class LvfFrames(StrEnum):
    """Roles of frames of card, strip before camera and on sample, mercury lines and stripes."""

    CARD = "lvf-card"
    FILTER = "lvf-filter"
    STRIP_ON_SAMPLE = "lvf-strip-on-sample"
    LINES = "lvf-lines"
    LINES_ON_SAMPLE = "lvf-lines-on-sample"
    STRIPES = "lvf-stripes"


#: Name of the unit without a colour filter.
NO_FILTER = "none"


def filter_unit(name: str | None) -> str:
    """Return the name of the unit of a colour filter."""
    return f"filter-{name or NO_FILTER}"


@dataclass(frozen=True)
class StripUnit(SceneUnit):
    """The strip under a halogen lamp, before the camera or on the sample."""

    def check(self, session: Session) -> None:
        """Check that the strip is visible, whole and straight."""
        session.decide("strip", lambda: strip_found(self.own(session)), when_planned="found")


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
    # Takes a while to load, and plans do without.
    from labrig.fit.lvf import locate_lines

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
