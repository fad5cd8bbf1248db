"""What the thermometer says of a run: rates of re-radiation belong to a temperature."""

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.history import written_time
from labrig.material import Material, Provenance
from labrig.quantity import duration_text
from labrig.record import FrameRecord, RunRecord
from labrig.report.sections import Section
from labrig.report.temperature import temperature_picture

FloatArray = NDArray[np.float64]

#: Purposes of the frames to whose glow rates are fitted: of decay, and of excitation.
RATE_PURPOSES = ("decay", "strip", "bare")
#: Rates of traps 0.65 eV deep follow exp(−E / kT): 8.7 % for a degree at room temperature.
TRAP_K, ZERO_C_K = 0.65 / 8.617333e-5, 273.15
#: From here on it is said: rates then change by 4 %, more than their usual σ.
MOVED_K = 0.5
#: Readings scatter by a tenth of a degree, rooms change slowly.
SMOOTHED_S = 300.0
#: So long after the last reading nobody knows.
KNOWN_FOR_S = 600.0
CHECK_IT = "check it before the next run (labrig rig check)"


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


def temperature_sections(run: RunRecord) -> tuple[Section, ...]:
    """Picture and words; nothing without a thermometer. Made inside of `figure_style()`."""
    if not run.temperatures():
        return ()
    course, glowing = Course(run), _glowing(run)
    began = run.attempts[0].start["time"]
    spans = [(one[0].start_time, one[-1].end_time) for one in _by_unit(glowing)]
    picture = temperature_picture(
        course.time - began,
        course.celsius,
        course.smooth,
        np.array(spans).reshape(-1, 2) - began,
    )
    text = (
        f"{_degrees(course.smooth)} over the run ({len(course.time)} readings, smoothed over "
        f"{duration_text(SMOOTHED_S)})."
    )
    mean = glow_temperature_c(run)
    if mean is not None:
        text += (
            f" {mean:.1f} °C on average while the glow was photographed: k_r belongs to that "
            f"temperature, and rises by about {100 * _change(mean, mean + 1):.1f} % for a degree "
            "if traps are 0.65 eV deep."
        )
    return (Section("Temperature", (text,), (picture,)),)


def temperature_warnings(run: RunRecord) -> tuple[str, ...]:
    """A temperature that moved while rates were measured, and a thermometer that fell silent."""
    glowing = _glowing(run)
    if not glowing or "thermometer" not in run.attempts[-1].start.get("devices", {}):
        return ()
    if not run.temperatures():
        return (f"the thermometer told nothing: {CHECK_IT}",)
    course, warnings = Course(run), []
    for part, group in groupby(glowing, key=lambda frame: frame.unit.rpartition("/")[0]):
        known = course.during(list(group))
        if known.size and np.ptp(known) >= MOVED_K:
            what = f"the glow of {part}" if part else "the glow"
            warnings.append(
                f"the temperature moved by {np.ptp(known):.1f} K while {what} was photographed "
                f"({_degrees(known)}): k_r changes by about "
                f"{100 * _change(known.min(), known.max()):.0f} % over that, if traps are 0.65 eV "
                "deep; keep the room steadier or measure for a shorter time"
            )
    if glowing[-1].end_time > course.time[-1] + KNOWN_FOR_S:
        warnings.append(
            f"the thermometer told nothing after {written_time(course.time[-1])}: {CHECK_IT}"
        )
    return tuple(warnings)


def glow_temperature_c(run: RunRecord) -> float | None:
    """Mean over the photographs that tell rates, to a hundredth; None where nothing is known."""
    glowing = _glowing(run)
    known = Course(run).during(glowing) if run.temperatures() and glowing else np.array([])
    return round(float(known.mean()), 2) if known.size else None


def at_temperature(material: Material, run: RunRecord) -> Material:
    """`material` with the temperature in its provenance, where it is known."""
    mean = glow_temperature_c(run)
    if mean is None or material.provenance is None:
        return material
    provenance: Provenance = material.provenance.model_copy(update={"temperature_c": mean})
    return material.model_copy(update={"provenance": provenance})


def _glowing(run: RunRecord) -> list[FrameRecord]:
    """By time."""
    return [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.purpose in RATE_PURPOSES
    ]


def _by_unit(frames: Sequence[FrameRecord]) -> list[list[FrameRecord]]:
    return [list(group) for _, group in groupby(frames, key=lambda frame: frame.unit)]


def _degrees(celsius: FloatArray) -> str:
    return f"{celsius.min():.1f} °C to {celsius.max():.1f} °C"


def _change(from_c: float, to_c: float) -> float:
    """By which part of themselves rates are faster at the second temperature."""
    return math.expm1(TRAP_K * (1 / (from_c + ZERO_C_K) - 1 / (to_c + ZERO_C_K)))
