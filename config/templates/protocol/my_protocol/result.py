"""The result: what `result.json`, the report and `labrig.read_result` hold."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.foundation.arrays import FloatArray
from labrig.results import Measured, RunResult


@dataclass(frozen=True, eq=False, kw_only=True)
class MyProtocolResult(RunResult):
    """The glow after a charge. The report shows the fields as tables.

    Attributes
    ----------
    left
        Level in the last photograph over that in the first one.
    time_s
        Start of each photograph after that of the first one, in seconds, shape (n,).
    level_dn_per_s, sigma_dn_per_s
        Mean of the green channel over the exposure time and its standard uncertainty, shape (n,).
    """

    kind: ClassVar[str] = "my_protocol"

    left: Measured
    time_s: FloatArray
    level_dn_per_s: FloatArray
    sigma_dn_per_s: FloatArray
