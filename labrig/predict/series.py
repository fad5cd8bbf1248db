"""Expected data of a decay fit: times, states and noise by source."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.predict.frames import ExpectedFrames
from labrig.predict.glow import Glow, StateMeans, state_means
from labrig.reduce import TWO_DEGREES, fit_dark

PHOTONS, READING, FLICKER, DARK = "photons", "reading", "flicker", "dark"


@dataclass(frozen=True, eq=False)
class ExpectedSeries:
    """Expected data of n frames with C channels and m states.

    Attributes
    ----------
    t_s
        Begins of the exposures in seconds after lamp off, shape (n,).
    exposure_s
        Exposure times in seconds, shape (n,).
    rate_per_s
        Relative fall of each state at lamp off in 1/s, k_r of the first order, shape (m,).
    shape
        (b − 1)/b of each state, 0 of the first order, whose order is not fitted, shape (m,).
    amplitude
        Amplitudes in DN/s, shape (m,).
    weights
        Weights of the channels, maximum 1, shape (C,).
    variances
        Variances in (DN/s)² by source of noise, independent between values, shape (n, C).
    flicker
        Relative common-mode noise ρ of the channels of a frame.
    offset_sigma
        Prior σ of the channels' offsets in DN/s, 0 for fixed offsets, shape (C,).
    """

    t_s: FloatArray
    exposure_s: FloatArray
    rate_per_s: FloatArray
    shape: FloatArray
    amplitude: FloatArray
    weights: FloatArray
    variances: Mapping[str, FloatArray]
    flicker: float
    offset_sigma: FloatArray

    @property
    def curve(self) -> FloatArray:
        """Signal of the brightest channel in DN/s, shape (n,)."""
        curve: FloatArray = self.means().value @ self.amplitude
        return curve

    def means(self) -> StateMeans:
        """Return the means of the states over the exposures, with derivatives."""
        return state_means(self.rate_per_s, self.shape, self.t_s, self.exposure_s)

    @property
    def variance(self) -> FloatArray:
        """Variance of each value in (DN/s)² without flicker, shape (n, C)."""
        return np.asarray(sum(self.variances.values()))


def expected_series(
    glow: Glow,
    t_s: FloatArray,
    frames: ExpectedFrames,
    darks: ExpectedFrames | None,
    background: ExpectedFrames | None,
    flicker: float,
) -> ExpectedSeries:
    """Return the expected data of a patch.

    Parameters
    ----------
    glow
        Glow of the patch.
    t_s
        Begins of the exposures in seconds after lamp off, shape (n,).
    frames
        Expected frames of the patch.
    darks
        Expected dark frames of the patch; None if none are subtracted.
    background
        Expected frames of the background region; None if it is not subtracted.
    flicker
        Relative common-mode noise ρ of a frame.
    """
    per_second = frames.exposure_s[:, np.newaxis]
    variances = {
        PHOTONS: frames.photon_variance,
        READING: frames.read_variance,
        DARK: frames.dark_variance,
    }
    if background is not None:
        variances[READING] = variances[READING] + background.read_variance
        variances[DARK] = variances[DARK] + background.dark_variance
    offset_sigma = np.zeros(len(frames.channels))
    if darks is not None:
        offset_sigma = _dark_level_sigma(frames, darks)
    return ExpectedSeries(
        t_s=t_s,
        exposure_s=frames.exposure_s,
        rate_per_s=glow.rate_per_s,
        shape=glow.shape,
        amplitude=glow.amplitude,
        weights=np.array([*glow.weights.values()]),
        variances={source: part / per_second**2 for source, part in variances.items()},
        flicker=flicker,
        offset_sigma=offset_sigma,
    )


def _dark_level_sigma(frames: ExpectedFrames, darks: ExpectedFrames) -> FloatArray:
    """Return the uncertainty of the dark level in DN/s, shape (C,), as in `reduce_patches`."""
    level = np.broadcast_to(darks.dark_dn, darks.light_dn.shape)
    model = fit_dark(darks.exposure_s, level, np.sqrt(darks.variance))
    sigma = np.array(
        [
            np.hypot(model.dark_level(exposure_s)[1], TWO_DEGREES * model.current(exposure_s))
            / exposure_s
            for exposure_s in frames.exposure_s
        ]
    )
    weights = frames.exposure_s[:, np.newaxis] ** 2 / frames.variance
    return np.asarray(np.average(sigma, axis=0, weights=weights))


def repeated(series: ExpectedSeries, usable: NDArray[np.bool_], times: int) -> ExpectedSeries:
    """Return the frames `usable` of several decays that one fit takes together."""
    return ExpectedSeries(
        t_s=np.tile(series.t_s[usable], times),
        exposure_s=np.tile(series.exposure_s[usable], times),
        rate_per_s=series.rate_per_s,
        shape=series.shape,
        amplitude=series.amplitude,
        weights=series.weights,
        variances={name: np.tile(v[usable], (times, 1)) for name, v in series.variances.items()},
        flicker=series.flicker,
        offset_sigma=series.offset_sigma,
    )
