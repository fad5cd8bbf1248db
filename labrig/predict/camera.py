"""What of a camera decides how noisy its frames are."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from labrig.acquire import CameraOffers
from labrig.region import Region, region_pixels

#: Of a full-format DSLR with 14 bits, for want of anything measured: electrons a DN at ISO 100, …
TYPICAL_ELECTRONS_PER_DN = 4.0
#: … noise of reading a pixel, before amplification and after it at ISO 100, in electrons, …
TYPICAL_NOISE_BEFORE_GAIN = 2.5
TYPICAL_NOISE_AFTER_GAIN = 27.0
#: … black to white, …
TYPICAL_RANGE_DN = 14_500.0
#: … dark current of a pixel near room temperature, …
TYPICAL_DARK_ELECTRONS_PER_S = 0.1
#: … and the size of its files in bytes a pixel, compressed without loss.
TYPICAL_BYTES_PER_PIXEL = 1.5
TYPICAL_PIXELS = 20e6
#: Brightest over mean in a patch: shading of lens and lamp, the sample's own structure.
TYPICAL_UNEVENNESS = 1.1
#: Shutters and apertures scatter by 0.5 to 1 % from frame to frame.
TYPICAL_FLICKER = 0.007
BAYER_FRACTIONS = {"R": 0.25, "G": 0.5, "B": 0.25}


@dataclass(frozen=True)
class CameraFigures:
    """A camera at one ISO.

    Attributes
    ----------
    width, height
        Of a frame, in pixels.
    iso
        At which the following hold.
    electrons_per_dn, read_noise_electrons
        Conversion gain; noise of reading one pixel.
    dark_electrons_per_s
        Dark current of a pixel.
    range_dn
        From black to white.
    unevenness
        Brightest over mean of a patch, without noise.
    channel_fractions
        Fraction of the pixels that each channel has.
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
        """Noise of reading one pixel, DN."""
        return self.read_noise_electrons / self.electrons_per_dn

    @property
    def dark_dn_per_s(self) -> float:
        """Dark current of a pixel, DN/s."""
        return self.dark_electrons_per_s / self.electrons_per_dn

    def pixels(self, region: Region, channel: str) -> float:
        """Pixels of `channel` in `region`."""
        _, _, width, height = region_pixels(region, self.width, self.height)
        return width * height * self.channel_fractions[channel]

    def at_iso(self, iso: float) -> "CameraFigures":
        """The camera at another ISO; how its read noise changes is taken from the typical one."""
        change = typical_read_noise_electrons(iso) / typical_read_noise_electrons(self.iso)
        return replace(
            self,
            iso=iso,
            electrons_per_dn=self.electrons_per_dn * self.iso / iso,
            read_noise_electrons=self.read_noise_electrons * change,
        )


def typical_read_noise_electrons(iso: float) -> float:
    """Noise of reading a pixel: some is added before amplification, some after it."""
    return math.hypot(TYPICAL_NOISE_BEFORE_GAIN, TYPICAL_NOISE_AFTER_GAIN * 100 / iso)


def typical_camera(offers: CameraOffers, iso: float) -> CameraFigures:
    """A camera of which nothing is known but the size of its files; 3 to 2 wide."""
    pixels = offers.frame_bytes / TYPICAL_BYTES_PER_PIXEL or TYPICAL_PIXELS
    height = 2 * round(math.sqrt(pixels / 6))
    return CameraFigures(
        width=height * 3 // 2,
        height=height,
        iso=iso,
        electrons_per_dn=TYPICAL_ELECTRONS_PER_DN * 100 / iso,
        read_noise_electrons=typical_read_noise_electrons(iso),
    )
