"""All runs in a folder: which there are, what came out, what changed from day to day."""

from labrig.catalogue.compare import Comparison, Difference, PatchComparison, compare_runs
from labrig.catalogue.listing import (
    RunFilter,
    RunState,
    RunSummary,
    find_run,
    list_runs,
    state_of,
    summarise,
)

__all__ = [
    "Comparison",
    "Difference",
    "PatchComparison",
    "RunFilter",
    "RunState",
    "RunSummary",
    "compare_runs",
    "find_run",
    "list_runs",
    "state_of",
    "summarise",
]
