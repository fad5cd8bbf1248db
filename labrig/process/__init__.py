"""Processing of a run folder, or of a table: analysis, report and exports."""

from labrig.process.charge import ReportedCharge, report_charge
from labrig.process.comparison import show_comparison
from labrig.process.led_study import report_led_study
from labrig.process.mixture import report_mixture
from labrig.process.result_changes import other_settings
from labrig.process.run import Processed, draw_figures, process_and_report, process_run
from labrig.process.shared_decay import report_shared_decay
from labrig.process.table import report_table
from labrig.process.trap_depths import report_trap_depths
from labrig.process.verification import Verification, seal_run, verify_run
from labrig.process.without_run import describe_without_run, write_with_report

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
