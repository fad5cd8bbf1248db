"""Compiled draws of one wavelength of re-radiation given the other, one for each path.

Scalar functions of a path are inlined into loops over paths, so that a draw needs no memory.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

SQRT_2PI, SQRT_HALF = math.sqrt(2 * math.pi), math.sqrt(0.5)
#: One component of a mixture: its factor, its variates of the given and of the other wavelength
#: (see `labrig.material`), and their correlation.
COMPONENT = np.dtype(
    [
        ("factor", "f8"),
        ("given_median", "f8"), ("given_sd", "f8"), ("given_cosh", "f8"), ("given_sinh", "f8"),
        ("other_median", "f8"), ("other_sd", "f8"), ("other_cosh", "f8"), ("other_sinh", "f8"),
        ("correlation", "f8"),
    ]
)  # fmt: skip
# Wichura's algorithm AS 241 (Applied Statistics 37, 1988), PPND16: relative error 1e-16.
A = (
    3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3,
    1.3731693765509461125e4, 4.5921953931549871457e4, 6.7265770927008700853e4,
    3.3430575583588128105e4, 2.5090809287301226727e3,
)  # fmt: skip
B = (
    1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
    2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4,
    5.2264952788528545610e3,
)  # fmt: skip
C = (
    1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0,
    3.64784832476320460504e0, 1.27045825245236838258e0, 2.41780725177450611770e-1,
    2.27238449892691845833e-2, 7.74545014278341407640e-4,
)  # fmt: skip
D = (
    1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1,
    1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4,
    1.05075007164441684324e-9,
)  # fmt: skip
E = (
    6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0,
    2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
    2.71155556874348757815e-5, 2.01033439929228813265e-7,
)  # fmt: skip
F = (
    1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
    7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7,
    2.04426310338993978564e-15,
)  # fmt: skip


class Tables(NamedTuple):
    """What a surface gives back, as seen from a given wavelength.

    Attributes
    ----------
    is_output_given
        Whether the output is given, as of a path from the eye.
    edges_nm, reflectance
        Edges (n + 1,) and reflectance (n,) of bands.
    components
        Components of the mixture that is drawn from, of type `COMPONENT`.
    given_low_nm, given_high_nm, other_low_nm, other_high_nm
        Range of the given wavelength in which there is re-radiation, and of the other.
    overlap_nm
        How far the input may lie above the output: bands of a matrix may reach over the diagonal.
    is_mixture
        Whether the surface re-radiates as the mixture; else as the matrix that follows.
    given_edges_nm, other_edges_nm, reradiation, absolute
        Edges of the matrix's bands; its values (given bands, other bands) in 1/nm of output; and
        the integral of their absolute values over the other wavelength.
    uniform
        Part of the draws that are uniform over the range.
    """

    is_output_given: bool
    edges_nm: FloatArray
    reflectance: FloatArray
    components: Any
    given_low_nm: float
    given_high_nm: float
    other_low_nm: float
    other_high_nm: float
    overlap_nm: float
    is_mixture: bool
    given_edges_nm: FloatArray
    other_edges_nm: FloatArray
    reradiation: FloatArray
    absolute: FloatArray
    uniform: float


COMPILED: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
}


def _njit(function: Any) -> Any:
    return numba.njit(**COMPILED)(function)


def _inner(function: Any) -> Any:
    """Compile a function that only compiled ones call."""
    return numba.njit(no_cpython_wrapper=True, **COMPILED)(function)


@_njit
def draw(
    tables: Tables,
    given_nm: FloatArray,
    random: FloatArray,
    wavelength_nm: FloatArray,
    weight: FloatArray,
    is_reflected: NDArray[np.bool_],
) -> None:
    """Write, for each given wavelength (n,), another, its weight and whether they are the same.

    Parameters
    ----------
    tables
        The surface.
    given_nm
        Given wavelengths.
    random
        Uniform random numbers from 0 to below 1, shape (3, n).
    wavelength_nm, weight, is_reflected
        Results (n,).
    """
    mass = np.empty(len(tables.components))
    for n in range(len(given_nm)):
        given = given_nm[n]
        low, high = _range(tables, given)
        mixed = _masses(tables, given, low, high, mass)
        reflected = _at(tables.edges_nm, tables.reflectance, given)
        shifted = _selection(tables, given, low, high, mixed)
        total = abs(reflected) + shifted
        # A surface that is black at this wavelength gives back nothing.
        if total == 0 or random[0, n] * total < abs(reflected):
            wavelength_nm[n], is_reflected[n] = given, True
            weight[n] = math.copysign(total, reflected)
            continue
        is_reflected[n] = False
        uniform = _uniform(tables, mixed)
        if random[1, n] < uniform:
            other = low + random[2, n] * (high - low)
        else:
            select = (random[1, n] - uniform) / (1 - uniform) * mixed
            chosen = _reached(mass, select)
            other = _inverted(tables.components[chosen], given, low, high, random[2, n])
        wavelength_nm[n] = other
        if tables.is_mixture:
            weight[n] = total
            continue
        pdf = _pdf(tables, given, other, low, high, mixed)
        weight[n] = _matrix(tables, given, other) / pdf * (total / shifted)


@_njit
def densities(
    tables: Tables, given_nm: FloatArray, other_nm: FloatArray, pdf: FloatArray, value: FloatArray
) -> None:
    """Write the density of a shift to each other wavelength in 1/nm, and the re-radiation (n,)."""
    mass = np.empty(len(tables.components))
    for n in range(len(given_nm)):
        given, other = given_nm[n], other_nm[n]
        low, high = _range(tables, given)
        pdf[n] = value[n] = 0.0
        if not low <= other <= high:
            continue
        mixed = _masses(tables, given, low, high, mass)
        if _selection(tables, given, low, high, mixed) > 0:
            pdf[n] = _pdf(tables, given, other, low, high, mixed)
        if tables.is_mixture:
            value[n] = _joint(tables, given, other)
        else:
            value[n] = _matrix(tables, given, other)


@_njit
def parts(tables: Tables, given_nm: FloatArray, reflected: FloatArray, shifted: FloatArray) -> None:
    """Write the reflectance, and what a shift is selected by, of each given wavelength (n,)."""
    mass = np.empty(len(tables.components))
    for n in range(len(given_nm)):
        given = given_nm[n]
        low, high = _range(tables, given)
        mixed = _masses(tables, given, low, high, mass)
        reflected[n] = _at(tables.edges_nm, tables.reflectance, given)
        shifted[n] = _selection(tables, given, low, high, mixed)


@_inner
def _range(tables: Tables, given: float) -> Any:
    """Return the range of the other wavelength on the Stokes side; empty if high ≤ low."""
    low, high = tables.other_low_nm, tables.other_high_nm
    if not tables.given_low_nm <= given <= tables.given_high_nm:
        return low, low
    if tables.is_output_given:
        return low, min(high, given + tables.overlap_nm)
    return max(low, given - tables.overlap_nm), high


@_inner
def _masses(tables: Tables, given: float, low: float, high: float, mass: FloatArray) -> float:
    """Write each component's integral over the range, and return their sum."""
    total = 0.0
    for k in range(len(mass)):
        mass[k] = 0.0
        if high > low:
            c = tables.components[k]
            u = _variate(given, c.given_median, c.given_sd, c.given_cosh, c.given_sinh)
            first, last = _cuts(c, u, low, high)
            rate = _rate(given, c.given_median, c.given_sd, c.given_cosh, c.given_sinh)
            peak = c.factor * math.exp(-0.5 * u * u) / SQRT_2PI * rate
            if first > 0:
                mass[k] = peak * (_below(-first) - _below(-last))
            else:
                mass[k] = peak * (_below(last) - _below(first))
        total += mass[k]
    return total


@_inner
def _selection(tables: Tables, given: float, low: float, high: float, mixed: float) -> float:
    """Return by what a shift is selected: the integral of what is re-radiated, signs left out."""
    if tables.is_mixture:
        return mixed
    if high <= low:
        return 0.0
    return float(_at(tables.given_edges_nm, tables.absolute, given))


@_inner
def _uniform(tables: Tables, mixed: float) -> float:
    """Return the part of uniform draws: all if no component reaches the given wavelength."""
    return tables.uniform if mixed > 0 else 1.0


@_inner
def _pdf(
    tables: Tables, given: float, other: float, low: float, high: float, mixed: float
) -> float:
    uniform = _uniform(tables, mixed)
    density = uniform / (high - low)
    if uniform < 1:
        density += (1 - uniform) * _joint(tables, given, other) / mixed
    return float(density)


@_inner
def _joint(tables: Tables, given: float, other: float) -> float:
    """Return the mixture's density times its scale, in 1/nm of output."""
    total = 0.0
    for k in range(len(tables.components)):
        c = tables.components[k]
        u = _variate(given, c.given_median, c.given_sd, c.given_cosh, c.given_sinh)
        v = _variate(other, c.other_median, c.other_sd, c.other_cosh, c.other_sinh)
        sd2 = (1 - c.correlation) * (1 + c.correlation)
        excess = v - c.correlation * u
        rates = _rate(given, c.given_median, c.given_sd, c.given_cosh, c.given_sinh)
        rates *= _rate(other, c.other_median, c.other_sd, c.other_cosh, c.other_sinh)
        exponent = -0.5 * (u * u + excess * excess / sd2)
        total += c.factor * rates / (2 * math.pi * math.sqrt(sd2)) * math.exp(exponent)
    return total


@_inner
def _matrix(tables: Tables, given: float, other: float) -> float:
    """Return the matrix's re-radiation in 1/nm of output; none outside of its bands."""
    row = _band(tables.given_edges_nm, given)
    column = _band(tables.other_edges_nm, other)
    if row < 0 or column < 0:
        return 0.0
    return float(tables.reradiation[row, column])


@_inner
def _reached(mass: FloatArray, select: float) -> int:
    """Return the component at which the running sum exceeds `select`, one that is not empty."""
    running, chosen = 0.0, 0
    for k in range(len(mass)):
        if mass[k] > 0:
            chosen = k
            running += mass[k]
            if running > select:
                break
    return chosen


@_inner
def _inverted(c: Any, given: float, low: float, high: float, probability: float) -> float:
    """Return the wavelength at a probability of one component between two others."""
    u = _variate(given, c.given_median, c.given_sd, c.given_cosh, c.given_sinh)
    first, last = _cuts(c, u, low, high)
    if first > 0:
        tail = _below(-first)
        z = -_quantile(tail - probability * (tail - _below(-last)))
    else:
        tail = _below(first)
        z = _quantile(tail + probability * (_below(last) - tail))
    z = min(max(z, first), last)
    v = c.correlation * u + math.sqrt((1 - c.correlation) * (1 + c.correlation)) * z
    y = c.other_cosh * v + c.other_sinh * math.sqrt(1 + v * v)
    other = c.other_median + c.other_sd * (y - c.other_sinh) / c.other_cosh
    return float(min(max(other, low), high))


@_inner
def _cuts(c: Any, u: float, low: float, high: float) -> Any:
    """Return the ends of the range in the standard variate of the other wavelength, given u."""
    sd = math.sqrt((1 - c.correlation) * (1 + c.correlation))
    first = _variate(low, c.other_median, c.other_sd, c.other_cosh, c.other_sinh)
    last = _variate(high, c.other_median, c.other_sd, c.other_cosh, c.other_sinh)
    return (first - c.correlation * u) / sd, (last - c.correlation * u) / sd


@_inner
def _variate(nm: float, median: float, sd: float, cosh: float, sinh: float) -> float:
    y = (nm - median) / sd * cosh + sinh
    return y * cosh - math.sqrt(1 + y * y) * sinh


@_inner
def _rate(nm: float, median: float, sd: float, cosh: float, sinh: float) -> float:
    """Return the derivative of the variate by the wavelength in 1/nm."""
    y = (nm - median) / sd * cosh + sinh
    return cosh * (cosh - sinh * y / math.sqrt(1 + y * y)) / sd


@_inner
def _at(edges: FloatArray, values: FloatArray, nm: float) -> float:
    band = _band(edges, nm)
    return 0.0 if band < 0 else float(values[band])


@_inner
def _band(edges: FloatArray, nm: float) -> int:
    """Return the band of a wavelength, its lower edge included; −1 outside of all."""
    if nm == edges[-1]:
        return len(edges) - 2
    low, high = 0, len(edges)
    while low < high:
        middle = (low + high) // 2
        if edges[middle] <= nm:
            low = middle + 1
        else:
            high = middle
    return low - 1 if low < len(edges) else -1


@_inner
def _below(x: float) -> float:
    """Return the standard normal distribution function."""
    return 0.5 * math.erfc(-x * SQRT_HALF)


@_inner
def _quantile(p: float) -> float:
    """Return where the standard normal distribution function is `p`; infinite at 0 and 1."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return float(q * _ratio(A, B, r))
    tail = min(p, 1 - p)
    if tail <= 0:
        return math.copysign(math.inf, q)
    r = math.sqrt(-math.log(tail))
    z = _ratio(C, D, r - 1.6) if r <= 5 else _ratio(E, F, r - 5)
    return math.copysign(z, q)


@_inner
def _ratio(numerator: Any, denominator: Any, x: float) -> float:
    above, below = 0.0, 0.0
    for k in range(7, -1, -1):
        above = above * x + numerator[k]
        below = below * x + denominator[k]
    return above / below
