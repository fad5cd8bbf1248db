"""The detector of a USB2000+: light on its pixels becomes counts of 16 bits.

Source of the sizes: Ocean Optics' data sheet of the USB2000+ (signal to noise 250:1 at full signal,
dark noise 50 counts, 2048 pixels) and users' spectra of its ILX511B.
"""

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray

from ..lamp import WAVELENGTH_NM

PIXELS, FULL = 2048, 65535
#: Coefficients of the wavelength over the pixel's place, as its EEPROM has them.
WAVELENGTH_TEXTS = ("2.700000e+02", "3.800000e-01", "-1.30000e-05", "-2.5000e-10")
#: Coefficients of the relative response over the counts above the electric dark.
NONLINEARITY_TEXTS = ("9.000000e-01", "4.000000e-06", "-4.00000e-11")
#: Pixels in front of the first lit one, which are electrically connected and have no well.
FIRST_LIT = 21
#: Offset in counts, its change from one spectrum to the next, and the noise of a reading (1 σ).
OFFSET, OFFSET_DRIFT, READ_NOISE = 1500.0, 12.0, 45.0
#: Scatter of the offset from pixel to pixel, in counts, and that of the response.
FIXED_PATTERN, RESPONSE_SCATTER = 15.0, 0.01
#: Dark current in counts per second.
DARK_PER_S = 40.0
#: Variance per count of light: of 62 500 electrons in a full well.
SHOT_NOISE = FULL / 62_500
#: Counts per second and unit of the room's irradiance where the response is highest.
COUNTS_PER_S = 150_000.0
#: Irradiance in W m⁻² nm⁻¹ of the room's unit, which is that of the warm lamp at 560 nm.
UNIT_IRRADIANCE = 0.05
#: Peak and widths below and above it, in nm, of the response.
PEAK_NM, BELOW_NM, ABOVE_NM = 520.0, 170.0, 260.0


def wavelengths_nm() -> FloatArray:
    """Return the true wavelength of each pixel in nm, shape (2048,), as its EEPROM has it."""
    powers = [float(text) for text in WAVELENGTH_TEXTS]
    return np.asarray(np.polynomial.polynomial.polyval(np.arange(PIXELS), powers), np.float64)


class Detector:
    """Pixels with their scatter.

    Parameters
    ----------
    rng
        Random generator of what differs from pixel to pixel.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.wavelength_nm = wavelengths_nm()
        lit = np.arange(PIXELS) >= FIRST_LIT
        width_nm = np.where(self.wavelength_nm < PEAK_NM, BELOW_NM, ABOVE_NM)
        shape = 1 / (1 + ((self.wavelength_nm - PEAK_NM) / width_nm) ** 4)
        self.response: FloatArray = np.where(
            lit, shape * rng.normal(1.0, RESPONSE_SCATTER, PIXELS), 0.0
        )
        self._offset = np.where(lit, rng.normal(0.0, FIXED_PATTERN, PIXELS), 0.0)
        self._dark_per_s = np.where(lit, DARK_PER_S * rng.gamma(4.0, 0.25, PIXELS), 0.0)

    def irradiance_per_count_rate(self) -> FloatArray:
        """Return the true irradiance in W m⁻² nm⁻¹ for one linear count per second."""
        with np.errstate(divide="ignore"):
            factor: FloatArray = UNIT_IRRADIANCE / (COUNTS_PER_S * self.response)
        return factor

    def linear_counts(self, exposure: FloatArray) -> FloatArray:
        """Return the counts of light alone that a linear detector would have.

        Parameters
        ----------
        exposure : ndarray, shape (grid,)
            ∫ irradiance dt on the room's grid, in the room's units.
        """
        light = np.interp(self.wavelength_nm, WAVELENGTH_NM, exposure, left=0.0, right=0.0)
        counts: FloatArray = COUNTS_PER_S * self.response * light
        return counts

    def counts(
        self, exposure: FloatArray, integration_s: float, rng: np.random.Generator
    ) -> NDArray[np.uint16]:
        """Return one spectrum as it leaves the converter, shape (2048,)."""
        linear = self.linear_counts(exposure) + self._dark_per_s * integration_s
        noisy = linear + rng.normal(0.0, np.sqrt(SHOT_NOISE * linear))
        offset = OFFSET + rng.normal(0.0, OFFSET_DRIFT) + self._offset
        read = _response(noisy) + offset + rng.normal(0.0, READ_NOISE, PIXELS)
        return np.clip(np.rint(read), 0, FULL).astype(np.uint16)


def _response(linear: FloatArray) -> FloatArray:
    """Return counts that, over their relative response, are the linear ones."""
    powers = [float(text) for text in NONLINEARITY_TEXTS]
    counts = linear.copy()
    for _ in range(60):
        before = counts
        counts = linear * np.polynomial.polynomial.polyval(np.clip(counts, 0, FULL), powers)
        if np.array_equal(counts, before):
            break
    return counts
