"""Everything at once: a decay's shape, the channels' weights and the offset, by least squares.

The signal is w_c h(t; θ): a shape h shared by all channels, times one weight per channel (rank one,
Nalbach et al. sec. 4.3). The brightest channel's weight is held at 1, which fixes the scale of h.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.series import DecaySeries
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.fit.least_squares import FloatArray, LeastSquaresFit, least_squares

#: Shape parameters (q,) → h (n,) and its Jacobian (n, q).
Shape = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


#: Tries to find out which channel is the brightest.
CHANGES_OF_LEAD = 3


@dataclass(frozen=True)
class JointFit:
    """Shape, weights and offset together, in the series' own units.

    Attributes
    ----------
    shape
        (q,) θ.
    weights
        (C,) maximum 1.
    offset
        Common to all channels.
    least_squares
        The solution of `[θ, weights of all but the brightest channel, offset if fitted]`.
    brightest
        The channel whose weight is held at 1.
    """

    shape: FloatArray
    weights: FloatArray
    offset: float
    least_squares: LeastSquaresFit
    brightest: int

    @property
    def chi2(self) -> float:
        """Sum of squared whitened residuals, the offset's prior included."""
        return self.least_squares.chi2

    @property
    def n_parameters(self) -> int:
        """Parameters fitted."""
        return len(self.least_squares.parameters)

    def frame_residuals(self, data: WhitenedSeries) -> tuple[FloatArray, FloatArray]:
        """(n,) residuals along the signal, one of unit variance per frame; (n,) squared SNR."""
        unit = data.unit_signal(self.weights)
        length = np.linalg.norm(unit, axis=1)
        residuals = self.least_squares.residuals[: unit.size].reshape(unit.shape)
        along = np.einsum("fc,fc->f", unit, residuals) / np.where(length > 0, length, 1.0)
        signal = residuals + data.values - self.offset * data.ones
        return along, np.einsum("fc,fc->f", signal, signal)


def fit_jointly(
    data: WhitenedSeries,
    shape: Shape,
    start: FloatArray,
    weights: FloatArray,
    offset: float,
    lower: FloatArray,
    upper: FloatArray,
    max_iterations: int,
    tolerance: float,
) -> JointFit:
    """Least squares over θ, weights and offset.

    Parameters
    ----------
    data
        n frames of C channels.
    shape
        h and its Jacobian.
    start, lower, upper
        (q,) θ and its bounds.
    weights, offset
        (C,) and scalar to start from.
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
            problem.pack(theta, weights / weights[brightest], offset),
            lower=problem.pack(lower, np.zeros_like(weights), -np.inf),
            upper=problem.pack(upper, np.full_like(weights, np.inf), np.inf),
            max_iterations=max_iterations,
            tolerance=tolerance,
        )
        theta, weights, offset = problem.unpack(solution.parameters)
        # Of two channels about equally bright the other one may turn out to lead.
        if weights.max() <= 1:
            break
    return JointFit(theta, weights, offset, solution, brightest)


@dataclass(frozen=True)
class JointProblem:
    """Residuals as a function of [θ, weights of the other channels, offset if fitted]."""

    data: WhitenedSeries
    shape: Shape
    n_shape: int
    others: list[int]

    def pack(self, theta: FloatArray, weights: FloatArray, offset: float) -> FloatArray:
        """The parameters as one vector."""
        last = [offset] if self.data.series.has_offset else []
        return np.concatenate([theta, weights[self.others], last])

    def unpack(self, x: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """θ, weights of all channels (C,), offset."""
        weights = np.ones(self.data.values.shape[1])
        weights[self.others] = x[self.n_shape : self.n_shape + len(weights) - 1]
        return x[: self.n_shape], weights, float(x[-1]) if self.data.series.has_offset else 0.0

    def residuals(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened model − data (n C,) and its Jacobian, the offset's prior as a last row."""
        data, q, others = self.data, self.n_shape, self.others
        theta, weights, offset = self.unpack(x)
        h, slopes = self.shape(theta)
        unit = data.unit_signal(weights)
        jacobian = np.empty((*unit.shape, len(x)))
        jacobian[:, :, :q] = unit[:, :, None] * slopes[:, None, :]
        if others:
            jacobian[:, :, q : q + len(others)] = h[:, None, None] * data.matrices[:, :, others]
        r = unit * h[:, None] - data.values
        if not data.series.has_offset:
            return r.ravel(), jacobian.reshape(r.size, len(x))
        jacobian[:, :, -1] = data.ones
        prior = np.zeros((1, len(x)))
        prior[0, -1] = 1 / data.series.offset_sigma
        return (
            np.append(r + offset * data.ones, offset / data.series.offset_sigma),
            np.vstack([jacobian.reshape(r.size, len(x)), prior]),
        )


def parameter_sigma(fit: JointFit, series: DecaySeries) -> tuple[FloatArray, float]:
    """σ of the channel weights (C,) and of the offset; 0 for what is held."""
    sigma = fit.least_squares.sigma
    n_shape = len(fit.shape)
    weights = np.zeros(len(fit.weights))
    others = [c for c in range(len(weights)) if c != fit.brightest]
    weights[others] = sigma[n_shape : n_shape + len(others)]
    return weights, float(sigma[-1]) if series.has_offset else 0.0
