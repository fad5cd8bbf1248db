"""A measured decay, validated and scaled to order 1.

Lamp, shutter and aperture make a whole frame brighter or darker by a relative ρ, so that the values
of one frame scatter together: Cov = N + ρ² s sᵀ with s the frame's signal and N = (σ_c r_cd σ_d)
the read and photon noise, r the channels' correlation. Residuals and models are multiplied by a
W with Wᵀ W = Cov⁻¹, frame by frame, after which they are independent with unit variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.fit.nonlinear_least_squares import EPSILON
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError

#: Slowest rate searched: 1 / (this many spans of the data).
SLOWEST_SPANS = 50.0
#: Fastest rate searched: this many decays within the shortest step between frames.
FASTEST_DECAYS = 10.0

NO_DECAY = (
    "expected a signal that decays, got none that a positive exponential describes; "
    "was the sample charged, is the background right, do times count from lamp off?"
)


@dataclass(frozen=True)
class DecaySeries:
    """Frames of C channels by rising time; times in spans, values in units of the largest one.

    Attributes
    ----------
    t, exposure
        Begin since that of the first frame, and length of the exposures, in spans, shape (n,).
    values, inverse_sigma
        Values and inverse σ, shape (n, C); an inverse σ of 0 marks a missing value.
    correlation
        Correlation of the channels' noise within a frame without flicker, shape (C, C).
    offset_sigma
        Prior σ of the channels' offsets, shape (C,): 0 held at zero, inf free.
    offset_correlation
        Correlation of the offsets' priors, shape (C, C).
    span_s, peak
        Units of the times, in s, and of the values.
    first_s, reference_s
        Times as given, in s, of the first frame, and at which amplitudes are told and laws begin:
        0, which is lamp off, or that of the first frame.
    order
        Indices that sort the frames as given by time, shape (n,).
    repeat, levels
        Index of the charge that a frame follows, shape (n,), and divisor of the values after each
        charge, shape (r,).
    channels, repeats
        Names of the C channels and of the r charges.
    sigma_given
        False if σ is a scale still to be estimated.
    """

    t: FloatArray
    exposure: FloatArray
    values: FloatArray
    inverse_sigma: FloatArray
    correlation: FloatArray
    offset_sigma: FloatArray
    offset_correlation: FloatArray
    span_s: float
    peak: float
    first_s: float
    reference_s: float
    order: NDArray[np.intp]
    repeat: NDArray[np.intp]
    levels: FloatArray
    channels: tuple[str, ...]
    repeats: tuple[str, ...]
    sigma_given: bool

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.t)

    def from_first_frame(self) -> "DecaySeries":
        """Return the series with its first frame as the reference of amplitudes and laws."""
        return replace(self, reference_s=self.first_s)

    @property
    def start(self) -> float:
        """Time of the first frame after the reference, in spans."""
        return (self.first_s - self.reference_s) / self.span_s

    @property
    def t_s(self) -> FloatArray:
        """Start of the exposures in s, as given, shape (n,)."""
        return np.asarray(self.first_s + self.t * self.span_s)

    @cached_property
    def n_values(self) -> int:
        """Number of values measured."""
        return int(np.count_nonzero(self.inverse_sigma))

    @cached_property
    def frame_levels(self) -> FloatArray:
        """Divisor of the values of each frame, shape (n, 1)."""
        return self.levels[self.repeat][:, None]

    @cached_property
    def whiteners(self) -> FloatArray:
        """Matrices W with Wᵀ W the inverse covariance of each frame without flicker, (n, C, C)."""
        measured = self.inverse_sigma > 0
        roots = np.zeros((self.n_frames, *self.correlation.shape))
        for pattern in np.unique(measured, axis=0):
            block = np.ix_(pattern, pattern)
            roots[np.ix_((measured == pattern).all(axis=1), pattern, pattern)] = np.linalg.inv(
                np.linalg.cholesky(self.correlation[block])
            )
        whiteners: FloatArray = roots * self.inverse_sigma[:, None, :]
        return whiteners

    @cached_property
    def offset_prior(self) -> FloatArray:
        """Rows that, times the fitted offsets, have unit variance by their prior, shape (p, m)."""
        constrained = np.flatnonzero(np.isfinite(self.offset_sigma) & (self.offset_sigma > 0))
        sigma = self.offset_sigma[constrained]
        covariance = self.offset_correlation[np.ix_(constrained, constrained)] * np.outer(
            sigma, sigma
        )
        rows = np.zeros((len(constrained), len(self.fitted_offsets)))
        columns = np.searchsorted(self.fitted_offsets, constrained)
        rows[:, columns] = np.linalg.inv(np.linalg.cholesky(covariance))
        return rows

    def relevelled(self, gains: FloatArray) -> "DecaySeries":
        """Return the series with the values after each charge divided by their gain (r,) > 0."""
        frame_gains = gains[self.repeat][:, None]
        return replace(
            self,
            values=self.values / frame_gains,
            inverse_sigma=self.inverse_sigma * frame_gains,
            levels=self.levels * gains,
        )

    @cached_property
    def fitted_offsets(self) -> NDArray[np.intp]:
        """Indices of the channels whose offset is fitted, shape (m,)."""
        return np.flatnonzero(self.offset_sigma)

    @cached_property
    def log_rate_bounds(self) -> tuple[float, float]:
        """Logarithms of the slowest and the fastest rate that the times resolve, in 1/spans."""
        return float(-np.log(SLOWEST_SPANS)), float(np.log(FASTEST_DECAYS / self.shortest_step))

    @cached_property
    def shortest_step(self) -> float:
        """Shortest step between frames of one repeat, in spans.

        Frames of two repeats are as far apart as the clock is uncertain.
        """
        steps = np.concatenate([np.diff(self.t[self.repeat == one]) for one in set(self.repeat)])
        if not (steps > 0).any():
            steps = np.diff(self.t)
        return float(steps[steps > 0].min())


def decay_series(
    t_s: ArrayLike,
    values: ArrayLike,
    sigma: ArrayLike | None,
    exposure_s: ArrayLike,
    channels: Sequence[str],
    offset_sigma: ArrayLike,
    repeats: Sequence[str] | None = None,
    correlation: ArrayLike | None = None,
    offset_correlation: ArrayLike | None = None,
) -> DecaySeries:
    """Validate, sort and scale; the arguments are those of `labrig.fit.decay.fit_decay`.

    Raises
    ------
    FitError
        Shapes disagree, values are not finite or all zero, or all frames have the same time.
    """
    t = np.asarray(t_s, dtype=np.float64)
    if t.ndim != 1 or len(t) < 2:
        raise FitError(f"expected times of two or more values, got shape {t.shape}; record more")
    y = np.asarray(values, dtype=np.float64)
    y = y[:, None] if y.ndim == 1 else y
    names = tuple(channels)
    if y.shape != (len(t), len(names)):
        raise FitError(
            f"expected values of {len(t)} frames in {len(names)} channel(s) "
            f"({', '.join(names)}), got shape {np.shape(values)}; give one row per frame"
        )
    frame_repeats = [""] * len(t) if repeats is None else list(repeats)
    if len(frame_repeats) != len(t):
        raise FitError(f"expected {len(t)} repeats, got {len(frame_repeats)}; give one per frame")
    repeat_names = tuple(dict.fromkeys(frame_repeats))
    inverse_sigma = _inverse_sigma(sigma, y)
    prior_sigma = _prior_sigma(offset_sigma, len(names))
    measured = inverse_sigma > 0
    try:
        exposure = np.broadcast_to(np.asarray(exposure_s, dtype=np.float64), t.shape)
    except ValueError as error:
        raise FitError(
            f"expected one exposure or {len(t)}, got {np.size(exposure_s)}; give one per frame"
        ) from error
    _refuse_unless_finite("times", t)
    _refuse_unless_finite("values", y[measured])
    _refuse_unless_finite("exposures", exposure)
    if exposure.min() < 0:
        raise FitError(f"expected exposures ≥ 0, got {exposure.min():g} s; give their lengths")
    if t.min() < 0 <= t.max():
        raise FitError(
            f"expected all times after lamp off, at 0 s, got {t.min():g} s; leave out the "
            "frames before it, or count the time from when the lamp went off"
        )
    order = np.argsort(t, kind="stable")
    span = float(t.max() - t.min())
    if span == 0:
        raise FitError(f"expected values at several times, got all at {t[0]:g} s; record a decay")
    y = np.where(measured, y, 0.0)
    peak = float(np.abs(y).max())
    if y.max() <= 0:
        raise FitError(
            "expected a positive signal, got none above zero; "
            "check that the sample was charged and the dark level subtracted once"
        )
    return DecaySeries(
        t=(t[order] - t.min()) / span,
        exposure=exposure[order] / span,
        values=y[order] / peak,
        inverse_sigma=inverse_sigma[order] * (peak if sigma is not None else 1.0),
        correlation=_correlation(correlation, len(names)),
        # A channel that was not measured has no offset to fit.
        offset_sigma=np.where(measured.any(axis=0), prior_sigma / peak, 0.0),
        offset_correlation=_correlation(offset_correlation, len(names)),
        span_s=span,
        peak=peak,
        first_s=float(t.min()),
        # A clock whose zero is after all frames tells nothing of lamp off.
        reference_s=min(float(t.min()), 0.0),
        order=order,
        repeat=np.array([repeat_names.index(name) for name in frame_repeats])[order],
        levels=np.ones(len(repeat_names)),
        channels=names,
        repeats=repeat_names,
        sigma_given=sigma is not None,
    )


def _inverse_sigma(sigma: ArrayLike | None, y: FloatArray) -> FloatArray:
    if sigma is None:
        if y.shape[1] > 1:
            raise FitError(
                f"expected σ for every value of {y.shape[1]} channels, got none; without them the "
                "channels cannot be weighed against each other: give σ or fit one channel"
            )
        return np.ones_like(y)
    s = np.asarray(sigma, dtype=np.float64)
    s = s[:, None] if s.ndim == 1 else s
    try:
        s = np.broadcast_to(s, y.shape)
    except ValueError as error:
        raise FitError(
            f"expected σ of shape {y.shape}, got {np.shape(sigma)}; give one σ per value"
        ) from error
    if not np.all(s > 0):
        raise FitError(
            f"expected σ > 0, got {float(np.nanmin(s)):g} or NaN in "
            f"{np.count_nonzero(~(s > 0))} value(s); give the reading's uncertainty, "
            "or inf for a value to leave out"
        )
    return 1 / s


def _correlation(correlation: ArrayLike | None, n_channels: int) -> FloatArray:
    if correlation is None:
        return np.eye(n_channels)
    matrix = np.asarray(correlation, dtype=np.float64)
    proper = matrix.shape == (n_channels, n_channels) and bool(
        np.allclose(matrix, matrix.T)
        and np.allclose(np.diag(matrix), 1)
        and np.linalg.eigvalsh(matrix).min() > 0
    )
    if not proper:
        raise FitError(
            f"expected a correlation matrix of {n_channels} channels, symmetric, positive and 1 on "
            f"its diagonal, got {matrix.tolist()}; leave it out for independent channels"
        )
    return matrix


def _prior_sigma(offset_sigma: ArrayLike, n_channels: int) -> FloatArray:
    s = np.asarray(offset_sigma, dtype=np.float64)
    if s.shape not in {(), (n_channels,)}:
        raise FitError(
            f"expected 1 or {n_channels} σ of the offset, got shape {s.shape}; give one per channel"
        )
    if not np.all(s >= 0):
        raise FitError(f"expected σ of the offset ≥ 0, got {s.min():g}; 0 holds the offset at 0")
    return np.broadcast_to(s, n_channels)


def _refuse_unless_finite(quantity: str, values: FloatArray) -> None:
    n_bad = np.count_nonzero(~np.isfinite(values))
    if n_bad:
        raise FitError(
            f"expected finite {quantity}, got {n_bad} that are NaN or infinite; "
            "leave those frames out (or give the value σ = inf)"
        )


@dataclass(frozen=True)
class WhitenedSeries:
    """A series multiplied by the whitening matrices W of its noise.

    Attributes
    ----------
    series
        The original series.
    matrices
        One W per frame, with Wᵀ W = Cov⁻¹, shape (n, C, C).
    values
        Whitened values, shape (n, C).
    target
        Whitened values in one row, then 0 for each of the p offsets with a finite prior σ, shape
        (n C + p,).
    offset_design
        Effect of an offset of 1 in each channel with a fitted offset on the target, its prior
        included, shape (n C + p, m).
    variance
        Variance of each value alone, flicker included, shape (n, C); inf where missing.
    """

    series: DecaySeries
    matrices: FloatArray
    values: FloatArray
    target: FloatArray
    offset_design: FloatArray
    variance: FloatArray

    def constant(self, levels: FloatArray) -> FloatArray:
        """Return the whitened signal (n, C) of the same levels (C,) in all frames."""
        constant: FloatArray = self.matrices @ levels
        return constant

    def offsets_of(self, residual: FloatArray) -> FloatArray:
        """Return the offsets (C,) that best explain whitened residuals (n C + p,)."""
        offsets = np.zeros(len(self.series.channels))
        offsets[self.series.fitted_offsets] = np.linalg.lstsq(self.offset_design, residual)[0]
        return offsets

    def signal_design(self, unit: FloatArray, shapes: FloatArray) -> FloatArray:
        """Return the design (n C + p, q) of shapes (n, q) times a whitened signal `unit` (n, C)."""
        design = np.zeros((len(self.target), shapes.shape[1]))
        design[: unit.size] = (unit[:, :, None] * shapes[:, None, :]).reshape(unit.size, -1)
        return design

    def leverage(self, weights: FloatArray, design: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the degrees of freedom a linear model takes from each frame, by its hat matrix.

        Parameters
        ----------
        weights
            Weights of the channels, shape (C,).
        design
            Columns of the model, shape (n C + p, q).

        Returns
        -------
        along, across
            Degrees of freedom along the signal, at most 1 each, and across it, at most C − 1, both
            (n,).
        """
        unit = self.constant(weights)
        length = np.linalg.norm(unit, axis=1)
        norms = np.linalg.norm(design, axis=0)
        u, s, _ = np.linalg.svd(design / np.where(norms > 0, norms, 1.0), full_matrices=False)
        independent = s > max(design.shape) * EPSILON * s.max(initial=0.0)
        frames = u[: unit.size, independent].reshape(*unit.shape, -1)
        direction = unit / np.where(length > 0, length, 1.0)[:, None]
        along = (np.einsum("fc,fcq->fq", direction, frames) ** 2).sum(axis=1)
        return along, (frames**2).sum(axis=(1, 2)) - along

    def independent_data(self, weights: FloatArray) -> float:
        """Return the effective number of independent values of the common signal, n to n C.

        It is the ratio of the information in all channels to that in the best one: with common-mode
        flicker a second channel adds little.
        """
        unit = self.constant(weights)
        information = np.einsum("fc,fc->f", unit, unit)
        best = (weights**2 / self.variance).max(axis=1)
        informative = best > 0
        return float((information[informative] / best[informative]).sum())


def whitened(series: DecaySeries, signal: FloatArray, flicker: float) -> WhitenedSeries:
    """Return the series in units of its noise.

    Parameters
    ----------
    series
        Series of n frames and C channels.
    signal
        Model of the signal without offset, for the flicker's covariance, shape (n, C).
    flicker
        Relative flicker ρ ≥ 0.
    """
    measured = series.inverse_sigma > 0
    matrices = whitening_matrices(series, signal, flicker)
    own_variance = 1 / np.where(measured, series.inverse_sigma, 1.0) ** 2
    values = np.einsum("fcd,fd->fc", matrices, series.values)
    fitted = series.fitted_offsets
    prior = series.offset_prior
    return WhitenedSeries(
        series=series,
        matrices=matrices,
        values=values,
        target=np.append(values, np.zeros(len(prior))),
        offset_design=np.vstack([matrices[:, :, fitted].reshape(values.size, -1), prior]),
        variance=np.where(measured, own_variance + (flicker * signal) ** 2, np.inf),
    )


def whitening_matrices(series: DecaySeries, signal: FloatArray, flicker: float) -> FloatArray:
    """Return one W per frame with Wᵀ W = Cov⁻¹, shape (n, C, C); the arguments are as above."""
    matrices = series.whiteners
    if flicker > 0:
        u = flicker * np.einsum("fcd,fd->fc", matrices, signal)
        root = np.sqrt(1 + np.einsum("fc,fc->f", u, u))
        # (1 + u uᵀ)^(−1/2) = 1 − u uᵀ / (root (1 + root)), without dividing by |u|.
        shrink = u / (root * (1 + root))[:, None]
        along = np.einsum("fc,fcd->fd", u, matrices)
        matrices = matrices - shrink[:, :, None] * along[:, None, :]
    return matrices
