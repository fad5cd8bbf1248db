"""Materials of dots, spread over a texture of parameters by appearance and position.

After X. An and F. Pellacini, *AppProp: all-pairs appearance-space edit propagation* (2008), and
F. Pellacini and J. Lawrence, *AppWand: editing measured materials using appearance-driven
optimization* (2007): the new values e of all texels minimise

    Σ_i w_i |e_i − g_i|² + Σ_ij z_ij |e_i − e_j|²
    z_ij = exp(−|f_i − f_j|²/σ_a² − |x_i − x_j|²/σ_s²)

over the nearest neighbours j of each texel i in appearance f and position x. Rates are edited as
logarithms.

Spreading edits is linear in them, so that how far one dot reaches is found by spreading 1 from its
brush and 0 from all others'. Dots have their own material exactly: the parts are combined so that
each dot's is 1 at itself and 0 at the others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial import cKDTree

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.models import FrozenModel, Positive, UnitFraction

#: Neighbours of each texel.
NEIGHBOURS = 10
#: Weight of the texels' own values against edits of weight 1, so that what no edit reaches stays.
KEPT = 1e-4
#: Clusters of texels on the coarse level of the solution.
CLUSTERS = 400
GOLDEN_RATIO = (math.sqrt(5) - 1) / 2
#: Relative residual at which the linear equations are solved, and most iterations.
SOLVED, MAX_ITERATIONS = 1e-5, 2000


@dataclass(frozen=True)
class Reach:
    """How far edits reach.

    Attributes
    ----------
    appearance
        Difference of appearance σ_a over which neighbours are alike.
    position
        Distance σ_s, in texels, over which they are.
    """

    appearance: float = 0.1
    position: float = 20.0


def propagate(
    values: FloatArray,
    appearance: FloatArray,
    wanted: FloatArray,
    weights: FloatArray,
    reach: Reach = Reach(),
) -> FloatArray:
    """Spread edits over a texture of parameters.

    Changes are spread, not values: where no edit reaches, a texture keeps its detail.

    Parameters
    ----------
    values
        Parameters of every texel, shape (rows, columns, channels): rates as logarithms.
    appearance
        What makes texels alike, such as their colours, shape (rows, columns, n).
    wanted
        Wanted parameters, shape (rows, columns, channels); read where the weight is above 0.
    weights
        Weight of the edit of every texel, as a brush paints it, 0 to 1, shape (rows, columns).
    reach
        Differences over which texels are alike.

    Returns
    -------
    ndarray
        New parameters, shape (rows, columns, channels).

    Raises
    ------
    UsageError
        Shapes disagree, a number is not finite or a weight lies outside of 0 to 1, or there is no
        edit.
    DataError
        The equations cannot be solved.

    References
    ----------
    X. An, F. Pellacini, *AppProp: all-pairs appearance-space edit propagation* (2008), ACM
    Transactions on Graphics 27.

    Examples
    --------
    An edit of one texel spreads over its own half of a picture:

    >>> import numpy as np
    >>> from labrig.design import propagate
    >>> colours = np.zeros((16, 16, 1))
    >>> colours[:, 8:] = 1.0
    >>> weights = np.zeros((16, 16))
    >>> weights[4, 4] = 1.0
    >>> edited = propagate(np.zeros((16, 16, 1)), colours, np.ones((16, 16, 1)), weights)
    >>> bool(edited[:, :8].min() > 0.9), bool(abs(edited[:, 8:]).max() < 0.01)
    (True, True)
    """
    rows, columns = _checked(values, appearance, wanted, weights, reach)
    size = rows * columns
    flat, weight = values.reshape(size, -1), weights.ravel()
    places = np.argwhere(np.ones((rows, columns), dtype=np.bool_)).astype(np.float64)
    features = np.concatenate(
        [appearance.reshape(size, -1) / reach.appearance, places / reach.position], axis=1
    )
    change = np.where(weight[:, np.newaxis] > 0, wanted.reshape(size, -1) - flat, 0.0)
    # Affinities of each pair count once from either side.
    affinity = _affinity(features)
    total = np.asarray(affinity.sum(axis=1)).ravel()
    matrix = (diags_array(total + weight + KEPT) - affinity).tocsr()
    preconditioner = _two_levels(matrix, features)
    found = np.empty_like(flat)
    right = weight[:, np.newaxis] * change
    for channel in range(flat.shape[1]):
        solved, status = cg(
            matrix, right[:, channel], rtol=SOLVED, maxiter=MAX_ITERATIONS, M=preconditioner
        )
        if status:
            raise DataError("expected edits that spread, got equations that were not solved")
        found[:, channel] = solved
    edited: FloatArray = flat + found
    return edited.reshape(values.shape)


def _affinity(features: FloatArray) -> csr_array:
    """Return the symmetric affinities z of texels and their neighbours (n, n)."""
    size = len(features)
    nearest = range(2, min(NEIGHBOURS + 1, size) + 1)
    count = len(nearest)
    if not count:
        return csr_array((size, size))
    found = cKDTree(features).query(features, k=list(nearest), workers=-1)
    distances, neighbours = np.asarray(found[0]), np.asarray(found[1])
    z = np.exp(-(distances**2))
    row = np.repeat(np.arange(size), count)
    one_way = csr_array((z.ravel(), (row, neighbours.ravel())), shape=(size, size))
    return csr_array(one_way + one_way.T)


def _two_levels(matrix: csr_array, features: FloatArray) -> LinearOperator:
    """Return a preconditioner: each texel for itself, and clusters of like texels with each other.

    Without clusters an edit would spread by one neighbour in each iteration.
    """
    size = len(features)
    diagonal = matrix.diagonal()
    # Evenly spread, but in no step with the rows.
    spread = np.arange(min(CLUSTERS, size)) * GOLDEN_RATIO % 1
    nearest = np.asarray(cKDTree(features[(spread * size).astype(np.intp)]).query(features)[1])
    # What is not connected has nothing in common, however near.
    count, component = connected_components(matrix, directed=False)
    found, cluster = np.unique(nearest * count + component, return_inverse=True)
    members = csr_array((np.ones(size), (cluster, np.arange(size))), shape=(len(found), size))
    within = members.T.tocsr()
    coarse = (members @ matrix @ within).toarray()
    inverse = np.linalg.inv(coarse)

    def solve(x: FloatArray) -> FloatArray:
        return np.asarray(x / diagonal + within @ (inverse @ (members @ x)))

    return LinearOperator(matrix.shape, matvec=solve, dtype=np.float64)


def _checked(
    values: FloatArray,
    appearance: FloatArray,
    wanted: FloatArray,
    weights: FloatArray,
    reach: Reach,
) -> tuple[int, int]:
    """Return the size of a texture, whose arrays fit and are proper."""
    if values.ndim != 3 or wanted.shape != values.shape:
        raise UsageError(
            f"expected values and wanted ones of shape (rows, columns, channels), got "
            f"{values.shape} and {wanted.shape}"
        )
    rows, columns = values.shape[:2]
    if weights.shape != (rows, columns) or appearance.shape[:-1] != (rows, columns):
        raise UsageError(
            f"expected weights and appearance of {rows} × {columns} texels, got "
            f"{weights.shape} and {appearance.shape}"
        )
    is_edited = weights > 0
    arrays = (values, appearance, weights, wanted[is_edited])
    if not all(np.isfinite(each).all() for each in arrays):
        raise UsageError("expected finite numbers in a texture and its edits, got NaN or infinity")
    if not (is_edited.any() and weights.min() >= 0 and weights.max() <= 1):
        raise UsageError("expected weights from 0 to 1 and at least one above 0, got others")
    if not (reach.appearance > 0 and reach.position > 0):
        raise UsageError("expected a reach above 0 in appearance and position, got others")
    return rows, columns


#: Part of the picture's height that a stroke is wide at most.
WIDEST = 1.0


class SpreadWish(FrozenModel):
    """Reach of materials around the dots whose own they are.

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
