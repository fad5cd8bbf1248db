from .compare import (
    Comparison as Comparison,
    Difference as Difference,
    PatchComparison as PatchComparison,
    compare_runs as compare_runs,
)
from .index import (
    RunFilter as RunFilter,
    find_run as find_run,
    indexed_summary as indexed_summary,
    list_runs as list_runs,
)
from .run_summary import (
    STATUSES as STATUSES,
    RunStatus as RunStatus,
    RunSummary as RunSummary,
    is_being_written as is_being_written,
    status_of as status_of,
)
from .summarising import (
    summarise as summarise,
)
from .trap_depths import (
    trap_depths as trap_depths,
)
from .unfinished import (
    unfinished as unfinished,
)
