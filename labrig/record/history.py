"""What happened in a run, its temperature, and what it was: bench and sample."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from labrig.record.frames import FrameRecord, FrameRole
from labrig.record.reading import Attempt, RunRecord

FloatArray = NDArray[np.float64]

#: Rates of traps 0.65 eV deep follow exp(−E / kT): 8.7 % for a degree at room temperature.
TRAP_K, ZERO_C_K = 0.65 / 8.617333e-5, 273.15
#: Readings scatter by a tenth of a degree, rooms change slowly.
SMOOTHED_S = 300.0
#: So long after the last reading nobody knows.
KNOWN_FOR_S = 600.0


class TemperatureHistory:
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
    known = (
        TemperatureHistory(run).during(frames) if run.temperatures() and frames else np.array([])
    )
    return round(float(known.mean()), 2) if known.size else None


def in_roles(run: RunRecord, roles: Collection[str]) -> list[FrameRecord]:
    """The frames of these roles in completed units, by time."""
    return [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.role in roles
    ]


def relative_rate_change(from_c: float, to_c: float) -> float:
    """By which part of themselves rates are faster at the second temperature."""
    return math.expm1(TRAP_K * (1 / (from_c + ZERO_C_K) - 1 / (to_c + ZERO_C_K)))


def degrees_text(celsius: FloatArray) -> str:
    """`20.1 °C to 21.4 °C`."""
    return f"{celsius.min():.1f} °C to {celsius.max():.1f} °C"


@dataclass(frozen=True)
class Interruption:
    """An attempt at a unit that did not count: when it began, and why it ended."""

    unit: str
    began: str
    reason: str


def charges_s(run: RunRecord) -> tuple[float, ...]:
    """How long the lamp shone in each complete decay before its first frame, looks left out."""
    return tuple(
        sum(_shining_s(attempt, decay[0].start_time))
        for attempt in run.completed().values()
        if (decay := [frame for frame in attempt.frames if frame.role == FrameRole.DECAY])
    )


def interruptions(run: RunRecord) -> tuple[Interruption, ...]:
    """Attempts that did not come to their end, by time."""
    return tuple(
        Interruption(
            attempt.unit,
            written_time(attempt.start["time"]),
            attempt.reason or "labrig was cut off",
        )
        for attempt in run.attempts
        if not attempt.completed
    )


def written_time(seconds: float) -> str:
    """Seconds since 1970 as a person reads them."""
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _shining_s(attempt: Attempt, until: float) -> Iterator[float]:
    """The lengths of the times with the lamp on; relays switch in the middle of a transaction."""
    since = None
    for action in attempt.actions:
        switched = action.middle_time
        if action.device != "lamp" or switched > until:
            continue
        if action.action == "on":
            since = switched if since is None else since
        elif since is not None:
            yield switched - since
            since = None


@dataclass(frozen=True)
class DeviceLine:
    """A device of the rig: its role, the address it was reached at, and who answered there."""

    role: str
    address: str
    identity: str


@dataclass(frozen=True, kw_only=True)
class RunDescription:
    """A run, its bench and what its result was made with.

    Attributes
    ----------
    title
        The sample's name.
    protocol
        Name of the protocol.
    run
        Name of the run folder.
    started, ended
        As they are to be read.
    rig
        Name of the rig.
    simulated
        Whether the rig is a simulated one.
    labrig_version, libraries
        Of the processing; libraries by name and version.
    sample
        Pairs of what and value: thickness, batch, …
    devices
        Of the rig.
    guard
        What would have switched the lights off, had labrig died.
    protocol_text, rig_text
        The files, as resolved.
    interruptions
        Attempts that failed, by time.
    notes
        What a person had to say afterwards.
    """

    title: str
    protocol: str
    run: str
    started: str
    ended: str
    rig: str
    simulated: bool
    labrig_version: str
    libraries: tuple[tuple[str, str], ...] = ()
    sample: tuple[tuple[str, str], ...] = ()
    devices: tuple[DeviceLine, ...] = ()
    guard: str = ""
    protocol_text: str = ""
    rig_text: str = ""
    interruptions: tuple[Interruption, ...] = ()
    notes: str = ""
