"""Regions as the page sends them, checked."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from labrig.errors import UsageError
from labrig.region import Region

MOST_PATCHES = 200
#: A fraction as the page computes it may end beyond the frame by its last digits.
ROUNDING = 1e-6
#: No control characters and no line ends of any kind: a name is one line of YAML.
_ONE_LINE = r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]+$"

Name = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=60, pattern=_ONE_LINE),
]


class DrawnPatch(BaseModel):
    """One region; fractions of the frame."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Name
    region: Region


class DrawnPatches(BaseModel):
    """All regions of the page."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    patches: tuple[DrawnPatch, ...] = Field(min_length=1, max_length=MOST_PATCHES)

    def by_name(self) -> dict[str, Region]:
        """Name → region.

        Raises
        ------
        UsageError
            A name stands twice, or a region is not within the frame.
        """
        found: dict[str, Region] = {}
        for patch in self.patches:
            x, y, width, height = patch.region
            if max(x + width, y + height) > 1 + ROUNDING:
                raise UsageError(
                    f"'{patch.name}' leaves the frame; expected fractions of it, "
                    f"got {list(patch.region)}"
                )
            if patch.name in found:
                raise UsageError(f"two regions are called '{patch.name}'; rename one")
            found[patch.name] = patch.region
        return found
