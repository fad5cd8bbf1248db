"""The run folder: written while it happens, read afterwards."""

from labrig.record.disk import REAL_DISK, Disk
from labrig.record.frames import ActionRecord, FrameRecord
from labrig.record.reading import Attempt, RunRecord, read_run
from labrig.record.run_folder import RunFolder

__all__ = [
    "REAL_DISK",
    "ActionRecord",
    "Attempt",
    "Disk",
    "FrameRecord",
    "RunFolder",
    "RunRecord",
    "read_run",
]
