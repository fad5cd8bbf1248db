"""What is known of a recorded photograph and of anything else that was done or read."""

import os
from dataclasses import dataclass
from enum import StrEnum
from hashlib import file_digest
from pathlib import Path


class FrameRole(StrEnum):
    """What a frame of any protocol may be for; protocols have roles of their own besides.

    `METER` sets exposures, `LOOK` answers a question on the way, `REST` shows the sample before it
    is charged, `DECAY` tells rates.
    """

    DARK = "dark"
    METER = "meter"
    LOOK = "look"
    DAYLIGHT = "daylight"
    REST = "rest"
    DECAY = "decay"


@dataclass(frozen=True)
class FrameRecord:
    """One frame in a run folder. Times are seconds since 1970, as measured.

    Attributes
    ----------
    path
        The file, as the camera delivered it.
    unit, role
        Which unit took it, and what for: a `FrameRole`, or one of its protocol's own.
    start_time, end_time
        Measured begin and end of the exposure.
    late_s
        How long after its planned time it began.
    disk_s
        How long it took to be on the disk, during which nothing else was done.
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

    def damage(self) -> str:
        """What is wrong with the file, nothing if it is as recorded."""
        try:
            with self.path.open("rb") as file:
                # A file of another size need not be read; one made up by somebody may have no end.
                same_size = os.fstat(file.fileno()).st_size == self.size_bytes
                if same_size and file_digest(file, "sha256").hexdigest() == self.sha256:
                    return ""
        except FileNotFoundError:
            return "is missing"
        except OSError as error:
            return f"cannot be read ({error.strerror})"
        return "was changed after the run (its checksum differs)"


#: Devices of actions that are a person's: what was done by hand, and the unit that does not count
#: any more because it was done wrongly.
PERSON, TAKEN_BACK = "person", "taken back"


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
    """One switch, move or choice. Times are seconds since 1970, as measured.

    `task` is what hands that are a device are told; empty where a device did it by itself.
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
        """When a relay switched, as near as is known: in the middle of the transaction."""
        return (self.start_time + self.end_time) / 2

    @property
    def is_manual(self) -> bool:
        """Whether a person did it."""
        return self.device == PERSON


@dataclass(frozen=True)
class TemperatureRecord:
    """One reading of the thermometer; `time` in seconds since 1970."""

    unit: str
    time: float
    temperature_c: float
