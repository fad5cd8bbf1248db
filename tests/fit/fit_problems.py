"""Least-squares problems with bad starts: the classical ones, and generated ones."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from labrig.foundation.arrays import FloatArray
from tests.fit.strd import ComplexArray

STEP = 1e-200


@dataclass(frozen=True)
class Problem:
    """Residuals, analytic in the parameters, and where a fit is to begin.

    Attributes
    ----------
    name, kind
        What it is, and the sort of problem it is counted with.
    function
        Parameters (p,) → residuals (m,).
    start, lower, upper
        Start and bounds, shape (p,).
    truth
        Parameters at or near the least χ², from which it may be found, shape (p,); None if unknown.
    """

    name: str
    kind: str
    function: Callable[[ComplexArray], ComplexArray]
    start: FloatArray
    lower: FloatArray
    upper: FloatArray
    truth: FloatArray | None = None

    def residuals(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the residuals and their Jacobian by a complex step, exact to rounding."""
        r = np.real(self.function(x.astype(np.complex128)))
        jacobian = np.empty((len(r), len(x)))
        for j in range(len(x)):
            shifted = x.astype(np.complex128)
            shifted[j] += 1j * STEP
            jacobian[:, j] = np.imag(self.function(shifted)) / STEP
        return r, jacobian


def _free(
    name: str,
    kind: str,
    function: Callable[[ComplexArray], ComplexArray],
    start: FloatArray,
    truth: FloatArray | None = None,
) -> Problem:
    unbounded = np.full(len(start), np.inf)
    return Problem(name, kind, function, start, -unbounded, unbounded, truth)


def _numbers(text: str) -> FloatArray:
    return np.array(text.split(), dtype=np.float64)


_BARD_Y = _numbers("""
    0.14 0.18 0.22 0.25 0.29 0.32 0.35 0.39 0.37 0.58 0.73 0.96 1.34 2.10 4.39
""")
_KOWALIK_Y = _numbers("""
    0.1957 0.1947 0.1735 0.1600 0.0844 0.0627 0.0456 0.0342 0.0323 0.0235 0.0246
""")
_KOWALIK_U = _numbers("""
    4 2 1 0.5 0.25 0.167 0.125 0.1 0.0833 0.0714 0.0625
""")
_MEYER_Y = _numbers("""
    34780 28610 23650 19630 16370 13720 11540 9744 8261 7030 6005 5147 4427 3820 3307 2872
""")
_OSBORNE_1_Y = _numbers("""
    0.844 0.908 0.932 0.936 0.925 0.908 0.881 0.850 0.818 0.784 0.751 0.718 0.685 0.658 0.628
    0.603 0.580 0.558 0.538 0.522 0.506 0.490 0.478 0.467 0.457 0.448 0.438 0.431 0.424 0.420
    0.414 0.411 0.406
""")
_OSBORNE_2_Y = _numbers("""
    1.366 1.191 1.112 1.013 0.991 0.885 0.831 0.847 0.786 0.725 0.746 0.679 0.608 0.655 0.616
    0.606 0.602 0.626 0.651 0.724 0.649 0.649 0.694 0.644 0.624 0.661 0.612 0.558 0.533 0.495
    0.500 0.423 0.395 0.375 0.372 0.391 0.396 0.405 0.428 0.429 0.523 0.562 0.607 0.653 0.672
    0.708 0.633 0.668 0.645 0.632 0.591 0.559 0.597 0.625 0.739 0.710 0.729 0.720 0.636 0.581
    0.428 0.292 0.162 0.098 0.054
""")


def _bard(x: ComplexArray) -> ComplexArray:
    u = np.arange(1.0, 16.0)
    return np.asarray(_BARD_Y - (x[0] + u / (x[1] * (16 - u) + x[2] * np.minimum(u, 16 - u))))


def _kowalik_osborne(x: ComplexArray) -> ComplexArray:
    u = _KOWALIK_U
    return np.asarray(_KOWALIK_Y - x[0] * (u * u + u * x[1]) / (u * u + u * x[2] + x[3]))


def _meyer(x: ComplexArray) -> ComplexArray:
    return np.asarray(x[0] * np.exp(x[1] / (45.0 + 5 * np.arange(1.0, 17.0) + x[2])) - _MEYER_Y)


def _osborne_1(x: ComplexArray) -> ComplexArray:
    t = 10.0 * np.arange(33)
    return np.asarray(_OSBORNE_1_Y - (x[0] + x[1] * np.exp(-x[3] * t) + x[2] * np.exp(-x[4] * t)))


def _osborne_2(x: ComplexArray) -> ComplexArray:
    t = np.arange(65) / 10
    peaks = sum(x[k] * np.exp(-((t - x[k + 7]) ** 2) * x[k + 4]) for k in (1, 2, 3))
    return np.asarray(_OSBORNE_2_Y - (x[0] * np.exp(-x[4] * t) + peaks))


def _box_3d(x: ComplexArray) -> ComplexArray:
    t = np.arange(1.0, 11.0) / 10
    return np.asarray(np.exp(-t * x[0]) - np.exp(-t * x[1]) - x[2] * (np.exp(-t) - np.exp(-10 * t)))


def _biggs(x: ComplexArray) -> ComplexArray:
    t = np.arange(1.0, 14.0) / 10
    y = np.exp(-t) - 5 * np.exp(-10 * t) + 3 * np.exp(-4 * t)
    return np.asarray(
        x[2] * np.exp(-t * x[0]) - x[3] * np.exp(-t * x[1]) + x[5] * np.exp(-t * x[4]) - y
    )


def _brown_dennis(x: ComplexArray) -> ComplexArray:
    t = np.arange(1.0, 21.0) / 5
    return np.asarray(
        (x[0] + t * x[1] - np.exp(t)) ** 2 + (x[2] + x[3] * np.sin(t) - np.cos(t)) ** 2
    )


def _jennrich_sampson(x: ComplexArray) -> ComplexArray:
    i = np.arange(1.0, 11.0)
    return np.asarray(2 + 2 * i - (np.exp(i * x[0]) + np.exp(i * x[1])))


def _helical_valley(x: ComplexArray) -> ComplexArray:
    turn = np.arctan(x[1] / x[0]) / (2 * np.pi) + (0.5 if x[0].real < 0 else 0.0)
    return np.array([10 * (x[2] - 10 * turn), 10 * (np.sqrt(x[0] ** 2 + x[1] ** 2) - 1), x[2]])


#: Name → function, standard start, minimiser if it is known exactly (Moré, Garbow and Hillstrom,
#: *Testing unconstrained optimization software*, ACM TOMS 7, 1981).
CLASSICAL: dict[
    str, tuple[Callable[[ComplexArray], ComplexArray], list[float], list[float] | None]
] = {
    "Rosenbrock": (
        lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        [-1.2, 1.0],
        [1.0, 1.0],
    ),
    "Freudenstein-Roth": (
        lambda x: np.array(
            [
                -13 + x[0] + ((5 - x[1]) * x[1] - 2) * x[1],
                -29 + x[0] + ((x[1] + 1) * x[1] - 14) * x[1],
            ]
        ),
        [0.5, -2.0],
        [5.0, 4.0],
    ),
    "Powell badly scaled": (
        lambda x: np.array([1e4 * x[0] * x[1] - 1, np.exp(-x[0]) + np.exp(-x[1]) - 1.0001]),
        [0.0, 1.0],
        [1.0981593296999e-5, 9.106146739867],
    ),
    "Brown badly scaled": (
        lambda x: np.array([x[0] - 1e6, x[1] - 2e-6, x[0] * x[1] - 2]),
        [1.0, 1.0],
        [1e6, 2e-6],
    ),
    "Beale": (
        lambda x: np.array(
            [y - x[0] * (1 - x[1] ** k) for k, y in ((1, 1.5), (2, 2.25), (3, 2.625))]
        ),
        [1.0, 1.0],
        [3.0, 0.5],
    ),
    "Jennrich-Sampson": (_jennrich_sampson, [0.3, 0.4], [0.2578, 0.2578]),
    "Helical valley": (_helical_valley, [-1.0, 0.1, 0.1], [1.0, 1e-9, 0.0]),
    "Bard": (_bard, [1.0, 1.0, 1.0], [0.08241, 1.133, 2.3437]),
    "Meyer": (_meyer, [0.02, 4000.0, 250.0], [0.00561, 6181.35, 345.22]),
    "Box 3D": (_box_3d, [0.0, 10.0, 20.0], [1.0, 10.0, 1.0]),
    "Powell singular": (
        lambda x: np.array(
            [
                x[0] + 10 * x[1],
                np.sqrt(5) * (x[2] - x[3]),
                (x[1] - 2 * x[2]) ** 2,
                np.sqrt(10) * (x[0] - x[3]) ** 2,
            ]
        ),
        [3.0, -1.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0],
    ),
    "Wood": (
        lambda x: np.array(
            [
                10 * (x[1] - x[0] ** 2),
                1 - x[0],
                np.sqrt(90) * (x[3] - x[2] ** 2),
                1 - x[2],
                np.sqrt(10) * (x[1] + x[3] - 2),
                (x[1] - x[3]) / np.sqrt(10),
            ]
        ),
        [-3.0, -1.0, -3.0, -1.0],
        [1.0, 1.0, 1.0, 1.0],
    ),
    "Kowalik-Osborne": (
        _kowalik_osborne,
        [0.25, 0.39, 0.415, 0.39],
        [0.1928, 0.1913, 0.1231, 0.1361],
    ),
    "Brown-Dennis": (_brown_dennis, [25.0, 5.0, -5.0, -1.0], [-11.594, 13.204, -0.4034, 0.2368]),
    "Osborne 1": (
        _osborne_1,
        [0.5, 1.5, -1.0, 0.01, 0.02],
        [0.3754, 1.9358, -1.4647, 0.01287, 0.02212],
    ),
    "Biggs EXP6": (_biggs, [1.0, 2.0, 1.0, 1.0, 1.0, 1.0], [1.0, 10.0, 1.0, 5.0, 4.0, 3.0]),
    "Osborne 2": (
        _osborne_2,
        [1.3, 0.65, 0.65, 0.7, 0.6, 3.0, 5.0, 7.0, 2.0, 4.5, 5.5],
        [1.31, 0.4315, 0.6336, 0.5993, 0.7539, 0.9056, 1.3651, 4.8248, 2.3988, 4.5689, 5.6754],
    ),
}


def classical(factors: tuple[float, ...] = (1.0, 10.0, 100.0)) -> Iterator[Problem]:
    """Return the classical problems from their standard starts and from multiples of them."""
    for (name, (function, start, truth)), factor in product(CLASSICAL.items(), factors):
        at = None if truth is None else np.array(truth)
        yield _free(f"{name} x {factor:g}", "classical", function, factor * np.array(start), at)


#: Times or wavelengths at which generated models are compared with generated data.
PLACES = np.linspace(0.05, 4.0, 40)
#: Largest power of ten by which a start is off.
FARTHEST = 6.0
NOISES = (0.0, 1e-3, 0.03)


def _exponentials(x: ComplexArray) -> ComplexArray:
    return np.exp(-np.multiply.outer(PLACES, x[1::2])) @ x[0::2]


def _log_exponentials(x: ComplexArray) -> ComplexArray:
    return np.exp(-np.multiply.outer(PLACES, np.exp(x[1::2]))) @ x[0::2]


def _rational(x: ComplexArray) -> ComplexArray:
    return np.asarray((x[0] + x[1] * PLACES) / (1 + x[2] * PLACES + x[3] * PLACES**2))


def _power_law(x: ComplexArray) -> ComplexArray:
    return np.asarray(x[0] * (1 + np.exp(x[1]) * PLACES) ** -x[2])


def _peak(x: ComplexArray) -> ComplexArray:
    return np.asarray(x[0] * np.exp(-(((PLACES - x[1]) / x[2]) ** 2)) + x[3])


def _logistic(x: ComplexArray) -> ComplexArray:
    return np.asarray(x[0] / (1 + np.exp(x[1] - x[2] * PLACES)))


def _product(x: ComplexArray) -> ComplexArray:
    """Return a decay whose amplitude is a product: only that is determined."""
    return np.asarray(x[0] * x[1] * np.exp(-x[2] * PLACES))


def _duplicate(x: ComplexArray) -> ComplexArray:
    """Return a decay whose amplitude is a sum: two columns are the same."""
    return np.asarray((x[0] + x[1]) * np.exp(-x[2] * PLACES))


def _without_effect(x: ComplexArray) -> ComplexArray:
    return np.asarray(x[0] * np.exp(-x[1] * PLACES) + 0 * x[2])


@dataclass(frozen=True)
class Family:
    """Models whose data and starts are generated.

    Attributes
    ----------
    model
        Parameters (p,) → values at `PLACES`.
    low, high
        Range of the true parameters, shape (p,).
    in_logarithm
        Whether a parameter is a logarithm already: its start is off by an addition.
    values
        Number of values that are fitted, counted from the first.
    """

    model: Callable[[ComplexArray], ComplexArray]
    low: tuple[float, ...]
    high: tuple[float, ...]
    in_logarithm: tuple[int, ...] = ()
    values: int = len(PLACES)


FAMILIES = {
    "one exponential": Family(_exponentials, (0.5, 0.2), (5, 3)),
    "two exponentials": Family(_exponentials, (0.5, 0.1, 0.5, 1.5), (5, 0.8, 5, 6)),
    "three exponentials": Family(_exponentials, (0.5, 0.1, 0.5, 0.8, 0.5, 4), (5, 0.3, 5, 2, 5, 9)),
    "two log rates": Family(_log_exponentials, (0.5, -2, 0.5, 0.4), (5, -0.3, 5, 2), (1, 3)),
    "rational": Family(_rational, (0.5, 0.1, 0.1, 0.1), (3, 2, 2, 2)),
    "power law": Family(_power_law, (0.5, -1, 0.5), (5, 2, 2), (1,)),
    "peak": Family(_peak, (0.5, 1, 0.3, 0.1), (5, 3, 1.5, 1)),
    "logistic": Family(_logistic, (0.5, 1, 1), (5, 5, 4)),
    "product": Family(_product, (0.5, 0.5, 0.2), (3, 3, 3)),
    "duplicate column": Family(_duplicate, (0.5, 0.5, 0.2), (3, 3, 3)),
    "no effect": Family(_without_effect, (0.5, 0.2, 0.5), (5, 3, 5)),
    "fewer values than parameters": Family(
        _exponentials, (0.5, 0.1, 0.5, 1.5), (5, 0.8, 5, 6), (), 3
    ),
}


def generated(kind: str, seed: int, farthest: float = FARTHEST) -> Problem:
    """Return a problem of one of `FAMILIES`, its start up to 10^`farthest` off, by chance bounded.

    One start in six has a parameter at 0, where a column of the Jacobian may vanish, and one in six
    has all at one value. A third of the problems have bounds, of which some cut the truth off.
    """
    rng = np.random.default_rng(seed)
    family = FAMILIES[kind]
    truth = rng.uniform(family.low, family.high)
    noise = float(rng.choice(NOISES))
    values = np.real(family.model(truth.astype(np.complex128)))[: family.values]
    data = values + noise * rng.standard_normal(len(values))
    off = rng.uniform(-1, 1, len(truth)) * rng.uniform(0, farthest)
    start = truth * 10**off
    logarithms = list(family.in_logarithm)
    start[logarithms] = truth[logarithms] + off[logarithms]
    manner = rng.integers(6)
    if manner == 0:
        start[rng.integers(len(start))] = 0.0
    elif manner == 1:
        start[:] = start[0]
    lower, upper = np.full(len(truth), -np.inf), np.full(len(truth), np.inf)
    if rng.random() < 1 / 3:
        # A parameter above 0 stays so; those cut off end at their bound.
        lower = np.where(truth > 0, 0.0, -np.inf)
        is_cut = rng.random(len(truth)) < 1 / 4
        upper = np.where(is_cut, np.where(truth > 0, 0.7, 1.3) * truth, np.inf)
        start = np.clip(start, lower, upper)

    def function(x: ComplexArray) -> ComplexArray:
        return family.model(x)[: family.values] - data

    near = np.clip(truth, lower, upper)
    return Problem(f"{kind} {seed}", kind, function, start, lower, upper, near)
