"""Location of the lines of a mercury lamp in the profile of a strip, to a fraction of a pixel."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks, peak_widths

from labrig.fit.lvf.line_model import (
    FEWEST_LINES,
    MERCURY,
    Assignment,
    Line,
    LineModel,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import NOMINAL_FWHM_NM
from labrig.results import LocatedLines

#: Smallest prominence in units of the noise.
MIN_PROMINENCE = 10.0
#: Smallest prominence as a fraction of the channel's range, and of the largest range.
MIN_FRACTION, MIN_OF_ALL = 0.03, 0.003
MAX_PEAKS = 8
MAX_SAMPLES = 20_000
#: Distance, in widths, below which peaks of two channels are one.
SAME = 0.5
#: Width of the smoothing as a fraction of the profile.
SMOOTHING = 0.002
#: Median absolute third difference over σ, for normal noise; a smooth profile has hardly any, even
#: if a line is but a few samples wide.
_MAD = 0.6745 * np.sqrt(20.0)


@dataclass(frozen=True)
class Peak:
    """A peak of at least one channel.

    Attributes
    ----------
    position, fwhm
        Position and full width at half maximum, in the unit of the profile's positions.
    prominence
        Prominence in units of the noise.
    blueness
        Fraction of blue in blue and red; 0 without colours.
    """

    position: float
    fwhm: float
    prominence: float
    blueness: float


def find_line_peaks(position: FloatArray, values: FloatArray) -> list[Peak]:
    """Return the most prominent peaks of a profile (n, channels), by rising position.

    They are searched channel by channel: in the sum neighbouring lines merge.
    """
    finest = max(float(np.diff(position).min()), float(np.ptp(position)) / MAX_SAMPLES)
    grid = np.arange(position[0], position[-1], finest)
    channels = np.stack([np.interp(grid, position, column) for column in values.T], axis=1)
    smooth = gaussian_filter1d(channels, len(grid) * SMOOTHING, axis=0)
    noise = np.median(np.abs(np.diff(values, n=3, axis=0)), axis=0) / _MAD
    height = float(np.ptp(smooth, axis=0).max())
    above = np.maximum(smooth - np.percentile(smooth, 5, axis=0), 0.0)
    peaks: list[Peak] = []
    for channel, channel_noise in zip(smooth.T, noise, strict=True):
        unit = max(float(channel_noise), 1e-6 * height)
        extent = float(np.ptp(channel))
        least = max(MIN_PROMINENCE * unit, MIN_FRACTION * extent, MIN_OF_ALL * height)
        if not height:
            continue
        indices, properties = find_peaks(channel, prominence=least)
        widths = peak_widths(channel, indices, rel_height=0.5)[0] * finest
        for number, index in enumerate(indices):
            blue, red = (above[index, -1], above[index, 0]) if values.shape[1] == 3 else (0.0, 1.0)
            peaks.append(
                Peak(
                    position=float(grid[index]),
                    fwhm=float(widths[number]),
                    prominence=float(properties["prominences"][number] / unit),
                    blueness=float(blue / (blue + red)),
                )
            )
    return _distinct(peaks)


def _distinct(peaks: list[Peak]) -> list[Peak]:
    """Return the most prominent one of peaks at the same place in several channels."""
    kept: list[Peak] = []
    for peak in sorted(peaks, key=lambda peak: -peak.prominence):
        if all(abs(peak.position - other.position) > SAME * other.fwhm for other in kept):
            kept.append(peak)
    return sorted(kept[:MAX_PEAKS], key=lambda peak: peak.position)


#: Largest deviation of peaks from an assignment, in widths.
TOLERANCE = 0.4
#: Difference of scores below which assignments are ambiguous, and the number of them fitted.
AMBIGUOUS = 1.0
MAX_CANDIDATES = 4
#: Largest bend of a strip in nm, in its middle against its ends.
MAX_BEND_NM = 20.0
#: Ratio of the unexplained variances at which the better orientation is accepted.
CLEARLY = 1.3


def locate_lines(
    position: ArrayLike,
    profile: ArrayLike,
    *,
    lines: tuple[Line, ...] = MERCURY,
    fwhm_nm: float = NOMINAL_FWHM_NM,
    rising: bool | None = None,
) -> LocatedLines:
    """Assign peaks to lines, then fit all lines at once.

    A blend is the sum of its two lines at their known distance. All lines have the same skewed
    shape, whose width may change linearly along the strip, and lie on a linear background.

    Parameters
    ----------
    position, profile
        Rising positions (n,), and profile (n,) or (n, channels); the colours of R, G and B tell the
        blue end.
    lines
        Lines to find, by rising wavelength.
    fwhm_nm
        Width of a line in nm, to within a factor of two.
    rising
        Whether the wavelength is expected to rise with the position; None accepts both.

    Raises
    ------
    FitError
        There are no such lines, the strip is the wrong way round, or its orientation is ambiguous.
    """
    u = np.asarray(position, dtype=np.float64)
    values = np.asarray(profile, dtype=np.float64).reshape(len(u), -1)
    if not np.isfinite(values).all() or len(u) < 20:
        raise FitError("expected a profile of 20 or more finite values along the strip")
    peaks = find_line_peaks(u, values)
    assignments = [
        trial
        for orientation in (True, False)
        for trial in _assignments(peaks, lines, fwhm_nm, orientation)
    ]
    if not assignments:
        raise FitError(
            f"no lines of mercury: of {len(peaks)} peaks no {FEWEST_LINES} stand like "
            f"{', '.join(f'{line.centre_nm:.0f}' for line in lines)} nm; check that the mercury "
            "lamp is lit and the whole strip in the picture"
        )
    assignments.sort(key=lambda trial: -trial.score)
    candidates = [
        trial
        for trial in assignments[:MAX_CANDIDATES]
        if assignments[0].score - trial.score < AMBIGUOUS
    ]
    located = _best_by_orientation([LineModel(u, values, lines, trial) for trial in candidates])
    if len(located) == 2:
        located.sort(key=lambda orientation: -orientation.explained)
        unexplained = [1 - orientation.explained for orientation in located]
        if unexplained[1] < CLEARLY * unexplained[0] and rising is None:
            raise FitError(
                "the lines fit either way round, and without colours nothing tells which is right; "
                "say whether the wavelength rises along the strip"
            )
        if unexplained[1] < CLEARLY * unexplained[0]:
            located.sort(key=lambda orientation: orientation.rising != rising)
    if rising is not None and located[0].rising != rising:
        raise FitError(
            f"the strip is the wrong way round: the wavelength {'falls' if rising else 'rises'} "
            f"with the position, expected it to {'rise' if rising else 'fall'}; turn the filter, "
            "or say that it is turned"
        )
    return located[0]


def _best_by_orientation(models: list[LineModel]) -> list[LocatedLines]:
    """Return the model that explains most for each orientation, of those that can be fitted."""
    best: dict[bool, LocatedLines] = {}
    refusal: FitError | None = None
    for model in models:
        try:
            located = model.located()
        except FitError as error:
            refusal = refusal or error
            continue
        if _bend_nm(located, model.middle, model.reach) > MAX_BEND_NM:
            refusal = refusal or FitError(
                "no lines of mercury: the peaks could only be lines of a strip bent as none is; "
                "check that no other lamp is lit"
            )
            continue
        if located.rising not in best or located.explained > best[located.rising].explained:
            best[located.rising] = located
    if refusal is not None and not best:
        raise refusal
    return list(best.values())


def _bend_nm(lines: LocatedLines, middle: float, reach: float) -> float:
    """Return the distance of the strip's middle from the line between its ends, in nm."""
    scaled = (lines.position - middle) / reach
    return abs(float(np.polyfit(scaled, lines.wavelength_nm, 2, w=1 / lines.sigma)[0]))


def _assignments(
    peaks: list[Peak], lines: tuple[Line, ...], fwhm_nm: float, rising: bool
) -> list[Assignment]:
    """Return the peaks that agree best with each choice of lines."""
    centres = [line.centre_nm for line in lines]
    assignments: list[Assignment] = []
    for number in range(min(len(lines), len(peaks)), FEWEST_LINES - 1, -1):
        for chosen in combinations(range(len(lines)), number):
            chosen_nm = [centres[k] for k in chosen]
            trials = [
                _assignment(chosen_nm, list(subset), fwhm_nm)
                for subset in combinations(peaks if rising else peaks[::-1], number)
            ]
            possible = [trial for trial in trials if trial is not None]
            if possible:
                assignments.append(max(possible, key=lambda trial: trial.score))
    return assignments


def _assignment(centres_nm: list[float], peaks: list[Peak], fwhm_nm: float) -> Assignment | None:
    positions = np.array([peak.position for peak in peaks])
    slope, offset = np.polyfit(positions, centres_nm, 1)
    width = float(np.median([peak.fwhm for peak in peaks]))
    if not 0.5 < width * abs(slope) / fwhm_nm < 2:
        return None
    worst = float(np.abs(offset + slope * positions - centres_nm).max())
    blueness = [peak.blueness for peak in peaks]
    if worst > TOLERANCE * fwhm_nm or (len(set(blueness)) > 1 and blueness[0] < blueness[-1]):
        return None
    # Strong peaks count, and one more of them outweighs a better agreement.
    strength = sum(np.log1p(peak.prominence) for peak in peaks)
    return Assignment(float(offset), float(slope), width, strength - worst / fwhm_nm)
