"""Expected signal and noise of frames."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from labrig.foundation.arrays import FloatArray
from labrig.foundation.region import Region
from labrig.predict.camera import CameraFigures
from labrig.predict.glow import Glow, state_means
from labrig.reduce import (
    ChannelStats,
    FrameMeasurement,
    rounded_variance,
    shared_rounding_variance,
)

#: Standard deviations above the mean at which a normal variate has its 99.5 % quantile.
PEAK_SIGMAS = 2.576


@dataclass(frozen=True, eq=False)
class ExpectedFrames:
    """n expected frames of one region in C channels, in DN above black.

    Attributes
    ----------
    camera
        Camera at the ISO of the frames.
    channels
        Names of the C channels.
    pixels
        Number of pixels of the region in each channel, shape (C,).
    exposure_s
        Exposure times in seconds, shape (n,).
    light_dn
        Mean signal of the sample in DN, shape (n, C).
    """

    camera: CameraFigures
    channels: tuple[str, ...]
    pixels: FloatArray
    exposure_s: FloatArray
    light_dn: FloatArray

    @property
    def dark_dn(self) -> FloatArray:
        """Mean dark current in DN, shape (n, 1)."""
        return self.exposure_s[:, np.newaxis] * self.camera.dark_dn_per_s

    @property
    def pixel_variance(self) -> FloatArray:
        """Variance of a pixel in DN², rounded as it is, shape (n, C)."""
        return rounded_variance(self._unrounded_variance)

    @property
    def _electrons_variance(self) -> FloatArray:
        return np.asarray((self.light_dn + self.dark_dn) / self.camera.electrons_per_dn)

    @property
    def _unrounded_variance(self) -> FloatArray:
        return self._electrons_variance + self.camera.read_noise_dn**2

    @property
    def photon_variance(self) -> FloatArray:
        """Variance of the mean by photon noise in DN², shape (n, C)."""
        return self.light_dn / self.camera.electrons_per_dn / self.pixels

    @property
    def read_variance(self) -> FloatArray:
        """Variance of the mean by read noise and rounding in DN², shape (n, C).

        What noise does not dither is an error of all pixels alike, and does not average out.
        """
        own = self.pixel_variance - self._electrons_variance
        return own / self.pixels + shared_rounding_variance(self._unrounded_variance)

    @property
    def dark_variance(self) -> FloatArray:
        """Variance of the mean by dark current in DN², shape (n, C)."""
        return self.dark_dn / self.camera.electrons_per_dn / self.pixels

    @property
    def variance(self) -> FloatArray:
        """Variance of the mean in DN² without flicker, shape (n, C)."""
        return self.photon_variance + self.read_variance + self.dark_variance

    @property
    def saturated(self) -> FloatArray:
        """Fraction of the pixels that clip, shape (n, C)."""
        brightest = self.light_dn * self.camera.unevenness + self.dark_dn
        deviation = np.sqrt(self.pixel_variance)
        return np.asarray(ndtr((brightest - self.camera.range_dn) / deviation))

    def measurements(self) -> list[FrameMeasurement]:
        """Return each frame as `labrig.reduce.measure` would reduce it."""
        camera = self.camera
        mean = np.minimum(self.light_dn + self.dark_dn, camera.range_dn)
        deviation = np.sqrt(self.pixel_variance)
        peak = self.light_dn * camera.unevenness + self.dark_dn + PEAK_SIGMAS * deviation
        sigma, saturated = np.sqrt(self.variance), self.saturated * self.pixels

        def channel(row: int, c: int) -> ChannelStats:
            return ChannelStats(
                mean=float(mean[row, c]),
                sigma=float(sigma[row, c]),
                std=float(deviation[row, c]),
                peak=float(min(peak[row, c], camera.range_dn)),
                n=round(self.pixels[c]),
                saturated=round(saturated[row, c]),
                hot=0,
            )

        return [
            FrameMeasurement(
                channels={name: channel(row, c) for c, name in enumerate(self.channels)},
                cfa="",
                black=(0.0,),
                white=camera.range_dn,
                width=camera.width,
                height=camera.height,
                exposure_s=float(exposure_s),
                iso=camera.iso,
                f_number=None,
                make=None,
                model=None,
            )
            for row, exposure_s in enumerate(self.exposure_s)
        ]


def glow_frames(
    glow: Glow, camera: CameraFigures, region: Region, t_s: FloatArray, exposure_s: FloatArray
) -> ExpectedFrames:
    """Return the expected frames of a glow that begin `t_s` (n,) seconds after lamp off."""
    means, _ = state_means(glow.rate_per_s, glow.shape, t_s, exposure_s)
    decay = means @ glow.amplitude
    light_dn = np.multiply.outer(exposure_s * decay, np.array([*glow.weights.values()]))
    return _frames(camera, region, tuple(glow.weights), exposure_s, light_dn)


def dark_frames(
    camera: CameraFigures, region: Region, channels: tuple[str, ...], exposure_s: FloatArray
) -> ExpectedFrames:
    """Return the expected frames of a region without light."""
    light_dn = np.zeros((len(exposure_s), len(channels)))
    return _frames(camera, region, channels, exposure_s, light_dn)


def _frames(
    camera: CameraFigures,
    region: Region,
    channels: tuple[str, ...],
    exposure_s: FloatArray,
    light_dn: FloatArray,
) -> ExpectedFrames:
    pixels = np.array([camera.pixels(region, name) for name in channels])
    return ExpectedFrames(camera, channels, pixels, exposure_s, light_dn)
