"""Records of frames, spectra, actions and temperatures."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from labrig.foundation.result_warning import Disturbance


class FrameRole(StrEnum):
    """Role of a frame in any protocol; a protocol may have further roles.

    `METER` frames set exposures, `LOOK` frames decide how a unit goes on, `REST` frames show the
    sample before it is charged, rates are fitted to `DECAY` frames.
    """

    DARK = "dark"
    METER = "meter"
    LOOK = "look"
    DAYLIGHT = "daylight"
    REST = "rest"
    DECAY = "decay"


@dataclass(frozen=True)
class FrameRecord:
    """One frame in a run folder.

    Attributes
    ----------
    path
        File of the frame, as the camera delivered it.
    sha256
        Checksum of the file.
    size_bytes
        Size of the file in bytes.
    unit
        Name of the unit that took the frame.
    role
        Purpose of the frame: a `FrameRole` or a role of the protocol.
    exposure_s
        Exposure time in seconds.
    iso
        Sensitivity, ISO 12232.
    f_number
        Aperture; None where the camera does not report it.
    start_time, end_time
        Measured begin and end of the exposure in seconds since 1970.
    late_s
        Delay of the start of the exposure after its planned time, in seconds.
    disk_s
        Time that writing the file took, in seconds; nothing else is done during it.
    """

    path: Path
    sha256: str
    size_bytes: int
    unit: str
    role: str
    exposure_s: float
    iso: int
    f_number: float | None
    start_time: float
    end_time: float
    late_s: float
    disk_s: float = 0.0


@dataclass(frozen=True)
class SpectrumRecord:
    """One reading of the spectrometer in a run folder.

    Attributes
    ----------
    path
        File of the reading, with raw counts; `labrig.optics.read_spectrometer_reading` reads it.
    sha256
        Checksum of the file.
    size_bytes
        Size of the file in bytes.
    unit
        Name of the unit that took the reading.
    role
        Purpose of the reading in the protocol, such as `dark`.
    integration_s
        Integration time of each repetition in seconds.
    repetitions
        Number of repetitions.
    start_time, end_time
        Measured begin and end of the reading in seconds since 1970.
    late_s
        Delay of its start after its planned time, in seconds.
    """

    path: Path
    sha256: str
    size_bytes: int
    unit: str
    role: str
    integration_s: float
    repetitions: int
    start_time: float
    end_time: float
    late_s: float


#: A record of something that is in a file of its own.
FileRecord = FrameRecord | SpectrumRecord

#: Devices of a person's actions: a step done by hand, and the undoing of a unit that was done
#: wrongly.
PERSON, UNDONE = "person", "taken back"
#: Device of a step of the PC's time of day, and the warning of one.
PC_CLOCK = "clock of the PC"


def clock_stepped(change: str) -> Disturbance:
    """Return the warning of a step of the PC's time of day.

    Parameters
    ----------
    change
        What happened to the clock, such as `set ahead by 1 h`.

    Returns
    -------
    Disturbance
        The warning, which runs and results give alike.

    Examples
    --------
    >>> from labrig.record import clock_stepped
    >>> clock_stepped("set ahead by 1 h").code
    'pc-clock-stepped'
    """
    return Disturbance(
        "pc-clock-stepped",
        "the clock of this PC was {change}: times of day in this run go on by the clock as it was "
        "before, durations are right",
        change=change,
    )


def unit_in(part: str, unit: str) -> str:
    """Return the name that a unit of one part of a chain has in the whole run.

    Parameters
    ----------
    part
        Name of the part, such as `decay`.
    unit
        Name of the unit within the part.

    Returns
    -------
    str
        Name in the journal of the chain's run.

    Examples
    --------
    >>> from labrig.record import unit_in
    >>> unit_in("decay", "decay-1")
    'decay/decay-1'
    """
    return f"{part}/{unit}"


def unit_within(part: str, name: str) -> str | None:
    """Return the name that a unit of a chain has within one of its parts.

    This is the inverse of `unit_in`.

    Parameters
    ----------
    part
        Name of the part, such as `decay`.
    name
        Name of the unit in the journal of the chain's run.

    Returns
    -------
    str or None
        Name of the unit within the part; None if the unit belongs to another part.

    Examples
    --------
    >>> from labrig.record import unit_within
    >>> unit_within("decay", "decay/decay-1")
    'decay-1'
    >>> unit_within("excitation", "decay/decay-1") is None
    True
    """
    unit = name.removeprefix(f"{part}/")
    return None if unit == name else unit


@dataclass(frozen=True)
class ActionRecord:
    """One action of a device, a person or the protocol.

    Attributes
    ----------
    unit
        Name of the unit.
    device
        Key of the device, `PERSON`, `UNDONE`, `PC_CLOCK`, or `protocol` for a choice.
    action
        Action as text.
    start_time, end_time
        Measured begin and end of the action in seconds since 1970.
    late_s
        Delay of its start after its planned time, in seconds.
    task
        Command for a changer that replaces the person; empty for the action of a device.
    """

    unit: str
    device: str
    action: str
    start_time: float
    end_time: float
    late_s: float
    task: str = ""

    @property
    def middle_time(self) -> float:
        """Middle of the transaction in seconds since 1970, best estimate of a relay's switching."""
        return (self.start_time + self.end_time) / 2

    @property
    def is_manual(self) -> bool:
        """Whether a person performed the action."""
        return self.device == PERSON


@dataclass(frozen=True)
class TemperatureRecord:
    """One reading of the thermometer.

    Attributes
    ----------
    unit
        Name of the unit during which it was read.
    time
        Time of the reading in seconds since 1970.
    temperature_c
        Temperature in degrees Celsius.
    """

    unit: str
    time: float
    temperature_c: float
