"""Expected data of a protocol: schedule, frames, noise, information of the fit.

The decay model is that of `labrig.fit`: Σ_i a_i g(k_i) times one weight per channel, with the shape
of states that are not of the first order, plus an offset per channel with the σ of the dark frames
as prior; Cov = diag(σ²) + ρ² s sᵀ within a frame. Rates and amplitudes are marginalised over
weights and offsets. The inverse information is the covariance of the best unbiased estimator
(Cramér and Rao), which the weighted fit attains.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.acquire import CameraCapabilities, ProtocolModel
from labrig.fit import EPSILON
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import ProtocolError, UsageError
from labrig.foundation.result_warning import Contradiction, Extrapolated, ResultWarning
from labrig.predict.frames import CameraFigures, dark_frames, glow_frames
from labrig.predict.glow import Glow
from labrig.predict.series import DARK, FLICKER, ExpectedSeries, expected_series, repeated
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.protocols.steps.decays import DecaySettings
from labrig.protocols.steps.exposure_metering import Schedule
from labrig.reduce import FrameMeasurement, is_clipped


@dataclass(frozen=True, eq=False)
class Information:
    """Expected covariance of the parameters k1, a1, k2, a2, … of a fit with m states.

    The shapes of the s states that are not of the first order follow.

    Attributes
    ----------
    covariance
        Covariance, shape (2m + s, 2m + s); variances are infinite for parameters that are not
        determined.
    budget
        Fractions of each variance by source of noise, shape (2m + s,); they sum to 1.
    """

    covariance: FloatArray
    budget: Mapping[str, FloatArray]

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainties of k1, a1, …, and of the shapes, shape (2m + s,)."""
        return np.sqrt(np.diag(self.covariance))


def information(series: ExpectedSeries) -> Information:
    """Return covariance and error budget of a fit to `series`."""
    slopes, signal = _slopes(series)
    whitening = _whitening(series, signal)
    values = (whitening @ slopes).reshape(-1, slopes.shape[2])
    priors = series.offset_sigma[series.offset_sigma > 0]
    design = np.zeros((len(values) + len(priors), slopes.shape[2]))
    design[: len(values)] = values
    design[len(values) :, slopes.shape[2] - len(priors) :] = np.diag(1 / priors)
    estimator, undetermined = _pseudo_inverse(design)
    # What a deviation of each value, and of each offset by its σ, does to the parameters.
    value_response = np.einsum(
        "pfc,fcd->pfd", estimator[:, : len(values)].reshape(-1, *signal.shape), whitening
    )
    offset_response = estimator[:, len(values) :]
    parts = {
        source: np.einsum("pfc,fc->p", value_response**2, variance)
        for source, variance in series.variances.items()
    }
    parts[FLICKER] = np.square(
        series.flicker * np.einsum("pfc,fc->pf", value_response, signal)
    ).sum(1)
    parts[DARK] = parts[DARK] + np.square(offset_response).sum(axis=1)
    covariance = estimator @ estimator.T
    covariance[undetermined, :], covariance[:, undetermined] = 0.0, 0.0
    covariance[undetermined, undetermined] = np.inf
    reported = slice(0, 2 * len(series.rate_per_s) + np.count_nonzero(series.shape))
    total = np.sum(list(parts.values()), axis=0)
    return Information(
        covariance=covariance[reported, reported],
        budget={
            source: (part / np.where(total > 0, total, 1.0))[reported]
            for source, part in parts.items()
        },
    )


def _whitening(series: ExpectedSeries, signal: FloatArray) -> FloatArray:
    """Return the whitening matrix W of each frame, Wᵀ W = Cov⁻¹, shape (n, C, C)."""
    covariance = np.einsum("fc,cd->fcd", series.variance, np.eye(signal.shape[1]))
    covariance += series.flicker**2 * np.einsum("fc,fd->fcd", signal, signal)
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _slopes(series: ExpectedSeries) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives by all parameters, shape (n, C, p), and the signal, shape (n, C).

    The parameters are k1, a1, …, the shapes that are not 0, the weights of the other channels, and
    the offsets.
    """
    rates, weights = series.rate_per_s, series.weights
    means, state_slopes = series.means()
    curve = means @ series.amplitude
    other_channels = [c for c in range(len(weights)) if c != int(np.argmax(weights))]
    offset_channels = [c for c in range(len(weights)) if series.offset_sigma[c] > 0]
    of_order = np.flatnonzero(series.shape)
    n_rates = 2 * len(rates)
    n_shape = n_rates + len(of_order)
    slopes = np.zeros(
        (len(curve), len(weights), n_shape + len(other_channels) + len(offset_channels))
    )
    slopes[:, :, 0:n_rates:2] = np.einsum(
        "fi,c->fci", state_slopes[..., 0] * series.amplitude / rates, weights
    )
    slopes[:, :, 1:n_rates:2] = np.einsum("fi,c->fci", means, weights)
    slopes[:, :, n_rates:n_shape] = np.einsum(
        "fi,c->fci", (state_slopes[..., 1] * series.amplitude)[:, of_order], weights
    )
    for place, channel in enumerate(other_channels, start=n_shape):
        slopes[:, channel, place] = curve
    for place, channel in enumerate(offset_channels, start=n_shape + len(other_channels)):
        slopes[:, channel, place] = 1.0
    return slopes, np.multiply.outer(curve, weights)


def _pseudo_inverse(design: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the pseudo-inverse of a design matrix and the parameters that it does not determine.

    Parameters
    ----------
    design
        Design matrix, shape (n, p).

    Returns
    -------
    tuple of ndarray
        Pseudo-inverse, shape (p, n), and mask of the undetermined parameters, shape (p,).
    """
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    u, s, vt = np.linalg.svd(design / scale, full_matrices=False)
    significant = s > max(design.shape) * EPSILON * s[0]
    inverse = (vt[significant].T / s[significant]) @ u[:, significant].T / scale[:, np.newaxis]
    determined = np.einsum("ij,ij->j", vt[significant], vt[significant])
    return inverse, determined < 1 - np.sqrt(EPSILON)


def predictable(protocol: ProtocolModel) -> DecaySettings:
    """Return the protocol if its fit can be predicted.

    Raises
    ------
    UsageError
        If it records no decay.
    """
    if not isinstance(protocol, DecaySettings):
        raise UsageError(
            f"--predict: expected a protocol that records a decay, got '{protocol.protocol}', of "
            "which no rates are fitted"
        )
    return protocol


@dataclass(frozen=True, eq=False)
class Bench:
    """Camera and samples, measured or assumed before the run.

    Attributes
    ----------
    camera
        Camera at some ISO, from which other sensitivities follow.
    flicker
        Relative common-mode noise ρ of a frame.
    glows
        Glow of each predicted patch by name.
    """

    camera: CameraFigures
    flicker: float
    glows: Mapping[str, Glow]

    def at_settings(self, settings: CameraSettings) -> "Bench":
        """Return the bench at a protocol's camera settings."""
        glows = {
            patch: glow.at_settings(settings.iso, settings.f_number)
            for patch, glow in self.glows.items()
        }
        return Bench(self.camera.at_iso(settings.iso), self.flicker, glows)


@dataclass(frozen=True, eq=False)
class Expectation:
    """Expected data and information of one protocol.

    Attributes
    ----------
    exposures_s
        Exposure times of the frames of one decay in seconds.
    series
        Expected data of the fit by patch.
    found
        Information of the fit by patch.
    clipped
        Number of clipped frames of one decay, which are left out, by patch.
    states_chosen
        Whether the fit chooses the number of states.
    warnings
        Warnings of the protocol's metering and of the number of states.
    """

    exposures_s: tuple[float, ...]
    series: Mapping[str, ExpectedSeries]
    found: Mapping[str, Information]
    clipped: Mapping[str, int]
    states_chosen: bool
    warnings: tuple[ResultWarning, ...]


def expect(protocol: DecaySettings, capabilities: CameraCapabilities, bench: Bench) -> Expectation:
    """Predict every patch of a bench.

    Raises
    ------
    ProtocolError
        If too few frames of a patch remain that do not clip.
    """
    bench = bench.at_settings(protocol.camera)
    warnings: list[ResultWarning] = []

    def warn(text: str) -> None:
        warnings.append(Extrapolated("metering-at-limit", "{reason}", reason=text))

    schedule = expected_schedule(protocol, capabilities, bench, warn)
    series, clipped = {}, {}
    for patch, glow in bench.glows.items():
        series[patch], clipped[patch] = _series(protocol, capabilities, bench, patch, schedule)
        if protocol.states not in ("auto", len(glow.rate_per_s)):
            warnings.append(
                Contradiction(
                    "states-differ",
                    "the protocol asks for {requested} states, the material has {states}; "
                    "predicted is a fit of {states}",
                    patch,
                    requested=protocol.states,
                    states=len(glow.rate_per_s),
                )
            )
    return Expectation(
        exposures_s=tuple(schedule.exposures_s),
        series=series,
        found={patch: information(data) for patch, data in series.items()},
        clipped=clipped,
        states_chosen=protocol.states == "auto",
        warnings=tuple(warnings),
    )


def expected_schedule(
    protocol: DecaySettings,
    capabilities: CameraCapabilities,
    bench: Bench,
    warn: Callable[[str], None],
) -> Schedule:
    """Return the schedule that the protocol's metering chooses for the glows of a bench."""

    def expected(t_s: float, exposure_s: float) -> list[FrameMeasurement]:
        at = np.array([t_s]), np.array([exposure_s])
        return [
            glow_frames(glow, bench.camera, protocol.patches[patch], *at).measurements()[0]
            for patch, glow in bench.glows.items()
        ]

    return protocol.expected_schedule(capabilities, expected, warn)


def _series(
    protocol: DecaySettings,
    capabilities: CameraCapabilities,
    bench: Bench,
    patch: str,
    schedule: Schedule,
) -> tuple[ExpectedSeries, int]:
    """Return the expected data of a patch and the number of clipped frames of a decay."""
    camera, region, glow = bench.camera, protocol.patches[patch], bench.glows[patch]
    t_s, exposure_s = np.array(schedule.times_s), np.array(schedule.exposures_s)
    frames = glow_frames(glow, camera, region, t_s, exposure_s)
    darks = background = None
    if protocol.dark == "background" and protocol.background is not None:
        background = dark_frames(camera, protocol.background, frames.channels, exposure_s)
    else:
        darks_s = np.array(protocol.dark_exposures_s(capabilities))
        darks = dark_frames(camera, region, frames.channels, darks_s)
    decay = expected_series(glow, t_s, frames, darks, background, bench.flicker)
    usable = np.asarray(~is_clipped(frames.saturated, 1.0).any(axis=1))
    clipped = int(np.count_nonzero(~usable))
    if len(usable) - clipped < 2 * len(glow.rate_per_s):
        raise ProtocolError(
            f"{patch}: {clipped} of {len(usable)} frames will clip, so that too few are left to "
            "fit; expose for less (or exposure: auto), or lower camera.iso"
        )
    return repeated(decay, usable, protocol.repeats), clipped
