"""What was found of a lamp."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.results import FloatArray, Measured, RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class LampDriftResult(RunResult):
    """A straight line through the lamp's light.

    Attributes
    ----------
    drift
        Change of the light relative to its mean.
    time_s, level_dn_per_s
        (n,) of the photographs after the first one; mean of the green channel.
    """

    kind: ClassVar[str] = "lamp_drift"

    drift: Measured
    time_s: FloatArray
    level_dn_per_s: FloatArray
