"""Metering: from the frames of a metering unit to the shutter times of a decay."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np

from labrig.acquire import CameraCapabilities
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import Region
from labrig.record import FrameRecord
from labrig.reduce import ChannelStats, FrameMeasurement, measure, measure_regions, read_raw

#: Fraction of the range between black and white that the brightest frame may fill. The rest is room
#: for a longer charge, the lamp's drift and the shutter's flicker.
TARGET = 0.4
#: Shutter times of a metering's first frames, as fractions of the longest.
LADDER: tuple[float, ...] = (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1)
SEEN_DN = 2.0
#: Fraction of the range below which the longest exposure is dominated by noise.
DIM = 0.002


def glow(path: Path, region: Region) -> float:
    """Return the mean black-subtracted value of the brightest channel in `region`, in DN."""
    return max(channel.mean for channel in measure(read_raw(path), region).channels.values())


@dataclass(frozen=True)
class Schedule:
    """Start of each frame of a decay in seconds after lamp off, and its shutter time in seconds."""

    times_s: tuple[float, ...]
    exposures_s: tuple[float, ...]

    @classmethod
    def constant(cls, times_s: Sequence[float], exposure_s: float) -> Self:
        """Return a schedule with the same shutter time throughout."""
        return cls(tuple(times_s), (exposure_s,) * len(times_s))

    def frames(self) -> Iterator[tuple[float, float]]:
        """Return begin and shutter time of each frame."""
        return zip(self.times_s, self.exposures_s, strict=True)

    def __str__(self) -> str:
        shortest, longest = (duration_text(f(self.exposures_s)) for f in (min, max))
        return shortest if shortest == longest else f"{shortest} to {longest}"


@dataclass(frozen=True)
class MeteringFrame:
    """A frame of a metering unit, measured in every patch; the zero of `start_s` is arbitrary."""

    start_s: float
    exposure_s: float
    patches: Sequence[FrameMeasurement]


def measure_frame(frame: FrameRecord, regions: Sequence[Region]) -> MeteringFrame:
    """Measure a frame in every region, once however many decisions need it."""
    return _measure_frame(frame, tuple(regions))


@lru_cache(maxsize=1000)
def _measure_frame(frame: FrameRecord, regions: tuple[Region, ...]) -> MeteringFrame:
    # Places of a strip are many, which take hardly longer together than one.
    patches = measure_regions(read_raw(frame.path), regions, outliers=True)
    return MeteringFrame(frame.start_time, frame.exposure_s, patches)


@dataclass(frozen=True)
class _Reading:
    """One frame in which the glow is detected and nothing clips."""

    time_s: float
    rate_dn_per_s: float
    mean_dn: float
    peak_dn: float


class DecayMeter:
    """The glow after lamp off, from the frames of a metering unit.

    Parameters
    ----------
    metering
        Frames of the unit, in order; the first one begins when a decay's first one does. In each
        the brightest patch decides.
    """

    def __init__(self, metering: Sequence[MeteringFrame]) -> None:
        self._range_dn = math.inf
        self._readings: list[_Reading] = []
        self._shortest_clipped = False
        for frame in metering:
            self._range_dn = min(self._range_dn, frame.patches[0].range_dn)
            channels = [channel for patch in frame.patches for channel in patch.channels.values()]
            self._take(frame.start_s - metering[0].start_s, frame.exposure_s, channels)

    def _take(self, time_s: float, exposure_s: float, channels: list[ChannelStats]) -> None:
        if any(channel.clipped for channel in channels):
            self._shortest_clipped |= not self._readings
            return
        brightest = max(channels, key=lambda channel: channel.mean)
        if brightest.mean > max(DETECTION_SIGMA * brightest.sigma, SEEN_DN):
            rate = brightest.mean / exposure_s
            self._readings.append(_Reading(time_s, rate, brightest.mean, brightest.peak))

    def schedule(
        self,
        times_s: Sequence[float],
        capabilities: CameraCapabilities,
        longest_s: float,
        growth: float,
        warn: Callable[[str], None],
    ) -> Schedule:
        """Return a shutter time for each frame, at most `growth` times the first one.

        Parameters
        ----------
        times_s
            Start of each frame in seconds after lamp off.
        capabilities
            Exposure settings that the camera offers.
        longest_s
            Longest shutter time in seconds.
        growth
            Largest ratio of a shutter time to the first one.
        warn
            Function that receives a warning when the glow is too bright or too dim.
        """
        if not self._readings:
            if self._shortest_clipped:
                warn("even the shortest exposure clips; lower camera.iso or close the aperture")
                return Schedule.constant(times_s, capabilities.exposures_s[0])
            warn("no glow was seen while metering; raise camera.iso or open the aperture")
            return Schedule.constant(times_s, longest_s)
        rates = self._peak_rates(np.asarray(times_s) - times_s[0])
        target_s = TARGET * self._range_dn / rates
        first_s = capabilities.exposure_at_most(min(float(target_s[0]), longest_s))
        if rates[0] * first_s < DIM * self._range_dn:
            warn("the glow is very dim at these settings; raise camera.iso or open the aperture")
        limit_s = min(first_s * growth, longest_s)
        exposures_s = (
            max(first_s, capabilities.exposure_at_most(min(float(exposure_s), limit_s)))
            for exposure_s in target_s
        )
        return Schedule(tuple(times_s), tuple(exposures_s))

    def _peak_rates(self, times_s: FloatArray) -> FloatArray:
        """Return the rate of the brightest pixels in DN/s at times after the first frame.

        Log-linear between readings; before the first reading the glow was brighter, so the slope of
        the first two is extrapolated. The ratio of the brightest pixels to the mean is taken from
        the reading with most counts: in dim ones it is noise.
        """
        reading_s = np.array([reading.time_s for reading in self._readings])
        log_rate = np.log([reading.rate_dn_per_s for reading in self._readings])
        rates = np.interp(times_s, reading_s, log_rate)
        if len(reading_s) > 1:
            slope = min((log_rate[1] - log_rate[0]) / (reading_s[1] - reading_s[0]), 0.0)
            is_early = times_s < reading_s[0]
            rates[is_early] = log_rate[0] + slope * (times_s[is_early] - reading_s[0])
        fullest = max(self._readings, key=lambda reading: reading.mean_dn)
        return np.exp(rates) * fullest.peak_dn / fullest.mean_dn
