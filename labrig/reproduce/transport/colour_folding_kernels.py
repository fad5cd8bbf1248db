"""The compiled parts of the fold in three channels; see `colour_folding`."""

import numba
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, Int32Array
from labrig.reproduce.transport.folding_kernels import COMPILED


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def sequences(
    per_target: int,
    first: NDArray[np.int64],
    place: Int32Array,
    weight: Float32Array,
    material_of_place: Int32Array,
    grey: Float32Array,
    number: Int32Array,
    child: Int32Array,
    count: int,
    of_vertex: Int32Array,
    carried: Float32Array,
) -> int:
    """Write the sequence and the factor of each vertex, and new sequences into `child`.

    Returns the number of sequences, -1 if there are too many.
    """
    for path in range(len(first) - 1):
        sequence, factor = 0, np.float32(1) / np.float32(per_target)
        for vertex in range(first[path], first[path + 1]):
            of_vertex[vertex], carried[vertex] = sequence, factor
            material = material_of_place[place[vertex]]
            if material < 0:
                break
            if number[material] < 0:
                factor *= grey[material]
            else:
                if child[sequence, number[material]] < 0:
                    if count == len(child):
                        return -1
                    child[sequence, number[material]] = count
                    count += 1
                sequence = child[sequence, number[material]]
            factor *= weight[vertex]
    return count


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def fold_colours(
    per_target: int,
    first: NDArray[np.int64],
    place: Int32Array,
    light: Float32Array,
    seen_lamp: NDArray[np.int16],
    of_vertex: Int32Array,
    carried: Float32Array,
    material_of_place: Int32Array,
    grey: Float32Array,
    number: Int32Array,
    child: Int32Array,
    colours: Float32Array,
    glow: Float32Array,
    glows: NDArray[np.bool_],
    of_lamps: Float32Array,
    is_on: NDArray[np.bool_],
    result: Float32Array,
) -> None:
    """Write the three channels of each target (targets, 3)."""
    bands, n_lamps = glow.shape[1], len(is_on)
    is_lit = is_on.any()
    for target in range(result.shape[0]):
        red, green, blue = 0.0, 0.0, 0.0
        for path in range(target * per_target, (target + 1) * per_target):
            seen = seen_lamp[path]
            if seen >= 0 and is_on[seen]:
                red += of_lamps[0, seen, 0] / per_target
                green += of_lamps[0, seen, 1] / per_target
                blue += of_lamps[0, seen, 2] / per_target
            for vertex in range(first[path], first[path + 1]):
                here, factor, sequence = place[vertex], carried[vertex], of_vertex[vertex]
                if factor == 0:
                    break
                if glows[here]:
                    own = colours[sequence]
                    r, g, b = np.float32(0), np.float32(0), np.float32(0)
                    for band in range(bands):
                        r += own[0, band] * glow[here, band]
                        g += own[1, band] * glow[here, band]
                        b += own[2, band] * glow[here, band]
                    red += factor * r
                    green += factor * g
                    blue += factor * b
                material = material_of_place[here]
                if material < 0 or not is_lit:
                    continue
                if number[material] < 0:
                    factor *= grey[material]
                else:
                    sequence = child[sequence, number[material]]
                for lamp in range(n_lamps):
                    if is_on[lamp]:
                        part = factor * light[vertex, lamp]
                        red += part * of_lamps[sequence, lamp, 0]
                        green += part * of_lamps[sequence, lamp, 1]
                        blue += part * of_lamps[sequence, lamp, 2]
        result[target, 0], result[target, 1], result[target, 2] = red, green, blue
