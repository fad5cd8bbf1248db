"""Temperature, charges and interruptions of a run, and its description."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.quantity import BOLTZMANN_EV_PER_K, ZERO_C_K
from labrig.record.frames import FrameRecord, FrameRole
from labrig.record.run_record import Attempt, RunRecord

#: Rates of traps 0.65 eV deep follow exp(−E / k_B T): 8.7 % per degree at 300 K; E / k_B in K.
TRAP_K = 0.65 / BOLTZMANN_EV_PER_K
#: Window of the moving mean: readings scatter by 0.1 °C, rooms change slowly.
SMOOTHED_S = 300.0
#: Longest time before the first and after the last reading at which a temperature is known.
KNOWN_FOR_S = 600.0


class TemperatureHistory:
    """The temperature during a run.

    Parameters
    ----------
    run
        Run with at least one reading of the thermometer.

    Attributes
    ----------
    time
        Times of the readings in seconds since 1970, shape (n,), ascending.
    celsius
        Readings in degrees Celsius, shape (n,).
    smooth
        Means of the readings within `SMOOTHED_S` around each reading in degrees Celsius, shape
        (n,).
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
        """Return the smoothed temperature in the middle of each frame.

        Parameters
        ----------
        frames
            Frames of the run.

        Returns
        -------
        ndarray
            Temperatures in degrees Celsius of the frames within `KNOWN_FOR_S` of the readings.
        """
        middle = np.array([(frame.start_time + frame.end_time) / 2 for frame in frames])
        is_covered = (middle > self.time[0] - KNOWN_FOR_S) & (middle < self.time[-1] + KNOWN_FOR_S)
        celsius: FloatArray = np.interp(middle[is_covered], self.time, self.smooth)
        return celsius


def glow_temperature_c(run: RunRecord, roles: Collection[str]) -> float | None:
    """Return the mean temperature during the frames of given roles.

    Parameters
    ----------
    run
        Run with or without readings of a thermometer.
    roles
        Roles of the frames, such as `FrameRole.DECAY`.

    Returns
    -------
    float or None
        Mean of the smoothed temperature over the frames in degrees Celsius, rounded to 0.01 °C;
        None if no frame lies within `KNOWN_FOR_S` of the readings.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import FrameRole, glow_temperature_c
    >>> run = labrig.read_run("runs/decay")
    >>> round(glow_temperature_c(run, [FrameRole.DECAY]), 1)
    20.7
    """
    frames = frames_in_roles(run, roles)
    celsius = (
        TemperatureHistory(run).during(frames) if run.temperatures() and frames else np.array([])
    )
    return round(float(celsius.mean()), 2) if celsius.size else None


def frames_in_roles(run: RunRecord, roles: Collection[str]) -> list[FrameRecord]:
    """Return the frames of given roles in completed units.

    Parameters
    ----------
    run
        Run whose frames are listed.
    roles
        Roles of the frames, such as `FrameRole.DARK`.

    Returns
    -------
    list of FrameRecord
        Frames in order of time.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import FrameRole, frames_in_roles
    >>> run = labrig.read_run("runs/decay")
    >>> frames = frames_in_roles(run, [FrameRole.DARK, FrameRole.DECAY])
    >>> len(frames), frames[-1].path.name, frames[-1].exposure_s
    (30, '000037.dng', 0.5)
    """
    return [
        frame
        for attempt in run.completed().values()
        for frame in attempt.frames
        if frame.role in roles
    ]


def relative_rate_change(from_c: float, to_c: float) -> float:
    """Return the relative change of thermally activated rates between two temperatures.

    The rates are those of traps 0.65 eV deep, k_r ∝ exp(−E / k_B T).

    Parameters
    ----------
    from_c
        First temperature in degrees Celsius.
    to_c
        Second temperature in degrees Celsius.

    Returns
    -------
    float
        Rate at `to_c` over the rate at `from_c`, minus 1; dimensionless.

    Examples
    --------
    >>> from labrig.record import relative_rate_change
    >>> f"{relative_rate_change(20.0, 21.0):.1%}"
    '9.1%'
    """
    return math.expm1(TRAP_K * (1 / (from_c + ZERO_C_K) - 1 / (to_c + ZERO_C_K)))


def degrees_text(celsius: FloatArray) -> str:
    """Return a range of temperatures as text.

    Parameters
    ----------
    celsius
        Temperatures in degrees Celsius, shape (n,) with n ≥ 1.

    Returns
    -------
    str
        Lowest and highest temperature to 0.1 °C.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import TemperatureHistory, degrees_text
    >>> degrees_text(TemperatureHistory(labrig.read_run("runs/decay")).celsius)
    '20.6 °C to 21.0 °C'
    """
    return f"{celsius.min():.1f} °C to {celsius.max():.1f} °C"


@dataclass(frozen=True)
class Interruption:
    """An attempt at a unit that did not complete.

    Attributes
    ----------
    unit
        Name of the unit.
    began
        Start of the attempt, as text.
    reason
        Reason for its end.
    """

    unit: str
    began: str
    reason: str


def charge_durations_s(run: RunRecord) -> tuple[float, ...]:
    """Return how long the lamp charged the sample before each recorded decay.

    The lamp is taken to switch in the middle of the transaction with its relay. Interruptions of
    the charge, in which photographs are taken, do not count.

    Parameters
    ----------
    run
        Run whose completed units are looked through.

    Returns
    -------
    tuple of float
        Time with the lamp on before the first frame of each decay, in seconds.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import charge_durations_s
    >>> [round(charge_s, 1) for charge_s in charge_durations_s(labrig.read_run("runs/decay"))]
    [600.0]
    """
    return tuple(
        sum(_lamp_on_durations_s(attempt, decay[0].start_time))
        for attempt in run.completed().values()
        if (decay := [frame for frame in attempt.frames if frame.role == FrameRole.DECAY])
    )


def interruptions(run: RunRecord) -> tuple[Interruption, ...]:
    """Return the attempts at units that did not complete.

    Parameters
    ----------
    run
        Run whose attempts are looked through.

    Returns
    -------
    tuple of Interruption
        Unit, begin and reason of each of these attempts, in order of time.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import interruptions
    >>> [attempt.reason for attempt in interruptions(labrig.read_run("runs/decay"))]
    []
    """
    return tuple(
        Interruption(
            attempt.unit,
            time_text(attempt.start["time"]),
            attempt.reason or "labrig was cut off",
        )
        for attempt in run.attempts
        if not attempt.completed
    )


def time_text(seconds: float) -> str:
    """Return a time as text for people.

    Parameters
    ----------
    seconds
        Time in seconds since 1970.

    Returns
    -------
    str
        Date and time in UTC to the second.

    Examples
    --------
    >>> from labrig.record import time_text
    >>> time_text(1_767_225_600.0)
    '2026-01-01 00:00:00 UTC'
    """
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _lamp_on_durations_s(attempt: Attempt, until: float) -> Iterator[float]:
    """Yield the durations in seconds during which the lamp was on, until the time `until`."""
    on_time = None
    for action in attempt.actions:
        switch_time = action.middle_time
        if action.device != "lamp" or switch_time > until:
            continue
        if action.action == "on":
            on_time = switch_time if on_time is None else on_time
        elif on_time is not None:
            yield switch_time - on_time
            on_time = None


@dataclass(frozen=True)
class DeviceLine:
    """A device of the rig, as it is listed in reports.

    Attributes
    ----------
    role
        Key of the device.
    address
        Address at which the device was opened.
    identity
        Maker, model, serial number and firmware that the device reported.
    """

    role: str
    address: str
    identity: str


@dataclass(frozen=True, kw_only=True)
class RunDescription:
    """Description of a run, its bench and the processing.

    Attributes
    ----------
    title
        Name of the sample.
    protocol
        Name of the protocol.
    run
        Name of the run folder.
    started, ended
        Begin and end of the run, as text.
    rig
        Name of the rig.
    simulated
        Whether the rig is simulated.
    labrig_version
        Version of labrig that processed the run.
    libraries
        Names and versions of the libraries that processed it.
    sample
        Properties of the sample, such as thickness and batch, with their values.
    devices
        Devices of the rig.
    guard
        Mechanism that would have switched the lights off if labrig had died.
    protocol_text, rig_text
        Protocol and rig files, as resolved.
    interruptions
        Attempts that failed, in order of time.
    notes
        Notes of the user in Markdown.
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
