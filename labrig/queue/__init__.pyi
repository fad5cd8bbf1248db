from .luminances import (
    FoundLuminance as FoundLuminance,
)
from .queue_file import (
    Queue as Queue,
    QueuedRun as QueuedRun,
    change_queue as change_queue,
    read_queue as read_queue,
)
from .results import (
    QueueEntry as QueueEntry,
    entries as entries,
    queue_report as queue_report,
    write_results as write_results,
)
from .running import (
    run_queue as run_queue,
)
from .sweeps import (
    combinations as combinations,
)
