"""Catalogue of the runs in a folder: their states, their results, and changes between them."""

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
