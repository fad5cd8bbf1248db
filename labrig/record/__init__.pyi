from .attempt import (
    AttemptWriter as AttemptWriter,
)
from .checksums import (
    CACHE as CACHE,
    FRAMES as FRAMES,
    damaged_frames as damaged_frames,
    discard_cache as discard_cache,
    own_digest as own_digest,
)
from .frames import (
    PC_CLOCK as PC_CLOCK,
    PERSON as PERSON,
    UNDONE as UNDONE,
    ActionRecord as ActionRecord,
    FileRecord as FileRecord,
    FrameRecord as FrameRecord,
    FrameRole as FrameRole,
    SpectrumRecord as SpectrumRecord,
    TemperatureRecord as TemperatureRecord,
    clock_stepped as clock_stepped,
    unit_in as unit_in,
    unit_within as unit_within,
)
from .history import (
    KNOWN_FOR_S as KNOWN_FOR_S,
    SMOOTHED_S as SMOOTHED_S,
    DeviceLine as DeviceLine,
    RunDescription as RunDescription,
    TemperatureHistory as TemperatureHistory,
    charge_durations_s as charge_durations_s,
    degrees_text as degrees_text,
    frames_in_roles as frames_in_roles,
    glow_temperature_c as glow_temperature_c,
    interruptions as interruptions,
    relative_rate_change as relative_rate_change,
    time_text as time_text,
)
from .journal import (
    JOURNAL as JOURNAL,
    Document as Document,
    add_note as add_note,
    line_seals as line_seals,
    read_journal as read_journal,
    read_notes as read_notes,
    sealed_line as sealed_line,
)
from .plain_folder import (
    require_plain_folder as require_plain_folder,
)
from .plan_files import (
    PLAN_FILES as PLAN_FILES,
    edited_keys as edited_keys,
    journal_text as journal_text,
    plan_content as plan_content,
)
from .run_folder import (
    CALIBRATIONS_FILE as CALIBRATIONS_FILE,
    RECORDING_LOCK as RECORDING_LOCK,
    Begun as Begun,
    RunFolder as RunFolder,
    RunLock as RunLock,
    RunSize as RunSize,
    lost_files as lost_files,
    size_text as size_text,
    time_made as time_made,
)
from .run_record import (
    Attempt as Attempt,
    RunRecord as RunRecord,
    read_run as read_run,
)
