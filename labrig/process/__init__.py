"""Processing of a run folder: analysis, report and exports."""

from labrig.process.result_changes import other_settings
from labrig.process.run import Processed, process_and_report, process_run

__all__ = [
    "Processed",
    "other_settings",
    "process_and_report",
    "process_run",
]
