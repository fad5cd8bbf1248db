"""Profile of a filter's strip with its lines, and change of the card's picture."""

from dataclasses import dataclass

from labrig.foundation.arrays import FloatArray
from labrig.results.measured import Measured


@dataclass(frozen=True, eq=False)
class StripProfile:
    """Light along a strip, pixel by pixel.

    Attributes
    ----------
    position
        Positions rising from 0 at the strip's left end to 1 at its right end, shape (n,).
    value_dn_per_s
        Mean signal across the strip in DN/s, shape (n, channels).
    """

    position: FloatArray
    value_dn_per_s: FloatArray


@dataclass(frozen=True, eq=False)
class SliceValues:
    """Light in the slices of a strip, from all frames of one scene.

    Attributes
    ----------
    value, sigma
        Signal and its standard uncertainty in DN/s, shape (positions, channels); NaN where all
        frames clip. σ does not include changes of lamp, shutter and aperture between scenes, which
        are common to all places and channels.
    """

    value: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class LocatedLines:
    """Lines of a lamp located along a strip.

    Attributes
    ----------
    wavelength_nm
        Wavelengths of l lines in nm, rising, shape (l,); of a blend that of its first line.
    position, sigma
        Positions of the lines and their standard uncertainties in the unit of the profile's
        positions, shape (l,).
    fwhm
        Full width at half maximum of a single line in that unit, in the middle of the lines.
    rising
        Whether the wavelength rises with the position, from left to right.
    explained
        Fraction of the profile's variance that the lines and a linear background explain.
    """

    wavelength_nm: FloatArray
    position: FloatArray
    sigma: FloatArray
    fwhm: float
    rising: bool
    explained: float

    def __str__(self) -> str:
        """Return the lines and the direction of rising wavelength."""
        direction = "rising" if self.rising else "falling"
        return f"{', '.join(f'{nm:.0f}' for nm in self.wavelength_nm)} nm, {direction} to the right"


@dataclass(frozen=True, eq=False)
class PictureChange:
    """A picture of the card through the filter, compared with that of a calibration.

    Attributes
    ----------
    brightness
        Brightness over that of the calibration, all places together.
    colour
        Light at 420 nm relative to that at 680 nm, over the same ratio of the calibration. A lamp
        that burns at a lower temperature has less than 1.
    shift_nm
        Distance in nm of the filter from where it was in the frame, the larger one of its two ends.
    wavelength_nm
        Wavelengths in nm of the places that were compared, shape (places,).
    unevenness
        Brightness of each place over what brightness and colour explain, less 1, shape (places,).
    """

    brightness: Measured
    colour: Measured
    shift_nm: Measured
    wavelength_nm: FloatArray
    unevenness: FloatArray

    @property
    def worst(self) -> tuple[float, float]:
        """Largest unevenness, and its wavelength in nm."""
        place = int(abs(self.unevenness).argmax())
        return float(self.unevenness[place]), float(self.wavelength_nm[place])
