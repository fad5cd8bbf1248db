"""Wavelength along a strip from located lines."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import WavelengthMap
from labrig.results import LocatedLines

#: Significance level of a bend (F-test with known σ).
RARE = 0.01
#: Smallest σ of a line in nm: shapes of bands differ slightly.
FLOOR_NM = 0.1
#: Prior σ of the bend of a strip in nm, between its middle and its ends.
USUAL_BEND_NM = 5.0


@dataclass(frozen=True, eq=False)
class WavelengthFit:
    """A wavelength map along a strip, and its residuals.

    Attributes
    ----------
    map
        Wavelength map with the covariance of its coefficients; it includes a bend that was not
        significant, so that σ grows realistically where the map is extrapolated.
    residual_nm
        Wavelength of the map minus that of each line in nm, shape (l,).
    order
        Order of the polynomial: 1 straight, 2 bent.
    """

    map: WavelengthMap
    residual_nm: FloatArray
    order: int


def fit_wavelengths(lines: LocatedLines, span: tuple[float, float]) -> WavelengthFit:
    """Fit the wavelength along a strip, linear or, where clearly better, quadratic.

    Parameters
    ----------
    lines
        Three or more located lines.
    span
        First and last position of the strip.

    Raises
    ------
    FitError
        The lines are not monotone along the strip.
    """
    middle, half = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    powers = np.vander((lines.position - middle) / half, 3, increasing=True)
    nm_per_unit = abs(float(np.polyfit(lines.position, lines.wavelength_nm, 1)[0]))
    sigma_nm = np.hypot(lines.sigma * nm_per_unit, FLOOR_NM)
    straight, _, straight_chi2 = _weighted(powers[:, :2], lines.wavelength_nm, sigma_nm, np.inf)
    bent, covariance, bent_chi2 = _weighted(powers, lines.wavelength_nm, sigma_nm, USUAL_BEND_NM)
    order = 2 if straight_chi2 - bent_chi2 > chdtri(1, RARE) else 1
    if order == 1:
        coefficients = np.append(straight, 0.0)
        # What was not believed is an error that the straight map may have.
        covariance = covariance + np.outer(coefficients - bent, coefficients - bent)
    else:
        coefficients = bent
    try:
        wavelength_map = WavelengthMap(coefficients, span, covariance)
    except ValueError as error:
        raise FitError(str(error)) from None
    return WavelengthFit(
        wavelength_map, wavelength_map.wavelength_nm(lines.position) - lines.wavelength_nm, order
    )


def _weighted(
    powers: FloatArray, wavelength_nm: FloatArray, sigma: FloatArray, bend_sigma: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return coefficients, covariance and χ²; the last of three has the prior 0 ± `bend_sigma`."""
    rows = powers / sigma[:, np.newaxis]
    precision = rows.T @ rows
    if np.isfinite(bend_sigma):
        precision[-1, -1] += 1 / bend_sigma**2
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    coefficients = covariance @ (rows.T @ (wavelength_nm / sigma))
    chi2 = float((((wavelength_nm - powers @ coefficients) / sigma) ** 2).sum())
    return coefficients, covariance, chi2
