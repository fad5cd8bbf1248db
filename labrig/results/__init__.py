"""What was found, as frozen values with uncertainties and units; one reader and writer a file."""

from labrig.results.decay import (
    Candidate,
    DecayResult,
    DecayState,
    Rival,
    find_decay_results,
    read_decay_result,
    read_decay_results,
    write_decay_result,
)
from labrig.results.measured import Measured, with_uncertainty

__all__ = [
    "Candidate",
    "DecayResult",
    "DecayState",
    "Measured",
    "Rival",
    "find_decay_results",
    "read_decay_result",
    "read_decay_results",
    "with_uncertainty",
    "write_decay_result",
]
