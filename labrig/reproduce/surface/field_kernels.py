"""Compiled steps of many samples, a chunk of which stays in the cache; one pass over memory.

Arrays have the samples last, so that neighbouring samples are computed together.
"""

import math
from typing import Any

import numba
import numpy as np

from labrig.foundation.arrays import Float32Array

#: Samples whose intermediate values stay in the first cache.
CHUNK = 2048
#: Sums may be reordered; values are finite.
FAST = {"nnan", "ninf", "nsz", "contract", "reassoc", "arcp"}
COMPILED: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "fastmath": FAST,
    "no_cfunc_wrapper": True,
}
#: Functions that only compiled ones call.
INNER = COMPILED | {"no_cpython_wrapper": True}
HALF, ONE, TINY = np.float32(0.5), np.float32(1), np.float32(1e-30)
LOG2_E, LARGEST = np.float32(1.4426950408889634), np.float32(125)
#: Taylor's series of 2ˣ from the seventh power down, for |x| ≤ 1/2: errs by 1e-8.
C7, C6, C5, C4, C3, C2, C1 = (
    np.float32(math.log(2) ** n / math.factorial(n)) for n in range(7, 0, -1)
)
ZERO_EXPONENT, MANTISSA_BITS = np.int32(127), np.int32(23)
INFINITY_BITS = np.uint32(0x7F800000)


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def step_first_order(
    levels: Float32Array,
    irradiance: Float32Array,
    k_e: Float32Array,
    base: Float32Array,
    k_r: Float32Array,
    duration: np.float32,
    first: int,
    last: int,
) -> bool:
    """Advance levels (states, n) of samples `first` to `last` by exact steps of constant light.

    Return whether the light is finite and not negative; samples that follow are not advanced else.

    Parameters
    ----------
    levels
        Levels, which are replaced.
    irradiance, k_e
        Irradiance (bands, n), and excitation rates (states, bands, 1 or n).
    base
        Excitation in 1/s that all samples have besides (states,).
    k_r
        Re-radiation rates in 1/s (states, 1 or n).
    duration
        Length of the step in seconds.
    first, last
        Range of the samples.
    """
    kappa = np.empty(CHUNK, np.float32)
    rate = np.empty(CHUNK, np.float32)
    power = np.empty(CHUNK, np.float32)
    bits = power.view(np.int32)
    for begin in range(first, last, CHUNK):
        size = min(CHUNK, last - begin)
        for state in range(levels.shape[0]):
            if not _excite(kappa, irradiance, k_e, base, state, duration, begin, size):
                return False
            if k_r.shape[1] == 1:
                phase = k_r[state, 0] * duration
                for s in range(size):
                    rate[s] = kappa[s] + phase
            else:
                own = k_r[state, begin : begin + size]
                for s in range(size):
                    rate[s] = kappa[s] + own[s] * duration
            # e^(−x) = 2^(−n) 2^(n − x log₂e): the first factor is the exponent's bits. Of a short
            # step, n = 0, e^(−x) − 1 is taken, or the same rounding in every step would add up. The
            # loops are apart, or the compiler computes the samples one by one.
            for s in range(size):
                bits[s] = np.int32(min(rate[s] * LOG2_E, LARGEST) + HALF)
            level = levels[state, begin : begin + size]
            for s in range(size):
                n = bits[s]
                x = np.float32(n) - min(rate[s] * LOG2_E, LARGEST)
                p = C7
                p = p * x + C6
                p = p * x + C5
                p = p * x + C4
                p = p * x + C3
                p = p * x + C2
                p = (p * x + C1) * x
                bits[s] = (ZERO_EXPONENT - n) << MANTISSA_BITS
                steady = kappa[s] / (rate[s] + TINY)
                whole = np.float32(0) if n == 0 else power[s]
                begin_at = level[s] if n == 0 else steady
                level[s] = begin_at + (level[s] - steady) * (p * power[s] + whole)
    return True


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def step_by_table(
    levels: Float32Array,
    irradiance: Float32Array,
    k_e: Float32Array,
    base: Float32Array,
    state: int,
    table: Float32Array,
    compression: np.float32,
    root: np.float32,
    duration: np.float32,
    first: int,
    last: int,
) -> bool:
    """Advance the levels of one state of general order by its `OrderTable`.

    The other parameters and the result are those of `step_first_order`.
    """
    kappa = np.empty(CHUNK, np.float32)
    cells = np.float32(table.shape[0] - 1)
    for begin in range(first, last, CHUNK):
        size = min(CHUNK, last - begin)
        if not _excite(kappa, irradiance, k_e, base, state, duration, begin, size):
            return False
        level = levels[state, begin : begin + size]
        for s in range(size):
            r = level[s]
            x = r * (ONE + compression) / (ONE + compression * r)
            dose = math.sqrt(kappa[s]) if root == np.float32(0.5) else kappa[s] ** root
            u = dose / (ONE + dose)
            level[s] = _interpolated(table, x * cells, u * cells)
    return True


@numba.njit(**COMPILED)  # type: ignore[untyped-decorator]
def excitation(
    kappa: Float32Array,
    irradiance: Float32Array,
    k_e: Float32Array,
    base: Float32Array,
    state: int,
    first: int,
    last: int,
) -> bool:
    """Write κ of a state (n,) in 1/s; parameters and result are those of `step_first_order`."""
    chunk = np.empty(CHUNK, np.float32)
    for begin in range(first, last, CHUNK):
        size = min(CHUNK, last - begin)
        if not _excite(chunk, irradiance, k_e, base, state, ONE, begin, size):
            return False
        for s in range(size):
            kappa[begin + s] = chunk[s]
    return True


@numba.njit(**INNER)  # type: ignore[untyped-decorator]
def _excite(
    kappa: Float32Array,
    irradiance: Float32Array,
    k_e: Float32Array,
    base: Float32Array,
    state: int,
    duration: np.float32,
    begin: int,
    size: int,
) -> bool:
    """Write κ Δt of the samples from `begin` on into a chunk; return whether it is proper."""
    constant = base[state] * duration
    for s in range(size):
        kappa[s] = constant
    for band in range(irradiance.shape[0]):
        light = irradiance[band, begin : begin + size]
        if k_e.shape[2] == 1:
            factor = k_e[state, band, 0] * duration
            for s in range(size):
                kappa[s] += factor * light[s]
        else:
            own = k_e[state, band, begin : begin + size]
            for s in range(size):
                kappa[s] += own[s] * duration * light[s]
    # The bits of finite numbers that are not negative are the smaller half of all.
    bits, largest = kappa.view(np.uint32), np.uint32(0)
    for s in range(size):
        largest = max(largest, bits[s])
    return bool(largest < INFINITY_BITS)


@numba.njit(inline="always", **INNER)  # type: ignore[untyped-decorator]
def _interpolated(table: Any, x: Any, y: Any) -> Any:
    """Return the cubic through the four by four nearest nodes."""
    most = table.shape[0] - 4
    i = min(max(int(x) - 1, 0), most)
    j = min(max(int(y) - 1, 0), most)
    a, b = x - np.float32(i), y - np.float32(j)
    total = np.float32(0)
    for m in range(4):
        total += _weight(a, m) * (
            _weight(b, 0) * table[i + m, j]
            + _weight(b, 1) * table[i + m, j + 1]
            + _weight(b, 2) * table[i + m, j + 2]
            + _weight(b, 3) * table[i + m, j + 3]
        )
    return min(max(total, np.float32(0)), ONE)


@numba.njit(inline="always", **INNER)  # type: ignore[untyped-decorator]
def _weight(x: Any, node: Any) -> Any:
    """Return Lagrange's polynomial of a node 0 to 3 at a place."""
    if node == 0:
        return -(x - ONE) * (x - np.float32(2)) * (x - np.float32(3)) / np.float32(6)
    if node == 1:
        return x * (x - np.float32(2)) * (x - np.float32(3)) / np.float32(2)
    if node == 2:
        return -x * (x - ONE) * (x - np.float32(3)) / np.float32(2)
    return x * (x - ONE) * (x - np.float32(2)) / np.float32(6)
