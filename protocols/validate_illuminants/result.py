"""Result of a validation: colours under lamps, predicted and photographed."""

from dataclasses import dataclass
from typing import ClassVar

from labrig.results.under_lamps import PredictedUnderLamps


@dataclass(frozen=True, eq=False, kw_only=True)
class ValidateIlluminantsResult(PredictedUnderLamps):
    """Fluorescent samples under lamps."""

    kind: ClassVar[str] = "validate_illuminants"
