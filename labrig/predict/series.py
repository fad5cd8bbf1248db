"""What a decay's fit will be given: times, states, noise by its sources."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit import FloatArray
from labrig.material import exponential_means
from labrig.predict.frames import ExpectedFrames
from labrig.predict.glow import Glow
from labrig.reduce import TWO_DEGREES, fit_dark

PHOTONS, READING, FLICKER, DARK = "photons", "reading", "flicker", "dark"


@dataclass(frozen=True, eq=False)
class ExpectedSeries:
    """n frames, C channels, m states; values are in DN/s.

    Attributes
    ----------
    t_s, exposure_s
        (n,) of the frames.
    k_r_per_s, amplitude
        (m,) of the states.
    weights
        (C,) of the channels, maximum 1.
    variances
        By source, (n, C), independent between values.
    flicker
        ρ, common to the channels of a frame.
    offset_sigma
        (C,) prior σ of the channels' offsets, 0 where held.
    """

    t_s: FloatArray
    exposure_s: FloatArray
    k_r_per_s: FloatArray
    amplitude: FloatArray
    weights: FloatArray
    variances: Mapping[str, FloatArray]
    flicker: float
    offset_sigma: FloatArray

    @property
    def curve(self) -> FloatArray:
        """(n,) what the brightest channel shows."""
        means = exponential_means(self.k_r_per_s, self.t_s, self.exposure_s)
        curve: FloatArray = means @ self.amplitude
        return curve

    @property
    def variance(self) -> FloatArray:
        """(n, C) of each value, flicker left out."""
        return np.asarray(sum(self.variances.values()))


def expected_series(
    glow: Glow,
    t_s: FloatArray,
    frames: ExpectedFrames,
    darks: ExpectedFrames | None,
    background: ExpectedFrames | None,
    flicker: float,
) -> ExpectedSeries:
    """The series of a patch.

    Parameters
    ----------
    t_s
        (n,) begin of the frames after lamp off.
    frames
        n frames of the patch.
    darks
        Of the patch, if they are subtracted.
    background
        The same n frames in another region, if that is subtracted instead.
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
        k_r_per_s=glow.k_r_per_s,
        amplitude=glow.amplitude,
        weights=np.array([*glow.weights.values()]),
        variances={source: part / per_second**2 for source, part in variances.items()},
        flicker=flicker,
        offset_sigma=offset_sigma,
    )


def _dark_level_sigma(frames: ExpectedFrames, darks: ExpectedFrames) -> FloatArray:
    """(C,) DN/s, what the dark frames leave open of the dark level, as `reduce_patches` has it."""
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


def repeated(series: ExpectedSeries, kept: NDArray[np.bool_], times: int) -> ExpectedSeries:
    """The frames `kept` (n,) of so many decays, which one fit takes together."""
    return ExpectedSeries(
        t_s=np.tile(series.t_s[kept], times),
        exposure_s=np.tile(series.exposure_s[kept], times),
        k_r_per_s=series.k_r_per_s,
        amplitude=series.amplitude,
        weights=series.weights,
        variances={name: np.tile(v[kept], (times, 1)) for name, v in series.variances.items()},
        flicker=series.flicker,
        offset_sigma=series.offset_sigma,
    )
