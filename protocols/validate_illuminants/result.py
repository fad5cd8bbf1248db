"""Result of a validation: colours under lamps, predicted and photographed."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.results.under_lamps import PredictedUnderLamps


@dataclass(frozen=True, eq=False, kw_only=True)
class ValidateIlluminantsResult(PredictedUnderLamps):
    """Fluorescent samples under lamps.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for name, lamp in result.lamps.items():
    ...     print(name, lamp.verdict, lamp.reduced_chi2)
    """

    kind: ClassVar[str] = "validate_illuminants"
