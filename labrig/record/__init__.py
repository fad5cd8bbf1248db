"""Run folders: written during a run, read afterwards."""

from labrig.record.attempt import AttemptWriter
from labrig.record.frames import (
    PERSON,
    TAKEN_BACK,
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
    charges_s,
    degrees_text,
    glow_temperature_c,
    in_roles,
    interruptions,
    relative_rate_change,
    written_time,
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
from labrig.record.reading import Attempt, RunRecord, read_run
from labrig.record.run_folder import RunFolder

__all__ = [
    "KNOWN_FOR_S",
    "PERSON",
    "REAL_DISK",
    "SMOOTHED_S",
    "TAKEN_BACK",
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
    "RunRecord",
    "TemperatureHistory",
    "TemperatureRecord",
    "add_note",
    "charges_s",
    "degrees_text",
    "glow_temperature_c",
    "in_roles",
    "interruptions",
    "read_journal",
    "read_notes",
    "read_run",
    "relative_rate_change",
    "unit_in",
    "unit_within",
    "write_durably",
    "written_time",
]
