"""The run folder: written while it happens, read afterwards."""

from labrig.record.frames import ActionRecord, FrameRecord
from labrig.record.reading import Attempt, RunRecord, read_run
from labrig.record.run_folder import RunFolder

__all__ = ["ActionRecord", "Attempt", "FrameRecord", "RunFolder", "RunRecord", "read_run"]
