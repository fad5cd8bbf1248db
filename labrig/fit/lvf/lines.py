"""Lines of a mercury lamp in the profile of a strip, to a fraction of a pixel."""

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from labrig.errors import FitError
from labrig.fit.lvf.found_peaks import Peak, find_line_peaks
from labrig.fit.lvf.line_model import (
    FEWEST_LINES,
    MERCURY,
    Assignment,
    Line,
    LineModel,
    LocatedLines,
)
from labrig.optics.lvf import NOMINAL_FWHM_NM

#: Lines of the model agree with what was found to this share of their width.
TOLERANCE = 0.4
#: Ways round whose scores differ by less took the same peaks for lines.
AMBIGUOUS = 1.0
#: Of such two, one is right if the other leaves this many times as much unexplained.
CLEARLY = 1.3


def locate_lines(
    position: ArrayLike,
    profile: ArrayLike,
    *,
    lines: tuple[Line, ...] = MERCURY,
    fwhm_nm: float = NOMINAL_FWHM_NM,
    rising: bool | None = None,
) -> LocatedLines:
    """Find which peaks are which lines, then fit all of them at once.

    A blend is the sum of its two lines at their known distance. All lines have the same skewed
    shape, whose width may change evenly along the strip, and lie on a straight background.

    Parameters
    ----------
    position, profile
        (n,) rising, and (n,) or (n, channels): of R, G and B the colours tell which end is blue.
    lines
        To look for, by rising wavelength.
    fwhm_nm
        Width of a line, to within a factor of two.
    rising
        Which way round the strip is expected to be; None takes it as it is.

    Raises
    ------
    FitError
        No such lines, a strip the wrong way round, or no way to tell which way round it is.
    """
    u = np.asarray(position, dtype=np.float64)
    values = np.asarray(profile, dtype=np.float64).reshape(len(u), -1)
    if not np.isfinite(values).all() or len(u) < 20:
        raise FitError("expected a profile of 20 or more finite values along the strip")
    peaks = find_line_peaks(u, values)
    ways = [_assigned(peaks, lines, fwhm_nm, way) for way in (True, False)]
    found = [way for way in ways if way is not None]
    if not found:
        raise FitError(
            f"no lines of mercury: of {len(peaks)} peaks no {FEWEST_LINES} stand like "
            f"{', '.join(f'{line.centre_nm:.0f}' for line in lines)} nm; check that the mercury "
            "lamp is lit and the whole strip in the picture"
        )
    best = max(found, key=lambda way: way.score)
    rivals = [way for way in found if best.score - way.score < AMBIGUOUS]
    located = [LineModel(u, values, lines, way).located() for way in rivals]
    if len(located) == 2:
        located.sort(key=lambda way: -way.explained)
        left = [1 - way.explained for way in located]
        if left[1] < CLEARLY * left[0] and rising is None:
            raise FitError(
                "the lines fit either way round, and without colours nothing tells which is right; "
                "say whether the wavelength rises along the strip"
            )
        if left[1] < CLEARLY * left[0]:
            located.sort(key=lambda way: way.rising != rising)
    if rising is not None and located[0].rising != rising:
        raise FitError(
            f"the strip is the wrong way round: the wavelength {'falls' if rising else 'rises'} "
            f"with the position, expected it to {'rise' if rising else 'fall'}; turn the filter, "
            "or say that it is turned"
        )
    return located[0]


def _assigned(
    peaks: list[Peak], lines: tuple[Line, ...], fwhm_nm: float, rising: bool
) -> Assignment | None:
    centres = [line.centre_nm for line in lines]
    best: Assignment | None = None
    for number in range(min(len(lines), len(peaks)), FEWEST_LINES - 1, -1):
        for chosen in combinations(range(len(lines)), number):
            for some in combinations(peaks if rising else peaks[::-1], number):
                trial = _tried([centres[k] for k in chosen], list(some), fwhm_nm)
                if trial is not None and (best is None or trial.score > best.score):
                    best = trial
    return best


def _tried(centres_nm: list[float], peaks: list[Peak], fwhm_nm: float) -> Assignment | None:
    at = np.array([peak.position for peak in peaks])
    slope, offset = np.polyfit(at, centres_nm, 1)
    width = float(np.median([peak.fwhm for peak in peaks]))
    if not 0.5 < width * abs(slope) / fwhm_nm < 2:
        return None
    worst = float(np.abs(offset + slope * at - centres_nm).max())
    blueness = [peak.blueness for peak in peaks]
    if worst > TOLERANCE * fwhm_nm or (len(set(blueness)) > 1 and blueness[0] < blueness[-1]):
        return None
    # Strong peaks count, and one more of them outweighs a better agreement.
    strength = sum(np.log1p(peak.prominence) for peak in peaks)
    return Assignment(float(offset), float(slope), width, strength - worst / fwhm_nm)
