"""Which part of each texel's material is that of each dot.

Spreading edits is linear in them, so that how far one dot reaches is found by spreading 1 from its
brush and 0 from all others'. Dots have their own material exactly: the parts are combined so that
each dot's is 1 at itself and 0 at the others.
"""

from collections.abc import Sequence

import numpy as np

from labrig.design.propagation import propagate
from labrig.design.spread_wish import SpreadWish
from labrig.foundation.arrays import BoolArray, FloatArray


def dot_shares(
    appearance: FloatArray,
    dots: Sequence[tuple[int, int]],
    painted: Sequence[BoolArray],
    wish: SpreadWish,
) -> FloatArray:
    """Return the part of each dot in the material of each texel.

    Parameters
    ----------
    appearance
        Colours of the texels, shape (rows, columns, n).
    dots
        Row and column of each dot, no two alike.
    painted
        Whether a stroke for each dot covers a texel, shape (rows, columns) each.
    wish
        How far dots reach.

    Returns
    -------
    ndarray
        Parts from 0 to 1, in sum at most 1: the rest is the material of all dots together; shape
        (rows, columns, dots).
    """
    own = _brushes(appearance.shape[:2], dots, painted, wish.brush)
    weights = own.max(axis=-1)
    is_dots = (np.arange(len(dots)) == own.argmax(axis=-1)[..., np.newaxis]).astype(np.float64)
    nothing = np.zeros_like(is_dots)
    reached = propagate(nothing, appearance, is_dots, weights, wish.reach)
    rows, columns = np.array(dots).T
    # Dots so near that none is told from the other share what they cannot have alone.
    exact = reached @ np.linalg.pinv(reached[rows, columns])
    shares = np.clip(exact, 0.0, 1.0)
    return np.asarray(shares / np.maximum(shares.sum(axis=-1, keepdims=True), 1.0))


def _brushes(
    shape: tuple[int, ...],
    dots: Sequence[tuple[int, int]],
    painted: Sequence[BoolArray],
    brush: float,
) -> FloatArray:
    """Return the weight of each dot's brush and strokes, shape (rows, columns, dots)."""
    row, column = np.indices(shape[:2])
    distance = np.stack([np.hypot(row - own[0], column - own[1]) for own in dots], axis=-1)
    around = np.clip(2 - distance / brush, 0.0, 1.0)
    # A dot's next surroundings are its own, whatever is painted over them; of two dots they are
    # those of the nearer one.
    is_nearest = distance.argmin(axis=-1)[..., np.newaxis] == np.arange(len(dots))
    around = np.where(is_nearest, around, 0.0)
    strokes = np.stack(painted, axis=-1) & (around.max(axis=-1, keepdims=True) < 1)
    return np.asarray(np.maximum(around, strokes), dtype=np.float64)
