"""Wavelength of a narrow line from broadband values.

A spectrum that is only smooth (`fit_spectrum`) comes out as broad as the response of one value, and
its maximum depends on the shape of the responses. Light that is known to be narrow (a laser, a
monochromator, an LED) has two unknowns, wavelength and strength: they are found by maximum
likelihood, with the values' noise and the errors of the system.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

from labrig.fit.spectrum.system import SpectralSystem, measured
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError

#: Full width at half maximum over σ of a Gaussian.
FWHM_OVER_SIGMA = 2 * np.sqrt(2 * np.log(2))
#: Number of wavelengths on the first grid, per distance of the knots.
TRIED_PER_KNOT = 4
#: Iterations in which the covariance of the system's errors follows the line's strength.
ROUNDS = 3
#: Tolerance of the search, in distances of the knots; also the step of derivatives.
TOLERANCE = 1e-4


@dataclass(frozen=True)
class LineFit:
    """A narrow line.

    Attributes
    ----------
    wavelength_nm, sigma_nm
        Centre in nm and one standard deviation: the Cramér–Rao bound, times `misfit` where that is
        above 1. It does not cover other wavelengths that explain the values nearly as well.
    strength
        Integral over wavelength, in the unit of the system's spectrum times nm.
    misfit
        Root of χ² per degree of freedom: about 1 if the given σ, the system and the line's shape
        hold.
    """

    wavelength_nm: float
    sigma_nm: float
    strength: float
    misfit: float


def fit_line(value: ArrayLike, sigma: ArrayLike, system: SpectralSystem, fwhm_nm: float) -> LineFit:
    """Fit the line that explains some values.

    Parameters
    ----------
    value, sigma
        Values and σ as for `fit_spectrum`, shape (m,).
    system
        Design matrix on evenly spaced knots, and its errors.
    fwhm_nm
        Full width at half maximum of the line, a Gaussian, in nm; 0 for one much narrower than the
        response of a value.

    Raises
    ------
    FitError
        There are too few values, none above its noise, or no line between the outermost knots.
    """
    _, part, y, s = measured(value, sigma, system)
    knots = part.knots_nm
    step = float(knots[1] - knots[0])

    def line_at(wavelength_nm: float) -> _LineAt:
        return _line_at(part, y, s, line_at_knots(knots, wavelength_nm, fwhm_nm))

    def minus_two_log_likelihood(wavelength_nm: float) -> float:
        return line_at(wavelength_nm).minus_two_log_likelihood

    trial_nm = np.linspace(knots[0], knots[-1], TRIED_PER_KNOT * (len(knots) - 1) + 1)
    best = int(np.argmin([minus_two_log_likelihood(wavelength) for wavelength in trial_nm]))
    if best in (0, len(trial_nm) - 1) or not line_at(trial_nm[best]).strength > 0:
        raise FitError(
            f"expected a line between {knots[0]:g} and {knots[-1]:g} nm, got values that none "
            "there explains; look at the whole spectrum"
        )
    bracket = (float(trial_nm[best - 1]), float(trial_nm[best + 1]))
    h = TOLERANCE * step
    # Not least squares: the covariance, and its determinant with it, changes along the search.
    centre_nm = float(
        minimize_scalar(minus_two_log_likelihood, bounds=bracket, options={"xatol": h}).x
    )
    line = line_at(centre_nm)
    shift = (line_at(centre_nm + h).shape - line_at(centre_nm - h).shape) / (2 * h)
    by_wavelength = line.strength * solve_triangular(line.lower, shift, lower=True)
    along = line.whitened / np.linalg.norm(line.whitened)
    # What another strength would explain as well says nothing about the wavelength.
    information = float(np.linalg.norm(by_wavelength - (by_wavelength @ along) * along))
    misfit = float(np.sqrt(line.chi2 / max(len(y) - 2, 1)))
    return LineFit(centre_nm, max(1.0, misfit) / information, line.strength, misfit)


@dataclass(frozen=True)
class _LineAt:
    """Values of a line at one wavelength with its most likely strength.

    Attributes
    ----------
    shape, whitened
        Values of a line of strength 1, and the same whitened by their covariance, shape (m,).
    lower
        Cholesky factor of the values' covariance, shape (m, m).
    strength, chi2, minus_two_log_likelihood
        Most likely strength, χ², and −2 ln likelihood up to a constant.
    """

    shape: FloatArray
    whitened: FloatArray
    lower: FloatArray
    strength: float
    chi2: float
    minus_two_log_likelihood: float


def _line_at(
    system: SpectralSystem, y: FloatArray, s: FloatArray, hat_functions: FloatArray
) -> _LineAt:
    shape, noise, strength = system.design @ hat_functions, np.diag(s**2), 0.0
    system_covariance = system.covariance(hat_functions)
    for _ in range(ROUNDS if system_covariance.any() else 1):
        lower = cholesky(noise + strength**2 * system_covariance, lower=True)
        solution = solve_triangular(lower, np.column_stack([shape, y]), lower=True)
        whitened, target = solution[:, 0], solution[:, 1]
        norm2 = float(whitened @ whitened)
        strength = max(float(whitened @ target) / norm2, 0.0) if norm2 > 0 else 0.0
    residual = target - strength * whitened
    chi2 = float(residual @ residual)
    minus_two_log_likelihood = chi2 + 2 * float(np.log(np.diag(lower)).sum())
    return _LineAt(shape, whitened, lower, strength, chi2, minus_two_log_likelihood)


def line_at_knots(knots_nm: FloatArray, wavelength_nm: float, fwhm_nm: float) -> FloatArray:
    """Return the values (n,) at the knots of a line of integral 1, with its centre and its width.

    Linear interpolation between the knots adds h²/3 to its variance, h the distance of the knots:
    that much is subtracted as far as possible.
    """
    h = float(knots_nm[1] - knots_nm[0])
    width = np.sqrt(max((fwhm_nm / FWHM_OVER_SIGMA) ** 2 - h**2 / 3, (TOLERANCE * h) ** 2))
    # A tent is the second difference of a ramp; a Gaussian of tents that of a smoothed ramp.
    knots = np.concatenate([knots_nm[:1] - h, knots_nm, knots_nm[-1:] + h])
    from_line = (knots - wavelength_nm) / width
    density = np.exp(-(from_line**2) / 2) / np.sqrt(2 * np.pi)
    ramp = width * (from_line * ndtr(from_line) + density)
    hat_functions: FloatArray = np.diff(ramp, n=2) / h**2
    # Far from the line rounding errors are all there is.
    return np.maximum(hat_functions, 0.0)
