from .ahead import (
    reduced_ahead as reduced_ahead,
)
from .comparison import show_comparison as show_comparison
from .result_changes import other_settings as other_settings
from .run import (
    Processed as Processed,
    draw_figures as draw_figures,
    process_and_report as process_and_report,
    process_run as process_run,
    refit as refit,
    rendered_result as rendered_result,
    restore_result as restore_result,
)
from .verification import (
    Verification as Verification,
    seal_run as seal_run,
    verify_run as verify_run,
)
from .without_run import (
    ReportedCharge as ReportedCharge,
    describe_without_run as describe_without_run,
    report_charge as report_charge,
    report_led_study as report_led_study,
    report_mixture as report_mixture,
    report_shared_decay as report_shared_decay,
    report_table as report_table,
    report_trap_depths as report_trap_depths,
    write_with_report as write_with_report,
)
