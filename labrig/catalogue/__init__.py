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

__all__ = [
    "Comparison",
    "Difference",
    "PatchComparison",
    "RunSummary",
    "Wanted",
    "compare_runs",
    "find_run",
    "is_being_written",
    "list_runs",
    "summarise",
]
