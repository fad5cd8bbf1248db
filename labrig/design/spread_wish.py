"""How the materials of dots are spread over a surface, as a file of wishes says it."""

from typing import Annotated

from pydantic import Field

from labrig.design.propagation import Reach
from labrig.foundation.models import FrozenModel, Positive, UnitFraction

#: Part of the picture's height that a stroke is wide at most.
WIDEST = 1.0


class SpreadWish(FrozenModel):
    """How far materials reach around the dots whose own they are.

    Attributes
    ----------
    position
        Distance in texels over which neighbours are alike.
    appearance
        Difference of colours, 0 to 1 in each channel of a picture, over which texels are alike.
    brush
        Distance in texels from a dot up to which the material is the dot's; at twice the distance
        nothing holds it.
    appearance_file
        Picture whose colours say what is alike, upper left where u is 0 and v is 1, its path
        relative to this file. Without it only the material of a `material_map` does.
    strokes
        Where else the material is that of a dot, by the dot's name: strokes of a brush on the
        picture, each x, y and radius; x and y as of `pixels`, the radius as a part of its height.
    """

    position: Annotated[Positive, Field(le=1e4)] = 20.0
    appearance: Annotated[Positive, Field(le=1e4)] = 0.1
    brush: Annotated[Positive, Field(le=1e4)] = 2.0
    appearance_file: Annotated[str, Field(min_length=1)] | None = None
    strokes: dict[
        str, tuple[tuple[UnitFraction, UnitFraction, Annotated[float, Field(gt=0, le=WIDEST)]], ...]
    ] = Field(default_factory=dict)

    @property
    def reach(self) -> Reach:
        """Differences over which texels are alike."""
        return Reach(self.appearance, self.position)
