"""Noise model of a camera for predictions."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from labrig.acquire import TYPICAL_BYTES_PER_PIXEL, CameraOffers
from labrig.foundation.region import Region, region_pixels

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
#: Relative common-mode noise of a frame; shutters and apertures scatter by 0.5 to 1 %.
TYPICAL_FLICKER = 0.007
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


def typical_camera(offers: CameraOffers, iso: float) -> CameraFigures:
    """Return typical figures for a camera of which at most the size of a frame is known.

    If only its file's size is known, the aspect ratio is taken for 3:2.
    """
    pixels = offers.frame_bytes / TYPICAL_BYTES_PER_PIXEL or TYPICAL_PIXELS
    rows = 2 * round(math.sqrt(pixels / 6))
    width, height = offers.frame_pixels or (rows * 3 // 2, rows)
    return CameraFigures(
        width=width,
        height=height,
        iso=iso,
        electrons_per_dn=TYPICAL_ELECTRONS_PER_DN * 100 / iso,
        read_noise_electrons=typical_read_noise_electrons(iso),
    )
