"""How well the keys determine a design's parameters, and which keys work against which.

Both follow from the curvature of the sum of squares at its minimum, with all parameters free at
once. What changes no key is not determined.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

#: Singular value, relative to the largest, below which a combination of parameters changes no key.
NO_EFFECT = 1e-9
#: Derivative below which nothing depends on a parameter.
LEAST = 1e-100
#: Part of a parameter in such combinations from which it is not determined.
PART_UNKNOWN = 1e-4
#: Relative σ of a rate, and of Λ to its largest value, from which it is not determined.
POOR = 0.3
#: σ of an albedo from which it is not determined.
POOR_ALBEDO = 0.15
#: Conflicts that are named, and the ΔE2000 from which a key is seen not to be met.
MAX_CONFLICTS, SEEN = 3, 1.0
#: Part of a key's own squares that another key has to cost it to be said to work against it.
WORTH_SAYING = 0.2


@dataclass(frozen=True)
class Estimate:
    """One parameter of a design.

    Attributes
    ----------
    name
        What it is, such as `k_r 1`.
    value
        Its value.
    sigma
        Its σ if every key is meant to the stated relative σ, or to that with which they are met if
        it is larger; infinite if no key depends on it.
    unit
        Its unit.
    is_determined
        Whether the keys determine it: rates to 30 %, Λ to 30 % of its largest value, an albedo to
        0.15.
    """

    name: str
    value: float
    sigma: float
    unit: str
    is_determined: bool


@dataclass(frozen=True)
class Conflict:
    """Two keys that cannot both be met.

    Attributes
    ----------
    key, other
        Indices of the keys.
    part
        Part of the squared residual of `other` that would go if `key` were left out, to first
        order, up to 1.
    """

    key: int
    other: int
    part: float


def covariance(jacobian: FloatArray) -> FloatArray:
    """Return the covariance of parameters for residuals of unit σ; infinite where undetermined."""
    lengths = np.linalg.norm(jacobian, axis=0)
    # The inverse square of what is less would be no number.
    lengths = np.where(lengths > LEAST, lengths, 0.0)
    scaled = np.where(lengths > 0, jacobian, 0.0) / np.where(lengths > 0, lengths, 1.0)
    _, singular, turned = np.linalg.svd(scaled, full_matrices=True)
    sizes = np.zeros(len(turned))
    sizes[: len(singular)] = singular
    known = sizes > NO_EFFECT * max(float(sizes.max(initial=0.0)), LEAST)
    inverse = turned[known].T / sizes[known]
    found = inverse @ inverse.T
    unknown = (turned[~known] ** 2).sum(axis=0) > PART_UNKNOWN
    unknown |= lengths == 0
    scales = np.where(lengths > 0, lengths, 1.0)
    found = found / np.outer(scales, scales)
    found[unknown, unknown] = np.inf
    return np.asarray(found)


def conflicts(
    residuals: FloatArray, jacobian: FloatArray, key_of_row: NDArray[np.intp]
) -> tuple[Conflict, ...]:
    """Return which keys cost which others most of their residual, the largest first.

    Without a key the others would be met better by a step that follows from the Jacobian without
    its rows.

    Parameters
    ----------
    residuals
        Residuals at the minimum, shape (rows,).
    jacobian
        Their derivatives by the parameters that lie at no bound, shape (rows, p).
    key_of_row
        The key of each row, shape (rows,).
    """
    n_keys = int(key_of_row.max()) + 1
    lengths = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian[:, lengths > 0] / lengths[lengths > 0]
    total = scaled.T @ scaled
    squares = np.bincount(key_of_row, residuals**2, n_keys)
    negligible = NO_EFFECT * squares.sum()
    found = []
    for key in np.flatnonzero(squares > negligible):
        rows = key_of_row == key
        own = scaled[rows]
        step = np.linalg.pinv(total - own.T @ own, rcond=NO_EFFECT, hermitian=True) @ (
            own.T @ residuals[rows]
        )
        changed = np.bincount(key_of_row, (residuals + scaled @ step) ** 2, n_keys)
        gains = np.where(squares > negligible, 1 - changed / np.maximum(squares, negligible), 0)
        gains[key] = 0
        found += [
            Conflict(int(key), int(other), float(gains[other]))
            for other in np.flatnonzero(gains > WORTH_SAYING)
        ]
    return tuple(sorted(found, key=lambda conflict: -conflict.part))


def visible_conflicts(found: Sequence[Conflict], delta_e2000: FloatArray) -> tuple[Conflict, ...]:
    """Return the worst conflicts that cost a key a difference that is seen, each pair once.

    Parameters
    ----------
    found
        Conflicts, the worst first.
    delta_e2000
        ΔE2000 of all keys, shape (keys,).

    Returns
    -------
    tuple of Conflict
        At most three.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import Conflict, visible_conflicts
    >>> both = Conflict(key=0, other=1, part=0.9), Conflict(key=1, other=0, part=0.8)
    >>> [conflict.part for conflict in visible_conflicts(both, np.array([2.0, 3.0]))]
    [0.9]
    >>> visible_conflicts(both, np.array([0.1, 0.2]))
    ()
    """
    pairs: dict[frozenset[int], Conflict] = {}
    for conflict in found:
        if delta_e2000[conflict.other] >= SEEN:
            pairs.setdefault(frozenset((conflict.key, conflict.other)), conflict)
    return tuple(pairs.values())[:MAX_CONFLICTS]
