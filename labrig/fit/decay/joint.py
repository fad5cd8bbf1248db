"""Joint least-squares fit of a decay's shape, the channels' weights and their offsets.

The model is w_c h(t; θ) + b_c: a shape h shared by all channels, times one weight per channel
(rank one, Nalbach et al. sec. 4.3), plus the error of each channel's dark level. The brightest
channel's weight is held at 1, which fixes the scale of h.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import LeastSquaresFit, least_squares
from labrig.foundation.arrays import FloatArray

#: Shape parameters (q,) → h (n,) and its Jacobian (n, q).
Shape = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


#: Largest number of attempts to identify the brightest channel.
CHANGES_OF_LEAD = 3


@dataclass(frozen=True)
class JointFit:
    """Fitted shape, weights and offsets in the series' own units.

    Attributes
    ----------
    shape
        Parameters θ of the shape, shape (q,).
    weights
        Weights of the channels with maximum 1, shape (C,).
    offsets
        Offsets of the channels, 0 where held, shape (C,).
    least_squares
        Solution in `[θ, weights of all but the brightest channel, fitted offsets]`.
    brightest
        Index of the channel whose weight is held at 1.
    """

    shape: FloatArray
    weights: FloatArray
    offsets: FloatArray
    least_squares: LeastSquaresFit
    brightest: int

    @property
    def chi2(self) -> float:
        """Sum of squared whitened residuals, the offsets' priors included."""
        return self.least_squares.chi2

    @property
    def n_parameters(self) -> int:
        """Number of fitted parameters."""
        return len(self.least_squares.parameters)

    def frame_residuals(self, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
        """Return each frame's residual of unit variance along the signal, and squared SNR, (n,)."""
        unit = data.constant(self.weights)
        length = np.linalg.norm(unit, axis=1)
        residuals = self.least_squares.residuals[: unit.size].reshape(unit.shape)
        along = np.einsum("fc,fc->f", unit, residuals) / np.where(length > 0, length, 1.0)
        signal = residuals + data.values - data.constant(self.offsets)
        return along, np.einsum("fc,fc->f", signal, signal)

    def leverage(self, data: WhitenedSeries) -> tuple[float, float]:
        """Return the degrees of freedom that the fit took along and across the signal."""
        along, across = data.leverage(self.weights, self.least_squares.jacobian)
        return float(along.sum()), float(across.sum())


def fit_jointly(
    data: WhitenedSeries,
    shape: Shape,
    start: FloatArray,
    weights: FloatArray,
    offsets: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    max_iterations: int,
    tolerance: float,
    least_gain: float = 0.0,
) -> JointFit:
    """Fit θ, weights and offsets by least squares.

    Parameters
    ----------
    data
        Whitened series of n frames and C channels.
    shape
        Function that returns h and its Jacobian.
    start, lower, upper
        Start values and bounds of θ, shape (q,).
    weights, offsets
        Start values of the channels, shape (C,).
    max_iterations
        Number of evaluations after which a slowly converging fit is accepted.
    tolerance
        Relative step at which to stop; 0 for full precision.
    least_gain
        Gain in χ² of a step at which to stop; 0 for full precision.
    """
    theta = start
    for _ in range(CHANGES_OF_LEAD):
        brightest = int(np.argmax(weights))
        others = [c for c in range(len(weights)) if c != brightest]
        problem = JointProblem(data, shape, len(start), others)
        solution = least_squares(
            problem.residuals,
            problem.pack(theta, weights / weights[brightest], offsets),
            lower=problem.pack(lower, np.zeros_like(weights), np.full_like(weights, -np.inf)),
            upper=problem.pack(upper, np.full_like(weights, np.inf), np.full_like(weights, np.inf)),
            max_iterations=max_iterations,
            tolerance=tolerance,
            least_gain=least_gain,
        )
        theta, weights, offsets = problem.unpack(solution.parameters)
        # Of two channels about equally bright the other one may turn out to lead.
        if weights.max() <= 1:
            break
    return JointFit(theta, weights, offsets, solution, brightest)


@dataclass(frozen=True)
class JointProblem:
    """Residuals as a function of [θ, weights of the other channels, fitted offsets]."""

    data: WhitenedSeries
    shape: Shape
    n_shape: int
    others: list[int]

    def pack(self, theta: FloatArray, weights: FloatArray, offsets: FloatArray) -> FloatArray:
        """Return the parameters as one vector."""
        fitted = self.data.series.fitted_offsets
        return np.concatenate([theta, weights[self.others], offsets[fitted]])

    def unpack(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return θ, weights (C,) and offsets (C,) of all channels."""
        first_offset = self.n_shape + len(self.others)
        weights, offsets = np.ones(len(self.others) + 1), np.zeros(len(self.others) + 1)
        weights[self.others] = x[self.n_shape : first_offset]
        offsets[self.data.series.fitted_offsets] = x[first_offset:]
        return x[: self.n_shape], weights, offsets

    def residuals(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return whitened model − target (n C + p,), the last p rows priors, and its Jacobian."""
        data, q, others = self.data, self.n_shape, self.others
        theta, weights, _ = self.unpack(x)
        h, slopes = self.shape(theta)
        unit, first_offset = data.constant(weights), q + len(others)
        jacobian = np.zeros((len(data.target), len(x)))
        frames = jacobian[: unit.size].reshape(*unit.shape, len(x))
        frames[:, :, :q] = unit[:, :, None] * slopes[:, None, :]
        if others:
            frames[:, :, q:first_offset] = h[:, None, None] * data.matrices[:, :, others]
        jacobian[:, first_offset:] = data.offset_design
        residuals = data.offset_design @ x[first_offset:] - data.target
        residuals[: unit.size] += (unit * h[:, None]).ravel()
        return residuals, jacobian


def covariance_under_flicker(
    fit: JointFit, data: WhitenedSeries, signal: FloatArray, added_square: float
) -> FloatArray:
    """Return the covariance A V Aᵀ (p, p) of a fit if its frames flicker otherwise than weighed.

    The parameters follow the whitened values with A = (JᵀJ)⁻¹Jᵀ, whose weights are those of the
    flicker assumed. Values of another one have V = 1 + (ρ² − ρ₀²) s sᵀ, and no smaller covariance
    than if they were weighed by ρ: that is more than the (JᵀJ)⁻¹ of ρ's own weights.

    Parameters
    ----------
    fit
        The fit.
    data
        The series in units of its noise.
    signal
        What the fit says without offsets, shape (n, C).
    added_square
        Mean of ρ² − ρ₀², ρ₀ the flicker in the units of `data`.
    """
    covariance = fit.least_squares.covariance
    along = np.einsum("fcd,fd->fc", data.matrices, signal)
    jacobian = fit.least_squares.jacobian[: along.size].reshape(*along.shape, -1)
    # What is not determined at all has an infinite variance, whatever the flicker.
    determined = np.where(np.isfinite(covariance), covariance, 0.0)
    effect = determined @ np.einsum("fc,fcp->pf", along, jacobian)
    return np.asarray(covariance + added_square * effect @ effect.T)


def weight_sigma(fit: JointFit, covariance: FloatArray) -> FloatArray:
    """Return σ of the channel weights (C,), 0 for the held one, from the full covariance (p, p)."""
    n_shape, others = len(fit.shape), np.arange(len(fit.weights)) != fit.brightest
    sigma = np.zeros(len(fit.weights))
    variances = np.diag(covariance)[n_shape : n_shape + np.count_nonzero(others)]
    sigma[others] = np.sqrt(variances)
    return sigma
