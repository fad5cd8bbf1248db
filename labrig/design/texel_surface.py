"""The surface over which materials are spread: the one object of a material, with its texels."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labrig.foundation.arrays import Int32Array
from labrig.foundation.errors import UsageError
from labrig.reproduce import Scene, Surface


@dataclass(frozen=True, eq=False)
class TexelSurface:
    """Texels of an object, top row first as in a picture of its texture.

    Attributes
    ----------
    surface
        The object.
    first_place
        Number of its first place among all of the scene.
    material
        Number of the material that is spread.
    """

    surface: Surface
    first_place: int
    material: int

    @classmethod
    def of(cls, scene: Scene, material: str) -> Self:
        """Return the only object of a material.

        Raises
        ------
        UsageError
            Several objects are made of it, or the only one has no texels.
        """
        number = list(scene.file.materials).index(material)
        found, first = [], 0
        for surface in scene.surfaces(scene.file.programme[0].at_s):
            own = surface.material_of_texel
            is_own = surface.material == number if own is None else (own == number).any()
            if is_own:
                found.append(cls(surface, first, number))
            first += surface.n_places
        if len(found) != 1:
            names = ", ".join(each.surface.name for each in found)
            raise UsageError(
                f"{scene.file.name}: expected one object of '{material}' to spread over, got "
                f"{len(found)} ({names}); give the others a material of their own"
            )
        if not isinstance(found[0].surface.samples, tuple):
            raise UsageError(
                f"{scene.file.name}: expected texels on '{found[0].surface.name}' to spread over "
                f"(samples: [columns, rows]), got {found[0].surface.samples}"
            )
        return found[0]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        assert isinstance(self.surface.samples, tuple)
        columns, rows = self.surface.samples
        return rows, columns

    @property
    def materials(self) -> Int32Array:
        """Number of the material of each texel (rows, columns)."""
        own = self.surface.material_of_texel
        return np.full(self.shape, self.material) if own is None else own[::-1]

    def texels_of(self, places: Int32Array) -> tuple[Int32Array, Int32Array]:
        """Return rows and columns of places, which are numbers among all of the scene."""
        rows, columns = self.shape
        row, column = np.divmod(places - self.first_place, columns)
        return rows - 1 - row, column
