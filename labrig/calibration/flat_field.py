"""A flat field: how the light falls off towards the corners, as a few numbers."""

from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig.region import Region, region_pixels

FloatArray = NDArray[np.float64]
Number = Annotated[float, Field(allow_inf_nan=False)]
Numbers = tuple[Number, ...]

#: Points across a region whose mean is taken.
POINTS = 24


class Flat(BaseModel):
    """1 + Σ_k c_k ρ^(2k), k = 1, 2 …, ρ the distance from the middle over half the diagonal.

    What is even about the middle is the lens's. The odd part, `gradient`, is the lamp's: it is
    kept for the record and not divided out. An even part of the lamp's light cannot be told from
    the lens's.

    Attributes
    ----------
    f_number
        Null for a lens that does not tell it.
    falloff
        c_k, a row for each channel.
    gradient
        Of the lit card along x and y, over half the diagonal, a row for each channel.
    sigma
        What the card's light and these numbers differ by, relative, from place to place.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    f_number: Annotated[float, Field(gt=0)] | None
    falloff: tuple[Numbers, ...]
    gradient: tuple[tuple[Number, Number], ...] = ()
    sigma: Annotated[float, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _falls_off(self) -> Self:
        if not self.falloff or len({len(row) for row in self.falloff}) != 1:
            raise ValueError("expected 'falloff' to have a row of the same length for each channel")
        if (self.at(np.linspace(0, 1, 21)) <= 0).any():
            raise ValueError("expected a 'falloff' that leaves some light everywhere in the frame")
        return self

    def at(self, rho2: ArrayLike) -> FloatArray:
        """At squared distances (…,) from the middle, shape (…, channels)."""
        squared = np.asarray(rho2, dtype=np.float64)
        powers = squared[..., None] ** np.arange(1, len(self.falloff[0]) + 1)
        result: FloatArray = 1 + powers @ np.array(self.falloff).T
        return result

    def mean(self, region: Region, width: int, height: int) -> FloatArray:
        """Over a region of a frame of `width` × `height` pixels, shape (channels,)."""
        left, top, wide, high = region_pixels(region, width, height)
        steps = (np.arange(POINTS) + 0.5) / POINTS
        x, y = np.meshgrid(left + steps * wide, top + steps * high)
        mean: FloatArray = self.at(rho_squared(x, y, width, height)).mean(axis=(0, 1))
        return mean


def rho_squared(x: FloatArray, y: FloatArray, width: int, height: int) -> FloatArray:
    """ρ² of places in pixels."""
    across, down = x - width / 2, y - height / 2
    return (across**2 + down**2) / ((width / 2) ** 2 + (height / 2) ** 2)
