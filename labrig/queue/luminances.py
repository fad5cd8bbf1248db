"""Luminances that the runs of a queue found, and how they depend on what was changed."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from labrig.foundation.errors import LabrigError
from labrig.results import Measured, read_result


@dataclass(frozen=True)
class FoundLuminance:
    """A luminance at one time after lamp off.

    Attributes
    ----------
    patch
        Name of the patch.
    t_s
        Time after lamp off in seconds.
    luminance
        Luminance in mcd/m².
    scale_sigma
        Part of its relative σ that luminances of one bench have in common.
    """

    patch: str
    t_s: float
    luminance: Measured
    scale_sigma: float


def found_luminances(run: Path) -> Iterator[FoundLuminance]:
    """Iterate over the luminances of a processed run; none of a run of another protocol."""
    try:
        result = read_result(run)
    except LabrigError:
        return
    for name, decay in result.provides().get("luminances", {}).items():
        for entry in decay.at:
            if entry.luminance is not None:
                yield FoundLuminance(name, entry.t_s, entry.luminance, decay.scale_sigma)
