"""The compiled folds of paths, in all bands and in three channels."""

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, Int32Array

COMPILED: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "fastmath": {"nsz", "contract", "reassoc"},
    "no_cfunc_wrapper": True,
}


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def fold_paths(
    per_target: int,
    first: NDArray[np.int64],
    place: Int32Array,
    weight: Float32Array,
    light: Float32Array,
    seen_lamp: NDArray[np.int16],
    matrices: Float32Array,
    row_first: Int32Array,
    row_last: Int32Array,
    is_diagonal: NDArray[np.bool_],
    material_of_place: Int32Array,
    albedo_factor: Float32Array,
    glow: Float32Array,
    lamps: Float32Array,
    incident: bool,
    result: Float32Array,
) -> None:
    """Write the mean light of the paths of each target; see `folding.fold` for the arguments.

    Parameters
    ----------
    per_target, first, place, weight, light, seen_lamp
        The paths.
    matrices, row_first, row_last, is_diagonal, material_of_place, albedo_factor
        Matrices (materials, bands in, bands out), of which place each is, and its factor there.
    glow, lamps
        Glow (places, bands) and lamps (lamps, bands).
    incident
        Whether the irradiance at the first vertex is wanted.
    result
        What is written (targets, bands).
    """
    bands, n_lamps = glow.shape[1], lamps.shape[0]
    radiance = np.empty(bands, np.float32)
    coming = np.empty(bands, np.float32)
    total = np.empty(bands, np.float64)
    for target in range(result.shape[0]):
        total[:] = 0.0
        for path in range(target * per_target, (target + 1) * per_target):
            radiance[:] = np.float32(0)
            begin = first[path]
            for vertex in range(first[path + 1] - 1, begin - 1, -1):
                own_weight = weight[vertex]
                for band in range(bands):
                    coming[band] = own_weight * radiance[band]
                for lamp in range(n_lamps):
                    factor = light[vertex, lamp]
                    if factor != 0:
                        for band in range(bands):
                            coming[band] += factor * lamps[lamp, band]
                if incident and vertex == begin:
                    for band in range(bands):
                        radiance[band] = np.float32(math.pi) * coming[band]
                    break
                here = place[vertex]
                material = material_of_place[here]
                for band in range(bands):
                    radiance[band] = glow[here, band]
                if material < 0:
                    continue
                if albedo_factor[here] != 1:
                    for band in range(bands):
                        coming[band] *= albedo_factor[here]
                if is_diagonal[material]:
                    for band in range(bands):
                        radiance[band] += matrices[material, band, band] * coming[band]
                    continue
                for source in range(bands):
                    strength = coming[source]
                    if strength == 0:
                        continue
                    low, high = row_first[material, source], row_last[material, source]
                    column = matrices[material, source]
                    for band in range(low, high):
                        radiance[band] += column[band] * strength
            if seen_lamp[path] >= 0:
                for band in range(bands):
                    radiance[band] += lamps[seen_lamp[path], band]
            for band in range(bands):
                total[band] += radiance[band]
        for band in range(bands):
            result[target, band] = total[band] / per_target


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
