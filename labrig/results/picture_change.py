"""Change of a picture of the card since the calibration."""

from dataclasses import dataclass

from labrig.foundation.arrays import FloatArray
from labrig.results.measured import Measured


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
