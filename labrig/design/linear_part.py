"""Λ and albedo, on which the radiance depends linearly, for given emissions of the states.

The wanted radiances are met in the sense of least squares with Λ ≥ 0 and 0 ≤ albedo ≤ 1. Where
every band is wished for itself, each band is a problem of its own of few unknowns: all choices of
which of them lie at a bound are tried at once, for many candidates at once. Where colours of
spectral bands are wished for, bands depend on each other, and the smoothest Λ and albedo that give
the colours are taken.

Of the searches by Levenberg and Marquardt: one evaluates a few numbers per step, so that a loop
over starts would take most of its time for its bookkeeping. All searches go on together, which
makes them as fast as one; the lowest end is carried to the minimum by the core of all fits.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares

#: Steps of all searches, and the relative gain below which one has ended.
STEPS, MIN_GAIN = 25, 1e-5
INITIAL_DAMPING, MIN_FACTOR = 1e-3, 0.1


class Curvature(NamedTuple):
    """Sum of squares at points, its half gradient, and the Gauss–Newton matrix.

    Attributes
    ----------
    cost
        Sums of squares, shape (n,).
    gradient
        Products Jᵀ r, shape (n, p).
    matrix
        Products Jᵀ J, shape (n, p, p).
    """

    cost: FloatArray
    gradient: FloatArray
    matrix: FloatArray


def descend(
    curvature: Callable[[FloatArray], Curvature],
    starts: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return where searches from starts (n, p) within bounds (p,) end, and their sums of squares.

    The damping is Nielsen's, the scaling Moré's, as in `labrig.fit`.
    """
    x = np.clip(starts, low, high)
    at = curvature(x)
    damping = np.full(len(x), INITIAL_DAMPING)
    growth = np.full(len(x), 2.0)
    scales = np.zeros_like(x)
    for _ in range(STEPS):
        diagonal = np.diagonal(at.matrix, axis1=1, axis2=2)
        scales = np.maximum(scales, diagonal)
        # A rate at its bound, and pushed against it, stays there.
        is_held = ((x <= low) & (at.gradient > 0)) | ((x >= high) & (at.gradient < 0))
        step = _step(at, scales, damping, is_held)
        trial = np.clip(x + step, low, high)
        there = curvature(trial)
        moved = trial - x
        expected = -2 * (moved * at.gradient).sum(axis=1)
        expected -= np.einsum("ni,nij,nj->n", moved, at.matrix, moved)
        gain = at.cost - there.cost
        ratio = gain / np.maximum(expected, 1e-300)
        is_better = (gain > 0) & np.isfinite(there.cost)
        factor = np.maximum(MIN_FACTOR, 1 - (2 * np.clip(ratio, 0.0, 1.0) - 1) ** 3)
        damping = np.where(is_better, damping * factor, damping * growth)
        growth = np.where(is_better, 2.0, growth * 2)
        has_ended = gain <= MIN_GAIN * at.cost
        if (is_better & has_ended).sum() == len(x):
            x, at = trial, there
            break
        x = np.where(is_better[:, np.newaxis], trial, x)
        at = Curvature(
            *(
                np.where(is_better.reshape(-1, *[1] * (new.ndim - 1)), new, old)
                for new, old in zip(there, at, strict=True)
            )
        )
    return x, at.cost


def _step(
    at: Curvature, scales: FloatArray, damping: FloatArray, is_held: NDArray[np.bool_]
) -> FloatArray:
    """Return the damped steps (n, p)."""
    is_free = (~is_held).astype(np.float64)
    size = scales.shape[1]
    matrix = at.matrix * (is_free[:, :, np.newaxis] * is_free[:, np.newaxis, :])
    diagonal = np.arange(size)
    least = 1e-12 * scales.max(axis=1, keepdims=True, initial=1e-300)
    matrix[:, diagonal, diagonal] += damping[:, np.newaxis] * np.maximum(scales, least) + (
        least + is_held * scales
    )
    gradient = (at.gradient * is_free)[..., np.newaxis]
    return np.asarray(-np.linalg.solve(matrix, gradient)[..., 0])


#: Pivot relative to its column below which two columns are the same.
SINGULAR = 1e-13
#: Part by which diagonals grow where columns may be the same and only a direction is sought.
ALMOST_SINGULAR = 1e-12
#: Candidates that are solved at the same time; their arrays stay in the cache.
CHUNK = 512
#: Weight of second differences of Λ and albedo where many spectra have a colour.
SMOOTHNESS = 1e-3
#: State of an unknown: 0, free, or at its upper bound.
ZERO, FREE, FULL = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Wanted:
    """Wanted radiances in the form of least squares.

    Attributes
    ----------
    target
        Wanted radiance less what a given albedo reflects, shape (keys, channels).
    weight
        Weight of each key, shape (keys,).
    reflected
        Radiance in the bands that an albedo of 1 reflects, shape (keys, bands); None where the
        albedo is given.
    seen
        Channels by bands, shape (channels, bands); None where channels are bands.
    """

    target: FloatArray
    weight: FloatArray
    reflected: FloatArray | None
    seen: FloatArray | None

    @property
    def n_bands(self) -> int:
        """Number of bands."""
        return int(self.target.shape[1] if self.seen is None else self.seen.shape[1])


class Coefficients(NamedTuple):
    """What the emissions are multiplied by.

    Attributes
    ----------
    reradiation
        Λ, shape (states, bands).
    albedo
        Albedo, shape (bands,); None where it is given.
    """

    reradiation: FloatArray
    albedo: FloatArray | None


class Block(NamedTuple):
    """Rows of the residuals that have unknowns of their own.

    Attributes
    ----------
    rows
        Indices of the rows, keys within channels.
    columns
        Weighted columns of the unknowns, shape (rows, unknowns).
    is_free
        Which of the unknowns lie at no bound, shape (unknowns,).
    """

    rows: slice
    columns: FloatArray
    is_free: BoolArray


class BandByBand:
    """Least squares in which every band is a problem of its own."""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted = wanted
        w = wanted.weight[:, np.newaxis]
        self._y = w * wanted.target
        self._e = None if wanted.reflected is None else w * wanted.reflected

    @property
    def n_rows(self) -> int:
        """Number of residuals."""
        return int(self._y.size)

    def coefficients(self, emission: FloatArray) -> Coefficients:
        """Return the best Λ and albedo for emissions of the states, shape (keys, states)."""
        values, _ = self._solve(emission[np.newaxis])
        n_states = emission.shape[1]
        albedo = None if self._e is None else values[0, :, n_states]
        return Coefficients(values[0, :, :n_states].T, albedo)

    def costs(self, emission: FloatArray) -> FloatArray:
        """Return the least sums of squares of candidates, shape (n, keys, states) → (n,)."""
        parts = [
            self._solve(emission[first : first + CHUNK])[1]
            for first in range(0, len(emission), CHUNK)
        ]
        return np.concatenate(parts)

    def costs_of_pairs(
        self, emission: FloatArray, first: NDArray[np.intp], second: NDArray[np.intp]
    ) -> FloatArray:
        """Return the least sums of squares of pairs of states (n,) by their emissions (c, keys)."""
        parts = []
        for begin in range(0, len(first), CHUNK):
            part = slice(begin, begin + CHUNK)
            pair = np.stack([emission[first[part]], emission[second[part]]], axis=2)
            parts.append(self._solve(pair)[1])
        return np.concatenate(parts)

    def curvature(self, emission: FloatArray, slopes: FloatArray) -> Curvature:
        """Return the least sums of squares of candidates and their curvature.

        The Jacobian is that of variable projection after Kaufman.

        Parameters
        ----------
        emission
            Emissions of the states, shape (n, keys, states).
        slopes
            Their derivatives, shape (n, keys, states, p).
        """
        values, cost = self._solve(emission)
        count, n_keys, n_states = emission.shape
        n_bands, size = values.shape[1:]
        weight = self.wanted.weight[:, np.newaxis]
        columns = np.empty((count, n_bands, n_keys, size))
        columns[..., :n_states] = (weight * emission)[:, np.newaxis]
        is_free = values > 0
        if self._e is not None:
            columns[..., n_states] = self._e.T
            is_free[..., -1] &= values[..., -1] < 1
        residuals = (columns @ values[..., np.newaxis])[..., 0] - self._y.T
        columns *= is_free[:, :, np.newaxis]
        weighted = weight[..., np.newaxis] * slopes
        jacobian = np.einsum("ckip,cbi->cbkp", weighted, values[..., :n_states])
        gram = np.swapaxes(columns, 2, 3) @ columns
        diagonal = np.arange(size)
        gram[..., diagonal, diagonal] *= 1 + ALMOST_SINGULAR
        gram[..., diagonal, diagonal] += ~is_free
        inside = np.linalg.solve(gram, np.swapaxes(columns, 2, 3) @ jacobian)
        jacobian -= columns @ inside
        flat = jacobian.reshape(count, n_bands * n_keys, -1)
        turned = np.swapaxes(flat, 1, 2)
        gradient = (turned @ residuals.reshape(count, -1, 1))[..., 0]
        return Curvature(cost, gradient, turned @ flat)

    def radiance(self, emission: FloatArray, coefficients: Coefficients) -> FloatArray:
        """Return the radiance without what a given albedo reflects, shape (keys, channels)."""
        return _in_bands(self.wanted, emission, coefficients)

    def residuals(self, emission: FloatArray, coefficients: Coefficients) -> FloatArray:
        """Return the weighted residuals, keys within channels, shape (rows,)."""
        weight = self.wanted.weight[:, np.newaxis]
        got = weight * self.radiance(emission, coefficients)
        return (got - self._y).T.ravel()

    def slopes(
        self, emission: FloatArray, slopes: FloatArray, coefficients: Coefficients
    ) -> FloatArray:
        """Return how the residuals change with emissions that change, shape (rows, p).

        `slopes` are those of the emissions, shape (keys, states, p), which may have any value.
        """
        weighted = self.wanted.weight[:, np.newaxis, np.newaxis] * slopes
        made: FloatArray = np.einsum("kip,ib->bkp", weighted, coefficients.reradiation)
        return made.reshape(self.n_rows, -1)

    def blocks(self, emission: FloatArray, coefficients: Coefficients) -> Iterator[Block]:
        """Yield each band's columns, those of the states and that of the albedo."""
        n_keys = len(emission)
        states = self.wanted.weight[:, np.newaxis] * emission
        for band, reradiation in enumerate(coefficients.reradiation.T):
            columns, is_free = states, reradiation > 0
            if self._e is not None and coefficients.albedo is not None:
                albedo = coefficients.albedo[band]
                columns = np.column_stack([states, self._e[:, band]])
                is_free = np.append(is_free, 0 < albedo < 1)
            yield Block(slice(band * n_keys, (band + 1) * n_keys), columns, is_free)

    @cached_property
    def _light(self) -> tuple[FloatArray, FloatArray]:
        """Products of the reflected light with itself and the target, each of shape (bands,)."""
        assert self._e is not None
        return (self._e**2).sum(axis=0), (self._e * self._y).sum(axis=0)

    def _solve(self, emission: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return unknowns (n, bands, unknowns) and sums of squares (n,) of candidates."""
        count, _, n_states = emission.shape
        g = self.wanted.weight[:, np.newaxis] * emission
        n_bands = self._y.shape[1]
        size = n_states + (self._e is not None)
        gram = np.empty((count, n_bands, size, size))
        right = np.empty((count, n_bands, size))
        gram[:, :, :n_states, :n_states] = np.einsum("cki,ckj->cij", g, g)[:, np.newaxis]
        by_state = np.moveaxis(g, 1, 2)
        right[:, :, :n_states] = np.moveaxis(by_state @ self._y, 1, 2)
        if self._e is not None:
            squares, products = self._light
            crossed = np.moveaxis(by_state @ self._e, 1, 2)
            gram[:, :, :n_states, n_states] = gram[:, :, n_states, :n_states] = crossed
            gram[:, :, n_states, n_states] = squares
            right[:, :, n_states] = products
        values, gained = _bounded(gram, right, has_albedo=self._e is not None)
        return values, (self._y**2).sum() - gained.sum(axis=1)


class Coupled:
    """Least squares in which channels are colours of spectral bands.

    The last rows of the residuals are second differences of Λ and albedo, weighted by the light
    that they belong to, which is far less than any key weighs.
    """

    def __init__(self, wanted: Wanted) -> None:
        assert wanted.seen is not None
        self.wanted = wanted
        self._seen: FloatArray = wanted.seen
        n = self._seen.shape[1]
        # Λ ends in darkness on both sides, an albedo anyhow.
        self._emission_bends = SMOOTHNESS * np.diff(np.eye(n + 2)[:, 1:-1], 2, axis=0)
        self._albedo_bends = np.zeros((0, n))
        if wanted.reflected is not None and n > 2:
            seen = wanted.weight[:, np.newaxis] * (wanted.reflected @ self._seen.T)
            self._albedo_bends = SMOOTHNESS * _rms(seen.ravel()) * np.diff(np.eye(n), 2, axis=0)
        self._y = (wanted.weight[:, np.newaxis] * wanted.target).T.ravel()

    @property
    def n_rows(self) -> int:
        """Number of residuals that belong to keys."""
        return len(self._y)

    def coefficients(self, emission: FloatArray) -> Coefficients:
        """Return the smoothest best Λ and albedo for emissions of the states (keys, states)."""
        columns = self._columns(emission)
        target = np.concatenate([self._y, np.zeros(len(columns) - self.n_rows)])
        n_emitted = emission.shape[1] * self._seen.shape[1]
        unknowns = np.ones(columns.shape[1])
        is_full = np.zeros(len(unknowns), dtype=np.bool_)
        while True:
            left = target - columns[:, is_full].sum(axis=1)
            unknowns[~is_full] = nonnegative_least_squares(columns[:, ~is_full], left)
            too_much = unknowns > 1
            too_much[:n_emitted] = False
            if not too_much.any():
                break
            unknowns[too_much] = 1.0
            is_full |= too_much
        reradiation = unknowns[:n_emitted].reshape(emission.shape[1], -1)
        albedo = unknowns[n_emitted:] if self.wanted.reflected is not None else None
        return Coefficients(reradiation, albedo)

    def radiance(self, emission: FloatArray, coefficients: Coefficients) -> FloatArray:
        """Return the radiance as `BandByBand.radiance` does, in colours."""
        return _in_bands(self.wanted, emission, coefficients) @ self._seen.T

    def residuals(self, emission: FloatArray, coefficients: Coefficients) -> FloatArray:
        """Return the weighted residuals, keys within channels, then those of smoothness."""
        got = self.wanted.weight[:, np.newaxis] * self.radiance(emission, coefficients)
        bent = self._norms(emission)[:, np.newaxis] * self._bent(coefficients)
        rows = [got.T.ravel() - self._y, bent.ravel()]
        if coefficients.albedo is not None:
            rows.append(self._albedo_bends @ coefficients.albedo)
        return np.concatenate(rows)

    def slopes(
        self, emission: FloatArray, slopes: FloatArray, coefficients: Coefficients
    ) -> FloatArray:
        """Return how the residuals change with emissions that change, as `BandByBand.slopes`."""
        weight = self.wanted.weight[:, np.newaxis, np.newaxis]
        colours = coefficients.reradiation @ self._seen.T
        made = np.einsum("kip,ic->ckp", weight * slopes, colours).reshape(self.n_rows, -1)
        norms = self._norms(emission)
        squares = np.einsum("ki,kip->ip", (weight[..., 0] ** 2) * emission, slopes)
        safe = np.where(norms > 0, norms, 1.0)[:, np.newaxis] * len(emission)
        bent = np.einsum("ip,ib->ibp", squares / safe, self._bent(coefficients))
        flat = np.zeros((len(self._albedo_bends), slopes.shape[2]))
        return np.concatenate([made, bent.reshape(-1, slopes.shape[2]), flat])

    def blocks(self, emission: FloatArray, coefficients: Coefficients) -> Iterator[Block]:
        """Yield the columns of all unknowns, the bands of the states and those of the albedo."""
        is_free = (coefficients.reradiation > 0).ravel()
        if coefficients.albedo is not None:
            albedo = coefficients.albedo
            is_free = np.concatenate([is_free, (albedo > 0) & (albedo < 1)])
        columns = self._columns(emission)
        yield Block(slice(0, len(columns)), columns, is_free)

    def _norms(self, emission: FloatArray) -> FloatArray:
        """Return the root mean squares of the weighted emissions of the states."""
        weighted = self.wanted.weight[:, np.newaxis] * emission
        return np.array([_rms(state) for state in weighted.T])

    def _bent(self, coefficients: Coefficients) -> FloatArray:
        """Return the second differences of Λ, shape (states, bands)."""
        return coefficients.reradiation @ self._emission_bends.T

    def _columns(self, emission: FloatArray) -> FloatArray:
        """Return the weighted columns, keys within channels, bands within states."""
        n_states, n = emission.shape[1], self._seen.shape[1]
        light = [] if self.wanted.reflected is None else [self.wanted.reflected]
        fields = [*(np.repeat(state[:, np.newaxis], n, axis=1) for state in emission.T), *light]
        above = np.concatenate(
            [
                (
                    self._seen[:, np.newaxis, :] * (self.wanted.weight[:, np.newaxis] * field)
                ).reshape(self.n_rows, n)
                for field in fields
            ],
            axis=1,
        )
        bends = [norm * self._emission_bends for norm in self._norms(emission)]
        rows = n_states * n
        below = np.zeros((rows + len(light) * len(self._albedo_bends), above.shape[1]))
        for state, bend in enumerate(bends):
            part = slice(state * n, (state + 1) * n)
            below[part, part] = bend
        if light:
            below[rows:, rows:] = self._albedo_bends
        return np.vstack([above, below])


#: Either form of the linear problem.
LinearPart = BandByBand | Coupled


def linear_part(wanted: Wanted) -> LinearPart:
    """Return the linear problem of what is wanted."""
    return BandByBand(wanted) if wanted.seen is None else Coupled(wanted)


def _in_bands(wanted: Wanted, emission: FloatArray, coefficients: Coefficients) -> FloatArray:
    radiance: FloatArray = emission @ coefficients.reradiation
    if wanted.reflected is not None and coefficients.albedo is not None:
        radiance = radiance + wanted.reflected * coefficients.albedo
    return radiance


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _bounded(
    gram: FloatArray, right: FloatArray, *, has_albedo: bool
) -> tuple[FloatArray, FloatArray]:
    """Solve small least squares with unknowns ≥ 0, the last one ≤ 1 if it is an albedo.

    Parameters
    ----------
    gram, right
        Products of the columns with each other (n, bands, u, u) and with the target (n, bands, u).
    has_albedo
        Whether the last unknown is an albedo.

    Returns
    -------
    values, gained
        Unknowns (n, bands, u), and by how much they lower the sum of squares (n, bands).
    """
    size = gram.shape[-1]
    choices = [(ZERO, FREE)] * (size - has_albedo) + [(ZERO, FREE, FULL)] * has_albedo
    states = np.array(list(product(*choices)))
    free, full = (states == FREE).astype(np.float64), (states == FULL).astype(np.float64)
    # Unknowns at a bound keep their value by a row of the identity. Shape (n, bands, choices, …).
    g = gram[:, :, np.newaxis]
    fixed = np.einsum("cbij,sj->cbsi", gram, full)
    b = (right[:, :, np.newaxis] - fixed) * free + full
    a = g * (free[:, :, np.newaxis] * free[:, np.newaxis, :])
    a[..., np.arange(size), np.arange(size)] += 1 - free
    values, is_regular = _solved(a, b)
    is_proper = is_regular & (values >= 0).all(axis=-1)
    if has_albedo:
        is_proper &= values[..., -1] <= 1
    lowered = 2 * right[:, :, np.newaxis] - np.einsum("cbij,cbsj->cbsi", gram, values)
    gained = np.where(is_proper, (values * lowered).sum(axis=-1), -np.inf)
    best = gained.argmax(axis=-1)[..., np.newaxis]
    chosen = np.take_along_axis(values, best[..., np.newaxis], axis=-2)[..., 0, :]
    return chosen, np.take_along_axis(gained, best, axis=-1)[..., 0]


def _solved(a: FloatArray, b: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Solve small symmetric systems (…, u, u) of right-hand sides (…, u) by elimination."""
    size = a.shape[-1]
    a, b = a.copy(), b.copy()
    diagonal = a[..., np.arange(size), np.arange(size)].copy()
    is_regular: BoolArray = np.asarray((diagonal > 0).all(axis=-1))
    for i in range(size):
        pivot = a[..., i, i]
        is_regular = is_regular & (pivot > SINGULAR * diagonal[..., i])
        pivot = np.where(is_regular, pivot, 1.0)
        for j in range(i + 1, size):
            factor = a[..., j, i] / pivot
            a[..., j, i:] -= factor[..., np.newaxis] * a[..., i, i:]
            b[..., j] -= factor * b[..., i]
    for i in range(size - 1, -1, -1):
        left = b[..., i] - (a[..., i, i + 1 :] * b[..., i + 1 :]).sum(axis=-1)
        b[..., i] = left / np.where(is_regular, a[..., i, i], 1.0)
    return b, is_regular
