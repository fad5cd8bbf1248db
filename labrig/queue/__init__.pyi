from .queue_file import (
    Queue as Queue,
    QueuedRun as QueuedRun,
    change_queue as change_queue,
    combinations as combinations,
    read_queue as read_queue,
)
from .results import (
    FoundLuminance as FoundLuminance,
    QueueEntry as QueueEntry,
    entries as entries,
    queue_report as queue_report,
    write_results as write_results,
)
from .running import (
    run_queue as run_queue,
)
