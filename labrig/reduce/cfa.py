"""What repeats over a sensor: the filter colours of its pixels and their black levels."""

import math
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from labrig.errors import FrameError
from labrig.reduce.noise import Floats

Letters: TypeAlias = npt.NDArray[np.str_]
Scalar = TypeVar("Scalar", np.str_, np.float64)

#: The one channel of a sensor without colour filters.
MONOCHROME = "L"
#: X-Trans repeats after 6 pixels; beyond this, too few pixels share a place to tell their noise.
_LARGEST_SIDE = 12


def side_of(cfa: str) -> int:
    """Rows, and columns, of the square that `cfa` spells row by row."""
    return math.isqrt(len(cfa))


def channels_of(cfa: str) -> tuple[str, ...]:
    """Names of the channels in `cfa`: R, G, B in this order, or L."""
    return (MONOCHROME,) if set(cfa) == {MONOCHROME} else ("R", "G", "B")


def smallest_square(colours: Letters, black: Floats) -> tuple[str, tuple[float, ...]]:
    """Letters and black levels of the smallest square that repeats both, row by row.

    Parameters
    ----------
    colours
        Shape (rows, columns): one letter per pixel, repeating from the first visible pixel.
    black
        Likewise, in DN; may repeat after other numbers of rows and columns.

    Raises
    ------
    FrameError
        Both together repeat too rarely to be reduced.
    """
    side = math.lcm(*colours.shape, *black.shape)
    if side > _LARGEST_SIDE:
        raise FrameError(
            f"expected colours and black levels that repeat after {_LARGEST_SIDE} pixels or fewer, "
            f"got {side}; labrig cannot reduce this kind of sensor"
        )
    letters, levels = _repeated(colours, side), _repeated(black, side)
    for shorter in (length for length in range(1, side) if side % length == 0):
        corner = (slice(shorter), slice(shorter))
        if np.array_equal(_repeated(letters[corner], side), letters) and np.array_equal(
            _repeated(levels[corner], side), levels
        ):
            letters, levels = letters[corner], levels[corner]
            break
    return "".join(letters.ravel().tolist()), tuple(levels.ravel().tolist())


def _repeated(tile: npt.NDArray[Scalar], side: int) -> npt.NDArray[Scalar]:
    return np.tile(tile, (side // tile.shape[0], side // tile.shape[1]))
