"""What is read along the strip of a linear variable filter."""

from dataclasses import dataclass

from labrig.results.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class StripProfile:
    """Light along a strip, pixel by pixel.

    Attributes
    ----------
    position
        (n,) rising from 0 at the strip's left end to 1 at its right end.
    value_dn_per_s
        (n, channels) mean across the strip.
    """

    position: FloatArray
    value_dn_per_s: FloatArray


@dataclass(frozen=True, eq=False)
class SliceValues:
    """Light in the slices of a strip, from all frames of one scene.

    Attributes
    ----------
    value, sigma
        (positions, channels) in DN/s; NaN where all frames clip. σ is without what lamp, shutter
        and aperture change from one scene to the next: that is common to all places and channels.
    """

    value: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class LocatedLines:
    """Lines of a lamp found along a strip.

    Attributes
    ----------
    wavelength_nm
        (l,) rising; of a blend, of its first line.
    position, sigma
        (l,) where they are, and one standard deviation, in the unit of the profile's positions.
    fwhm
        Width of a single line in that unit, in the middle of the lines.
    rising
        Whether the wavelength grows with the position, from left to right.
    explained
        Share of the profile's variance that the lines and a straight background explain.
    """

    wavelength_nm: FloatArray
    position: FloatArray
    sigma: FloatArray
    fwhm: float
    rising: bool
    explained: float

    def __str__(self) -> str:
        """Which lines, and which way round."""
        way = "rising" if self.rising else "falling"
        return f"{', '.join(f'{nm:.0f}' for nm in self.wavelength_nm)} nm, {way} to the right"
