"""Run folders: written during a run, read afterwards."""

from labrig.record.attempt import AttemptWriter
from labrig.record.checksums import CACHE, FRAMES, damaged_frames
from labrig.record.frames import (
    PERSON,
    UNDONE,
    ActionRecord,
    FrameRecord,
    FrameRole,
    TemperatureRecord,
    unit_in,
    unit_within,
)
from labrig.record.history import (
    KNOWN_FOR_S,
    SMOOTHED_S,
    DeviceLine,
    RunDescription,
    TemperatureHistory,
    charge_durations_s,
    degrees_text,
    frames_in_roles,
    glow_temperature_c,
    interruptions,
    relative_rate_change,
    time_text,
)
from labrig.record.journal import (
    REAL_DISK,
    Disk,
    Document,
    add_note,
    read_journal,
    read_notes,
    write_durably,
)
from labrig.record.run_folder import RunFolder
from labrig.record.run_lock import RunLock
from labrig.record.run_record import Attempt, RunRecord, read_run

__all__ = [
    "CACHE",
    "FRAMES",
    "KNOWN_FOR_S",
    "PERSON",
    "REAL_DISK",
    "SMOOTHED_S",
    "UNDONE",
    "ActionRecord",
    "Attempt",
    "AttemptWriter",
    "DeviceLine",
    "Disk",
    "Document",
    "FrameRecord",
    "FrameRole",
    "RunDescription",
    "RunFolder",
    "RunLock",
    "RunRecord",
    "TemperatureHistory",
    "TemperatureRecord",
    "add_note",
    "charge_durations_s",
    "damaged_frames",
    "degrees_text",
    "frames_in_roles",
    "glow_temperature_c",
    "interruptions",
    "read_journal",
    "read_notes",
    "read_run",
    "relative_rate_change",
    "time_text",
    "unit_in",
    "unit_within",
    "write_durably",
]
