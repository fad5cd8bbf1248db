"""All runs in a folder: which there are, what came out, what changed from day to day."""

from labrig.catalogue.compare import Comparison, Difference, PatchComparison, compare_runs
from labrig.catalogue.listing import (
    RunSummary,
    Wanted,
    find_run,
    is_being_written,
    list_runs,
    summarise,
)
from labrig.catalogue.results import Measured, PatchResult, read_results

__all__ = [
    "Comparison",
    "Difference",
    "Measured",
    "PatchComparison",
    "PatchResult",
    "RunSummary",
    "Wanted",
    "compare_runs",
    "find_run",
    "is_being_written",
    "list_runs",
    "read_results",
    "summarise",
]
