"""Catalogue of the runs in a folder: their states, their results, and changes between them."""

from labrig.catalogue.compare import Comparison, Difference, PatchComparison, compare_runs
from labrig.catalogue.listing import (
    RunFilter,
    RunStatus,
    RunSummary,
    find_run,
    list_runs,
    status_of,
    summarise,
)

__all__ = [
    "Comparison",
    "Difference",
    "PatchComparison",
    "RunFilter",
    "RunStatus",
    "RunSummary",
    "compare_runs",
    "find_run",
    "list_runs",
    "status_of",
    "summarise",
]
