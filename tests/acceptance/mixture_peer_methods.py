"""Other ways to hold a re-radiation matrix in few numbers, fitted to the same thresholded entries.

pomegranate is not a dependency; `Pomegranate` looks for it in the environment it runs in.
"""

import importlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from labrig.fit import fit_mixture, fit_mixture_texture
from labrig.fit.mixture.candidate import MAX_ITERATIONS, STARTS, TOLERANCE
from labrig.fit.mixture.entries import StokesEntries, stokes_entries
from labrig.material import ReradiationMatrix, ReradiationMixture

Floats = npt.NDArray[np.float64]

MISSING = (
    "pomegranate is not installed: python -m uv pip install pomegranate (with torch for processors "
    "only, if there is no GPU)"
)
#: Iterations of pomegranate between two looks at the likelihood, which it does not weigh itself.
BLOCK = 5
#: A factorisation ends at this gain, in parts of the squared error, or after so many sweeps.
MIN_GAIN, MAX_SWEEPS = 1e-6, 2000
#: Ridge, in parts of the largest squared factor, where a row has fewer entries than factors.
RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Target:
    """Re-radiation per band of a matrix, 0 below the threshold and off the Stokes side, (n, m)."""

    matrix: ReradiationMatrix
    entries: StokesEntries
    values: Floats

    @classmethod
    def of(cls, matrix: ReradiationMatrix, threshold: float | None = None) -> "Target":
        entries = stokes_entries(matrix, threshold)
        values = np.zeros(matrix.reradiation.shape)
        values[matrix.is_stokes & ~np.isnan(matrix.reradiation)] = entries.value
        return cls(matrix, entries, values)

    @property
    def thresholded(self) -> ReradiationMatrix:
        """The matrix that all methods follow: without σ, so that labrig follows it, too."""
        matrix = self.matrix
        return replace(
            matrix,
            reradiation=self.values / matrix.output_width_nm[:, np.newaxis],
            reradiation_sigma=None,
            column_correlation=None,
        )

    @property
    def least(self) -> float:
        """Threshold that keeps all that is kept."""
        return (1 - 1e-9) * self.entries.threshold

    @property
    def box(self) -> tuple[slice, slice]:
        """Rows and columns between the outermost entries above the threshold."""
        rows, columns = (np.flatnonzero(self.values.any(axis=axis)) for axis in (1, 0))
        return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)

    def mse(self, values: Floats) -> float:
        """Return the masked error of values per band."""
        stokes = self.matrix.is_stokes
        return float(np.square(values[stokes] - self.values[stokes]).mean())

    def from_density(self, density: Floats) -> Floats:
        """Return values per band from the density at the entries, with the light of the target."""
        entries = self.entries
        per_band = density * entries.relative_width
        values = np.zeros_like(self.values)
        light = entries.mass.sum() / (per_band @ entries.input_width_nm)
        values[self.matrix.is_stokes] = light * per_band
        return values


def mixture_values(target: Target, components: int) -> Floats:
    """Return labrig's mixture, per band."""
    return _of_mixture(
        target, fit_mixture(target.thresholded, components, threshold=target.least).mixture
    )


def texture_values(target: Target, components: int) -> Floats:
    """Return labrig's mixture of a texture of one texel, per band."""
    matrix = target.matrix
    texel = (target.values / matrix.output_width_nm[:, np.newaxis])[np.newaxis]
    texture = fit_mixture_texture(texel, matrix.input_nm, matrix.output_nm, components)
    return _of_mixture(target, texture[0])


def _of_mixture(target: Target, mixture: ReradiationMixture) -> Floats:
    matrix = target.matrix
    smooth = mixture.to_matrix(matrix.input_nm, matrix.output_nm)
    return np.asarray(smooth.reradiation * matrix.output_width_nm[:, np.newaxis])


def likelihood_only(target: Target, components: int) -> Floats:
    """Return what labrig's expectation maximisation makes of 8 starts, without refinement."""
    fit = fit_mixture(target.thresholded, components, threshold=target.least, refine=False)
    return _of_mixture(target, fit.mixture)


@dataclass
class Pomegranate:
    """Weighted expectation maximisation by pomegranate, 1.0 or later, on one thread.

    Attributes
    ----------
    failed, tried
        Numbers of starts whose covariance became singular, and of all.
    """

    failed: int = 0
    tried: int = 0

    @cached_property
    def torch(self) -> Any:
        return importlib.import_module("torch")

    def require(self) -> str:
        """Return the versions in use, or end in one line."""
        try:
            pomegranate = importlib.import_module("pomegranate")
            importlib.import_module("pomegranate.gmm")
        except ImportError:
            raise SystemExit(MISSING) from None
        self.torch.set_num_threads(1)
        return f"pomegranate {pomegranate.__version__}, torch {self.torch.__version__}"

    def defaults(self, target: Target, components: int) -> Floats:
        """Return what the first start with which it succeeds finds, with its own end."""
        return self._best(target, components, 1, own_end=True)

    def one_start(self, target: Target, components: int) -> Floats:
        """Return what the first start with which it succeeds finds, with labrig's end."""
        return self._best(target, components, 1, own_end=False)

    def several_starts(self, target: Target, components: int) -> Floats:
        """Return the best by masked error of as many starts as labrig makes, with its end."""
        return self._best(target, components, STARTS, own_end=False)

    def _best(self, target: Target, components: int, enough: int, own_end: bool) -> Floats:
        entries = target.entries
        kept = entries.is_kept
        points = self._tensor(entries.points.T)
        weight = self._tensor(entries.mass[kept] / entries.mass[kept].mean())[:, None]
        found: list[Floats] = []
        for seed in range(STARTS):
            self.tried += 1
            try:
                model = self._fitted(points[kept], weight, components, seed, own_end)
                log_density = model.log_probability(points).numpy().astype(np.float64)
                values = target.from_density(np.exp(log_density))
            # A singular covariance is any of these, or not a number, by where it is met.
            except (AttributeError, RuntimeError, ValueError):
                values = np.full_like(target.values, np.nan)
            if np.isfinite(values).all():
                found.append(values)
            else:
                self.failed += 1
            if len(found) == enough:
                break
        if not found:
            return np.full_like(target.values, np.nan)
        return min(found, key=target.mse)

    def _fitted(self, points: Any, weight: Any, components: int, seed: int, own_end: bool) -> Any:
        normal = importlib.import_module("pomegranate.distributions").Normal
        mixture = importlib.import_module("pomegranate.gmm").GeneralMixtureModel
        if components == 1:  # its mixtures have two components or more
            return normal().fit(points, sample_weight=weight)
        parts = [normal() for _ in range(components)]
        if own_end:
            return mixture(parts, random_state=seed).fit(points, sample_weight=weight)
        # Its own end looks at the likelihood without weights, which may fall while the fit gains.
        model = mixture(parts, random_state=seed, max_iter=BLOCK, tol=-np.inf)
        before = -np.inf
        for _ in range(MAX_ITERATIONS // BLOCK):
            model.fit(points, sample_weight=weight)
            likelihood = float((model.log_probability(points)[:, None] * weight).mean())
            if not likelihood - before >= BLOCK * TOLERANCE:
                break
            before = likelihood
        return model

    def _tensor(self, values: Floats) -> Any:
        return self.torch.tensor(np.ascontiguousarray(values), dtype=self.torch.float32)


def truncated_svd(target: Target, rank: int) -> Floats:
    """Return the best matrix of a rank, where the anti-Stokes side counts as 0."""
    left, size, right = np.linalg.svd(target.values[target.box], full_matrices=False)
    return _unboxed(target, (left[:, :rank] * size[:rank]) @ right[:rank])


def stokes_svd(target: Target, rank: int) -> Floats:
    """Return the best matrix of a rank on the Stokes side, whatever it is beyond.

    Alternating least squares from the truncated singular value decomposition.
    """
    wanted, used = target.values[target.box], target.matrix.is_stokes[target.box]
    rows, size, columns = np.linalg.svd(wanted, full_matrices=False)
    left, right = rows[:, :rank] * np.sqrt(size[:rank]), (columns[:rank].T) * np.sqrt(size[:rank])
    before = np.inf
    for _ in range(MAX_SWEEPS):
        left = _rows_by_least_squares(wanted, used, right)
        right = _rows_by_least_squares(wanted.T, used.T, left)
        error = float(np.square((left @ right.T - wanted)[used]).sum())
        if before - error < MIN_GAIN * error:
            break
        before = error
    return _unboxed(target, left @ right.T)


def plain_nmf(target: Target, rank: int) -> Floats:
    """Return a product of non-negative factors, where the anti-Stokes side counts as 0."""
    return _nmf(target, rank, np.ones(target.values[target.box].shape))


def stokes_nmf(target: Target, rank: int) -> Floats:
    """Return a product of non-negative factors fitted on the Stokes side only."""
    return _nmf(target, rank, target.matrix.is_stokes[target.box].astype(np.float64))


def knots(target: Target, components: int) -> Floats:
    """Return one excitation times one emission, each linear between 3 knots per component.

    So they are 6 numbers a component, as of a mixture: no factorisation of whole columns is as
    small. Fitted on the Stokes side only.
    """
    wanted = target.values[target.box]
    used = target.matrix.is_stokes[target.box].astype(np.float64)
    on_rows, on_columns = (_hats(length, 3 * components) for length in wanted.shape)
    _, _, columns = np.linalg.svd(wanted, full_matrices=False)
    excitation = np.abs(columns[0])
    before = np.inf
    for _ in range(MAX_SWEEPS):
        emission = _on_knots(on_rows, wanted, used, excitation)
        excitation = _on_knots(on_columns, wanted.T, used.T, emission)
        error = float((used * np.square(np.outer(emission, excitation) - wanted)).sum())
        if before - error < MIN_GAIN * error:
            break
        before = error
    return _unboxed(target, np.outer(emission, excitation))


def factor_numbers(target: Target, rank: int) -> int:
    """Return how many numbers a factorisation of the part above the threshold takes."""
    return rank * sum(target.values[target.box].shape)


def _nmf(target: Target, rank: int, used: Floats) -> Floats:
    """Hierarchical alternating least squares from the singular vectors (NNDSVD).

    A. Cichocki, A.-H. Phan, IEICE Transactions E92-A, 2009; C. Boutsidis, E. Gallopoulos, Pattern
    Recognition 41, 2008.
    """
    wanted = target.values[target.box]
    left, right = _non_negative_start(wanted, rank)
    before = np.inf
    for _ in range(MAX_SWEEPS):
        for k in range(rank):
            rest = wanted - left @ right.T + np.outer(left[:, k], right[:, k])
            left[:, k] = _non_negative_factor(rest, used, right[:, k])
            right[:, k] = _non_negative_factor(rest.T, used.T, left[:, k])
        error = float((used * np.square(left @ right.T - wanted)).sum())
        if before - error < MIN_GAIN * error:
            break
        before = error
    return _unboxed(target, left @ right.T)


def _non_negative_start(wanted: Floats, rank: int) -> tuple[Floats, Floats]:
    rows, size, columns = np.linalg.svd(wanted, full_matrices=False)
    left, right = [], []
    for row, part, column in zip(rows.T[:rank], size, columns, strict=False):
        signs = ((np.maximum(sign * row, 0), np.maximum(sign * column, 0)) for sign in (1, -1))
        u, v = max(signs, key=lambda pair: np.linalg.norm(pair[0]) * np.linalg.norm(pair[1]))
        # A factor that is 0 somewhere may rise again, as those of HALS do.
        left.append(np.sqrt(part) * u + 1e-6)
        right.append(np.sqrt(part) * v + 1e-6)
    return np.stack(left, axis=1), np.stack(right, axis=1)


def _non_negative_factor(rest: Floats, used: Floats, other: Floats) -> Floats:
    weight = used @ other**2
    return np.maximum((used * rest) @ other, 0.0) / np.maximum(weight, np.finfo(np.float64).tiny)


def _rows_by_least_squares(wanted: Floats, used: npt.NDArray[np.bool_], other: Floats) -> Floats:
    normal = np.einsum("ij,jr,js->irs", used.astype(np.float64), other, other)
    normal += RIDGE * np.square(other).max() * np.eye(other.shape[1])
    right_side = np.where(used, wanted, 0.0) @ other
    return np.asarray(np.linalg.solve(normal, right_side[..., np.newaxis])[..., 0])


def _hats(length: int, count: int) -> Floats:
    """Return piecewise linear functions with 1 at one of `count` knots, shape (length, count)."""
    places = np.linspace(0, length - 1, count)
    return np.stack([np.interp(np.arange(length), places, row) for row in np.eye(count)], axis=1)


def _on_knots(hats: Floats, wanted: Floats, used: Floats, other: Floats) -> Floats:
    weight, right_side = used @ other**2, (used * wanted) @ other
    normal = hats.T @ (weight[:, np.newaxis] * hats)
    normal += RIDGE * max(float(weight.max()), np.finfo(np.float64).tiny) * np.eye(len(normal))
    return np.asarray(hats @ np.linalg.solve(normal, hats.T @ right_side))


def _unboxed(target: Target, inside: Floats) -> Floats:
    values = np.zeros_like(target.values)
    values[target.box] = inside
    return np.where(target.matrix.is_stokes, values, 0.0)
