"""Profile of the strip of the variable filter, and lines in it."""

from dataclasses import dataclass

from labrig.foundation.arrays import FloatArray


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
