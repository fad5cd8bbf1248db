"""Base of all parts of a scene file: strict keys, and numbers within reason."""

from typing import Annotated

from pydantic import Field

from labrig.foundation.models import FrozenModel

#: Lengths in m and times in s that single precision and a person can still tell apart.
Length = Annotated[float, Field(gt=0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Time = Annotated[float, Field(ge=-1e9, le=1e9)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
Name = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=1, le=8192)]


class ScenePart(FrozenModel):
    """A part of a scene file, which has no other keys than those it names."""
