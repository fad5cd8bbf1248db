"""Smooth course of excitation over wavelength within bands of which only the mean rates are known.

A light narrower than its band charges by the rate at its own wavelengths, not by the band's mean.
How far these differ follows from the rates of the neighbouring bands: ln k is taken for a Gaussian
process with Matérn's kernel, ν = 5/2 (Rasmussen and Williams, Gaussian Processes for Machine
Learning, eqs. 4.17 and 3.53 ff. for the maximum). Its size is averaged over the evidence, and its
correlation length is such that the course of measured excitation spectra of dyes within bands of 20
and 37.5 nm is right within σ (`tests/fit/test_excitation_course.py`).
"""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Distance in nm over which logarithms of excitation rates are correlated.
CORRELATED_NM = 40.0
#: Standard deviations of ln k that are tried.
SIZES = (0.5, 1.0, 2.0, 3.0, 4.5)
#: Standard deviation of the mean of ln k, which is unknown.
ANY_LEVEL = 10.0
#: Largest σ of the logarithm of a band's rate, and least rate over the largest.
UNKNOWN, LEAST = 1.5, 1e-3
#: Least σ of a logarithm: bands agree with the course so far.
AGREEMENT = 0.02
#: Largest step of ln k, largest last one, and number of steps.
MAX_STEP, DONE, STEPS = 1.0, 1e-6, 50
#: Part of the variance that the error modes may leave out.
LEFT_OUT = 1e-4


@dataclass(frozen=True, eq=False)
class ExcitationCourse:
    """Course of the logarithm of an excitation rate over F cells of B bands.

    Attributes
    ----------
    log_rate
        Logarithm of the rate over that of its band, mean of the rate 1 in each band, shape (F,).
    modes
        Errors of ln k of one σ each, independent of one another, shape (M, F).
    """

    log_rate: FloatArray
    modes: FloatArray


def excitation_course(
    cells_nm: FloatArray, bands_nm: FloatArray, rate: FloatArray, sigma: FloatArray
) -> ExcitationCourse:
    """Return the smooth course of a rate of which the means over bands are known.

    Parameters
    ----------
    cells_nm, bands_nm
        Rising edges in nm of cells (F + 1,) and of bands (B + 1,), each band a number of cells.
    rate, sigma
        Mean rate of every band and its σ, shape (B,).
    """
    middle_nm, cell_nm = (cells_nm[1:] + cells_nm[:-1]) / 2, np.diff(cells_nm)
    band = np.searchsorted(bands_nm, middle_nm) - 1
    mean = (band == np.arange(len(rate))[:, np.newaxis]) * cell_nm
    mean = mean / mean.sum(axis=1, keepdims=True)
    level = np.maximum(rate, np.maximum(LEAST * rate.max(), np.minimum(sigma, rate.max())))
    noise = np.clip(sigma / level, AGREEMENT, UNKNOWN)
    noise[rate < LEAST * rate.max()] = UNKNOWN
    log_level = np.log(level)
    fits = [_posterior(middle_nm, mean, log_level, noise, size) for size in SIZES]
    log_evidence = np.array([evidence for _, _, evidence in fits])
    weight = np.exp(log_evidence - log_evidence.max())
    weight /= weight.sum()
    courses = np.array([course for course, _, _ in fits])
    course = weight @ courses
    apart = courses - course
    covariance = np.tensordot(weight, np.array([one for _, one, _ in fits]), axes=1)
    covariance += (weight * apart.T) @ apart
    variances, vectors = np.linalg.eigh(covariance)
    kept = np.cumsum(np.maximum(variances, 0.0)) > LEFT_OUT * np.maximum(variances, 0.0).sum()
    modes = (vectors[:, kept] * np.sqrt(variances[kept])).T
    log_mean = np.log(mean @ np.exp(course))
    return ExcitationCourse(course - log_mean[band], modes)


def _posterior(
    nm: FloatArray, mean: FloatArray, log_level: FloatArray, noise: FloatArray, size: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return the most probable ln k (F,), its covariance (F, F) and the logarithm of the evidence.

    Parameters
    ----------
    nm
        Wavelengths in nm, shape (F,).
    mean
        Matrix of the means over bands, shape (B, F).
    log_level, noise
        Logarithms of the bands' means and σ, shape (B,).
    size
        Standard deviation of ln k.
    """
    prior = _kernel(nm, size)
    expected = float(log_level.mean())
    course = np.full(len(nm), expected)
    for _ in range(STEPS):
        part = mean * np.exp(course)
        total = part.sum(axis=1)
        slope = part / total[:, np.newaxis]
        misfit = log_level - np.log(total) + slope @ (course - expected)
        spread = slope @ prior @ slope.T + np.diag(noise**2)
        gain = np.linalg.solve(spread, slope @ prior).T
        step = np.clip(expected + gain @ misfit - course, -MAX_STEP, MAX_STEP)
        course = course + step
        if np.abs(step).max() < DONE:
            break
    _, log_determinant = np.linalg.slogdet(spread)
    evidence = -(misfit @ np.linalg.solve(spread, misfit) + log_determinant) / 2
    return course, prior - gain @ slope @ prior, float(evidence)


def _kernel(nm: FloatArray, size: float) -> FloatArray:
    """Return Matérn's covariance of ln k with an unknown level, shape (F, F)."""
    scaled = np.sqrt(5) * np.abs(nm[:, np.newaxis] - nm) / CORRELATED_NM
    return np.asarray(size**2 * (1 + scaled + scaled**2 / 3) * np.exp(-scaled) + ANY_LEVEL**2)
