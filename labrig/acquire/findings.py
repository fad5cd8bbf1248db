"""What a device says about its own settings before a run rests on them."""

from dataclasses import dataclass
from typing import Literal

#: `refuse`: photometry would be spoilt. `warn`: somebody should look. `fine`: as it should be.
Severity = Literal["refuse", "warn", "fine"]


@dataclass(frozen=True)
class Finding:
    """One setting of a device.

    Attributes
    ----------
    what
        How it is set, and what that does.
    remedy
        What to do, and where: the place in the menu. Empty where all is fine.
    """

    severity: Severity
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}" if self.remedy else self.what
