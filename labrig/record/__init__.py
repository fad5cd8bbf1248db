"""The run folder: written while it happens, read afterwards."""

from labrig.record.disk import REAL_DISK, Disk
from labrig.record.frames import (
    PERSON,
    TAKEN_BACK,
    ActionRecord,
    FrameRecord,
    TemperatureRecord,
    unit_in,
    unit_within,
)
from labrig.record.notes import add_note, read_notes
from labrig.record.reading import Attempt, RunRecord, read_run
from labrig.record.run_folder import RunFolder

__all__ = [
    "PERSON",
    "REAL_DISK",
    "TAKEN_BACK",
    "ActionRecord",
    "Attempt",
    "Disk",
    "FrameRecord",
    "RunFolder",
    "RunRecord",
    "TemperatureRecord",
    "add_note",
    "read_notes",
    "read_run",
    "unit_in",
    "unit_within",
]
