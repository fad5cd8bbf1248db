"""The temperature over a run, as its thermometer told it: rates belong to a temperature."""

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from labrig.record.frames import FrameRecord
from labrig.record.reading import RunRecord

FloatArray = NDArray[np.float64]

#: Rates of traps 0.65 eV deep follow exp(−E / kT): 8.7 % for a degree at room temperature.
TRAP_K, ZERO_C_K = 0.65 / 8.617333e-5, 273.15
#: Readings scatter by a tenth of a degree, rooms change slowly.
SMOOTHED_S = 300.0
#: So long after the last reading nobody knows.
KNOWN_FOR_S = 600.0


class Course:
    """The temperature over a run.

    Parameters
    ----------
    run
        With one reading or more.

    Attributes
    ----------
    time, celsius
        (N,) of the readings; seconds since 1970, rising.
    smooth
        (N,) means of the readings within five minutes.
    """

    def __init__(self, run: RunRecord) -> None:
        readings = run.temperatures()
        self.time: FloatArray = np.array([reading.time for reading in readings])
        self.celsius: FloatArray = np.array([reading.temperature_c for reading in readings])
        first = np.searchsorted(self.time, self.time - SMOOTHED_S / 2)
        after = np.searchsorted(self.time, self.time + SMOOTHED_S / 2, side="right")
        total = np.concatenate([[0.0], np.cumsum(self.celsius)])
        self.smooth: FloatArray = (total[after] - total[first]) / (after - first)

    def during(self, frames: Sequence[FrameRecord]) -> FloatArray:
        """At the middle of each frame about whose time something is known."""
        middle = np.array([(frame.start_time + frame.end_time) / 2 for frame in frames])
        known = (middle > self.time[0] - KNOWN_FOR_S) & (middle < self.time[-1] + KNOWN_FOR_S)
        found: FloatArray = np.interp(middle[known], self.time, self.smooth)
        return found


def glow_temperature_c(run: RunRecord, roles: Collection[str]) -> float | None:
    """Mean over the frames of these roles, to a hundredth; None where nothing is known."""
    frames = in_roles(run, roles)
    known = Course(run).during(frames) if run.temperatures() and frames else np.array([])
    return round(float(known.mean()), 2) if known.size else None


def in_roles(run: RunRecord, roles: Collection[str]) -> list[FrameRecord]:
    """The frames of these roles in completed units, by time."""
    return [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.purpose in roles
    ]


def relative_rate_change(from_c: float, to_c: float) -> float:
    """By which part of themselves rates are faster at the second temperature."""
    return math.expm1(TRAP_K * (1 / (from_c + ZERO_C_K) - 1 / (to_c + ZERO_C_K)))


def degrees_text(celsius: FloatArray) -> str:
    """`20.1 °C to 21.4 °C`."""
    return f"{celsius.min():.1f} °C to {celsius.max():.1f} °C"
