"""Noise model of a camera, and the expected signal and noise of its frames."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from labrig.acquire import TYPICAL_BYTES_PER_PIXEL, CameraCapabilities
from labrig.foundation.arrays import FloatArray
from labrig.foundation.region import Region, region_pixels
from labrig.predict.glow import Glow, state_means
from labrig.reduce import (
    ChannelStats,
    FrameMeasurement,
    rounded_variance,
    shared_rounding_variance,
)

#: Conversion gain in electrons per DN at ISO 100 of a typical full-frame DSLR with 14 bits.
TYPICAL_ELECTRONS_PER_DN = 4.0
#: Read noise in electrons, before amplification, and after it at ISO 100.
TYPICAL_NOISE_BEFORE_GAIN = 2.5
TYPICAL_NOISE_AFTER_GAIN = 27.0
#: Range from black to white in DN.
TYPICAL_RANGE_DN = 14_500.0
#: Dark current of a pixel near room temperature in electrons per second.
TYPICAL_DARK_ELECTRONS_PER_S = 0.1
#: Number of pixels.
TYPICAL_PIXELS = 20e6
#: Brightest over mean signal in a patch: vignetting, shading of the lamp, structure of the sample.
TYPICAL_UNEVENNESS = 1.1
BAYER_FRACTIONS = {"R": 0.25, "G": 0.5, "B": 0.25}


@dataclass(frozen=True)
class CameraFigures:
    """Noise and range of a camera at one ISO.

    Attributes
    ----------
    width, height
        Size of a frame in pixels.
    iso
        Sensitivity at which the other figures hold.
    electrons_per_dn
        Conversion gain in electrons per DN.
    read_noise_electrons
        Read noise of a pixel in electrons.
    dark_electrons_per_s
        Dark current of a pixel in electrons per second.
    range_dn
        Range from black to white in DN.
    unevenness
        Brightest over mean signal within a patch, without noise.
    channel_fractions
        Fraction of the pixels in each channel.
    """

    width: int
    height: int
    iso: float
    electrons_per_dn: float
    read_noise_electrons: float
    dark_electrons_per_s: float = TYPICAL_DARK_ELECTRONS_PER_S
    range_dn: float = TYPICAL_RANGE_DN
    unevenness: float = TYPICAL_UNEVENNESS
    channel_fractions: Mapping[str, float] = field(default_factory=lambda: dict(BAYER_FRACTIONS))

    @property
    def read_noise_dn(self) -> float:
        """Read noise of a pixel in DN."""
        return self.read_noise_electrons / self.electrons_per_dn

    @property
    def dark_dn_per_s(self) -> float:
        """Dark current of a pixel in DN/s."""
        return self.dark_electrons_per_s / self.electrons_per_dn

    def pixels(self, region: Region, channel: str) -> float:
        """Return the number of pixels of a channel in a region."""
        _, _, width, height = region_pixels(region, self.width, self.height)
        return width * height * self.channel_fractions[channel]

    def at_iso(self, iso: float) -> "CameraFigures":
        """Return the camera at another ISO; its read noise scales as that of the typical camera."""
        change = typical_read_noise_electrons(iso) / typical_read_noise_electrons(self.iso)
        return replace(
            self,
            iso=iso,
            electrons_per_dn=self.electrons_per_dn * self.iso / iso,
            read_noise_electrons=self.read_noise_electrons * change,
        )


def typical_read_noise_electrons(iso: float) -> float:
    """Return the typical read noise in electrons, added before and after amplification."""
    return math.hypot(TYPICAL_NOISE_BEFORE_GAIN, TYPICAL_NOISE_AFTER_GAIN * 100 / iso)


def typical_camera(capabilities: CameraCapabilities, iso: float) -> CameraFigures:
    """Return typical figures for a camera of which at most the size of a frame is known.

    If only its file's size is known, the aspect ratio is taken for 3:2.
    """
    pixels = capabilities.frame_bytes / TYPICAL_BYTES_PER_PIXEL or TYPICAL_PIXELS
    rows = 2 * round(math.sqrt(pixels / 6))
    width, height = capabilities.frame_pixels or (rows * 3 // 2, rows)
    return CameraFigures(
        width=width,
        height=height,
        iso=iso,
        electrons_per_dn=TYPICAL_ELECTRONS_PER_DN * 100 / iso,
        read_noise_electrons=typical_read_noise_electrons(iso),
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
