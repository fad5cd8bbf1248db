"""Peaks of a profile along a strip, before anything is known about them."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks, peak_widths

from labrig.fit.least_squares import FloatArray

#: Prominence in units of the noise that is left after smoothing.
LEAST_PROMINENCE = 10.0
#: And as a share of the channel's highest peak, and of the highest of all.
LEAST_SHARE, LEAST_OF_ALL = 0.03, 0.003
MOST_PEAKS = 8
MOST_SAMPLES = 20_000
#: Peaks of two channels this share of their width apart are one.
SAME = 0.5
#: Share of the strip over which noise is smoothed away.
SMOOTHING = 0.002
#: Median absolute third difference over σ, for normal noise; a smooth profile has hardly any, even
#: if a line is but a few samples wide.
_MAD = 0.6745 * np.sqrt(20.0)


@dataclass(frozen=True)
class Peak:
    """A peak of one channel or more.

    Attributes
    ----------
    position, fwhm
        In the unit of the profile's positions.
    prominence
        In units of the noise.
    blueness
        Share of blue in blue and red; 0 without colours.
    """

    position: float
    fwhm: float
    prominence: float
    blueness: float


def find_line_peaks(position: FloatArray, values: FloatArray) -> list[Peak]:
    """The most prominent peaks of a profile (n, channels), by rising position.

    Sought channel by channel: in the sum neighbouring lines run together.
    """
    finest = max(float(np.diff(position).min()), float(np.ptp(position)) / MOST_SAMPLES)
    even = np.arange(position[0], position[-1], finest)
    channels = np.stack([np.interp(even, position, column) for column in values.T], axis=1)
    smooth = gaussian_filter1d(channels, len(even) * SMOOTHING, axis=0)
    noise = np.median(np.abs(np.diff(values, n=3, axis=0)), axis=0) / _MAD
    height = float(np.ptp(smooth, axis=0).max())
    above = np.maximum(smooth - np.percentile(smooth, 5, axis=0), 0.0)
    found: list[Peak] = []
    for channel, own_noise in zip(smooth.T, noise, strict=True):
        unit = max(float(own_noise), 1e-6 * height)
        own = float(np.ptp(channel))
        least = max(LEAST_PROMINENCE * unit, LEAST_SHARE * own, LEAST_OF_ALL * height)
        if not height:
            continue
        indices, properties = find_peaks(channel, prominence=least)
        widths = peak_widths(channel, indices, rel_height=0.5)[0] * finest
        for number, index in enumerate(indices):
            blue, red = (above[index, -1], above[index, 0]) if values.shape[1] == 3 else (0.0, 1.0)
            found.append(
                Peak(
                    position=float(even[index]),
                    fwhm=float(widths[number]),
                    prominence=float(properties["prominences"][number] / unit),
                    blueness=float(blue / (blue + red)),
                )
            )
    return _once_each(found)


def _once_each(found: list[Peak]) -> list[Peak]:
    """Of peaks at the same place in several channels, the most prominent one."""
    kept: list[Peak] = []
    for peak in sorted(found, key=lambda peak: -peak.prominence):
        if all(abs(peak.position - other.position) > SAME * other.fwhm for other in kept):
            kept.append(peak)
    return sorted(kept[:MOST_PEAKS], key=lambda peak: peak.position)
