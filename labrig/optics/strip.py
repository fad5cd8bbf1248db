"""Position of a linear variable filter's strip in the frame."""

import math
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from labrig.foundation.models import FrozenModel, UnitFraction
from labrig.foundation.region import Region, region_pixels

#: Number of positions along a strip at which pictures are read (paper, section 4.2).
SLICES = 31


class Strip(FrozenModel):
    """Position of the filter in the frame, in fractions of the frame's width and height.

    Attributes
    ----------
    left, right
        Coordinates (x, y) of the two ends of the centre line.
    height
        Height of the strip without its blurred edges.
    rising
        Whether the wavelength rises from left to right.
    """

    left: tuple[UnitFraction, UnitFraction]
    right: tuple[UnitFraction, UnitFraction]
    height: Annotated[float, Field(gt=0, le=1)]
    rising: bool

    @model_validator(mode="after")
    def _inside_the_frame(self) -> Self:
        if self.right[0] <= self.left[0]:
            raise ValueError(
                f"expected 'right' to the right of 'left', got x = {self.right[0]:g} and "
                f"{self.left[0]:g}"
            )
        middles = (self.left[1], self.right[1])
        if min(middles) < self.height / 2 or max(middles) > 1 - self.height / 2:
            raise ValueError("expected a strip inside of the frame, it leaves it at a long side")
        return self

    def slices(self, count: int = SLICES) -> dict[str, Region]:
        """Divide the strip into upright regions from the blue end to the red end.

        Returns
        -------
        dict
            Regions by the names `p00`, `p01`, …; slice k reaches from position k/count to (k +
            1)/count.
        """
        ends = np.linspace(self.left[0], self.right[0], count + 1)
        middles = np.linspace(self.left[1], self.right[1], 2 * count + 1)[1::2]
        regions = [
            (float(start), max(float(y) - self.height / 2, 0.0), float(end - start), self.height)
            for (start, end), y in zip(pairwise(ends), middles, strict=True)
        ]
        ordered = regions if self.rising else regions[::-1]
        return {f"p{number:02d}": region for number, region in enumerate(ordered)}

    def positions(self, width: int, height: int, count: int = SLICES) -> tuple[float, ...]:
        """Return the middle of each slice in whole pixels, from 0 (blue end) to 1 (red end).

        A frame of `width` × `height` pixels resolves no other positions.
        """
        fractions = []
        for region in self.slices(count).values():
            x, _, region_width, _ = region_pixels(region, width, height)
            fraction = ((x + region_width / 2) / width - self.left[0]) / (
                self.right[0] - self.left[0]
            )
            fractions.append(fraction if self.rising else 1 - fraction)
        return tuple(fractions)

    def tilt_degrees(self, width: int, height: int) -> float:
        """Return the tilt of the strip in a frame in degrees, > 0 if it falls to the right."""
        across = (self.right[0] - self.left[0]) * width
        down = (self.right[1] - self.left[1]) * height
        return math.degrees(math.atan2(down, across))
