"""Processing of a run folder, or of a table: analysis, report and exports."""

from labrig.process.comparison import show_comparison
from labrig.process.result_changes import other_settings
from labrig.process.run import Processed, draw_figures, process_and_report, process_run
from labrig.process.verification import Verification, seal_run, verify_run
from labrig.process.without_run import (
    ReportedCharge,
    describe_without_run,
    report_charge,
    report_led_study,
    report_mixture,
    report_shared_decay,
    report_table,
    report_trap_depths,
    write_with_report,
)

__all__ = [
    "Processed",
    "ReportedCharge",
    "Verification",
    "describe_without_run",
    "draw_figures",
    "other_settings",
    "process_and_report",
    "process_run",
    "report_charge",
    "report_led_study",
    "report_mixture",
    "report_shared_decay",
    "report_table",
    "report_trap_depths",
    "seal_run",
    "show_comparison",
    "verify_run",
    "write_with_report",
]
