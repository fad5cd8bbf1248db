"""The wavelength along a strip from lines that were located."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2 as chi2_distribution

from labrig.errors import FitError
from labrig.fit.least_squares import FloatArray
from labrig.optics import WavelengthMap
from labrig.results import LocatedLines

#: A bend is believed if chance gives so good a one this rarely (F-test with known σ).
RARE = 0.01
#: Least σ of a line, in nm: shapes of bands are not quite alike.
FLOOR_NM = 0.1
#: Bend that strips have where nothing is known, in nm between their middle and their ends.
USUAL_BEND_NM = 5.0


@dataclass(frozen=True, eq=False)
class WavelengthFit:
    """A map along a strip, and what was left over.

    Attributes
    ----------
    map
        With the covariance of its coefficients; in it is what a bend that was not believed may
        still do, so that σ grows honestly where the map is extrapolated.
    residual_nm
        (l,) wavelength of the map minus that of the line.
    order
        1 or 2: straight or bent.
    """

    map: WavelengthMap
    residual_nm: FloatArray
    order: int


def fit_wavelengths(lines: LocatedLines, span: tuple[float, float]) -> WavelengthFit:
    """Position → wavelength, straight or, where that is clearly better, bent.

    Parameters
    ----------
    lines
        Three or more.
    span
        First and last position of the strip.

    Raises
    ------
    FitError
        The lines do not rise or fall along the strip.
    """
    middle, half = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    powers = np.vander((lines.position - middle) / half, 3, increasing=True)
    nm_per_unit = abs(float(np.polyfit(lines.position, lines.wavelength_nm, 1)[0]))
    sigma_nm = np.hypot(lines.sigma * nm_per_unit, FLOOR_NM)
    straight, _, straight_chi2 = _weighted(powers[:, :2], lines.wavelength_nm, sigma_nm, np.inf)
    bent, covariance, bent_chi2 = _weighted(powers, lines.wavelength_nm, sigma_nm, USUAL_BEND_NM)
    order = 2 if straight_chi2 - bent_chi2 > chi2_distribution.isf(RARE, 1) else 1
    if order == 1:
        coefficients = np.append(straight, 0.0)
        # What was not believed is an error that the straight map may have.
        covariance = covariance + np.outer(coefficients - bent, coefficients - bent)
    else:
        coefficients = bent
    try:
        found = WavelengthMap(coefficients, span, covariance)
    except ValueError as error:
        raise FitError(str(error)) from None
    return WavelengthFit(found, found.wavelength_nm(lines.position) - lines.wavelength_nm, order)


def _weighted(
    powers: FloatArray, wanted: FloatArray, sigma: FloatArray, bend_sigma: float
) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients, covariance and χ²; the last of three is 0 ± `bend_sigma` beforehand."""
    rows = powers / sigma[:, np.newaxis]
    precision = rows.T @ rows
    if np.isfinite(bend_sigma):
        precision[-1, -1] += 1 / bend_sigma**2
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    coefficients = covariance @ (rows.T @ (wanted / sigma))
    chi2 = float((((wanted - powers @ coefficients) / sigma) ** 2).sum())
    return coefficients, covariance, chi2
