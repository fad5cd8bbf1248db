"""Everything at once: a decay's shape, the channels' weights and offsets, by least squares.

The model is w_c h(t; θ) + b_c: a shape h shared by all channels, times one weight per channel
(rank one, Nalbach et al. sec. 4.3), plus what each channel's dark level is wrong by. The brightest
channel's weight is held at 1, which fixes the scale of h.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import (
    FloatArray,
    LeastSquaresFit,
    least_squares,
    parameter_covariance,
)

#: Shape parameters (q,) → h (n,) and its Jacobian (n, q).
Shape = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


#: Tries to find out which channel is the brightest.
CHANGES_OF_LEAD = 3


@dataclass(frozen=True)
class JointFit:
    """Shape, weights and offsets together, in the series' own units.

    Attributes
    ----------
    shape
        (q,) θ.
    weights
        (C,) maximum 1.
    offsets
        (C,) 0 where held.
    least_squares
        The solution of `[θ, weights of all but the brightest channel, offsets that are fitted]`.
    brightest
        The channel whose weight is held at 1.
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
        """Parameters fitted."""
        return len(self.least_squares.parameters)

    def frame_residuals(self, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
        """(n,) residuals along the signal, one of unit variance per frame; (n,) squared SNR."""
        unit = data.constant(self.weights)
        length = np.linalg.norm(unit, axis=1)
        residuals = self.least_squares.residuals[: unit.size].reshape(unit.shape)
        along = np.einsum("fc,fc->f", unit, residuals) / np.where(length > 0, length, 1.0)
        signal = residuals + data.values - data.constant(self.offsets)
        return along, np.einsum("fc,fc->f", signal, signal)

    def followed(self, data: WhitenedSeries) -> tuple[float, float]:
        """Degrees of freedom that the fit took from the residuals along and across the signal."""
        along, across = data.followed(self.weights, self.least_squares.jacobian)
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
) -> JointFit:
    """Least squares over θ, weights and offsets.

    Parameters
    ----------
    data
        n frames of C channels.
    shape
        h and its Jacobian.
    start, lower, upper
        (q,) θ and its bounds.
    weights, offsets
        (C,) to start from.
    max_iterations
        Evaluations after which a fit that still creeps is taken as it is.
    tolerance
        Relative step small enough; 0 for all digits.
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
        )
        theta, weights, offsets = problem.unpack(solution.parameters)
        # Of two channels about equally bright the other one may turn out to lead.
        if weights.max() <= 1:
            break
    return JointFit(theta, weights, offsets, solution, brightest)


@dataclass(frozen=True)
class JointProblem:
    """Residuals as a function of [θ, weights of the other channels, offsets that are fitted]."""

    data: WhitenedSeries
    shape: Shape
    n_shape: int
    others: list[int]

    def pack(self, theta: FloatArray, weights: FloatArray, offsets: FloatArray) -> FloatArray:
        """The parameters as one vector."""
        fitted = self.data.series.fitted_offsets
        return np.concatenate([theta, weights[self.others], offsets[fitted]])

    def unpack(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """θ, weights (C,) and offsets (C,) of all channels."""
        first_offset = self.n_shape + len(self.others)
        weights, offsets = np.ones(len(self.others) + 1), np.zeros(len(self.others) + 1)
        weights[self.others] = x[self.n_shape : first_offset]
        offsets[self.data.series.fitted_offsets] = x[first_offset:]
        return x[: self.n_shape], weights, offsets

    def residuals(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened model − target (n C + p,) and its Jacobian; the last p rows are the priors."""
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


def covariance_under(data: WhitenedSeries, shape: Shape, fit: JointFit) -> FloatArray:
    """Covariance of the parameters of `fit` if the noise is as in `data`."""
    others = [c for c in range(len(fit.weights)) if c != fit.brightest]
    problem = JointProblem(data, shape, len(fit.shape), others)
    _, jacobian = problem.residuals(fit.least_squares.parameters)
    return parameter_covariance(jacobian)[0]


def weight_sigma(fit: JointFit, covariance: FloatArray) -> FloatArray:
    """σ of the channel weights (C,), 0 for the one that is held; `covariance` (p, p) of all."""
    n_shape, others = len(fit.shape), np.arange(len(fit.weights)) != fit.brightest
    sigma = np.zeros(len(fit.weights))
    variances = np.diag(covariance)[n_shape : n_shape + np.count_nonzero(others)]
    sigma[others] = np.sqrt(variances)
    return sigma
