"""Transmission of a variable filter at every position, from colour filters over a grey card.

I_pfc = ∫ T_p F_f L R S_c dλ (paper, section 4.2) constrains T_p weakly, so T_p is a skewed peak on
a leakage, plus a remainder on a coarse grid with a narrow prior. The wavelength map of the mercury
lines is the prior of the centres, and a smooth run of the parameters along the strip that of the
other parameters. The camera's curves are fitted, too: their error is common to all positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from labrig.fit.lvf import strip_problem
from labrig.fit.lvf.strip_problem import (
    AlongStrip,
    Expected,
    StripProblem,
    StripSigmas,
    StripSolution,
)
from labrig.fit.spectrum.system import CurveError
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import (
    NOMINAL_FWHM_NM,
    Bands,
    CameraResponse,
    Lvf,
    Spectrum,
    Transmittance,
    WavelengthMap,
)

#: Prior mean and σ of a band. Leakage and remainder are in units of the peak, the width is its
#: logarithm.
LOG_FWHM = (float(np.log(NOMINAL_FWHM_NM)), 0.3)
SKEW = (0.0, 0.2)
LEAKAGE = (0.002, 0.01)
#: σ of the logarithm of the order of a band's shape, 2 for the skewed Gaussian that is fitted: tops
#: of interference filters are flatter, and the mean over a piece of strip makes them rounder again.
LOG_ORDER_SIGMA = 0.1
#: Prior σ of the remainder near a band and, beyond a distance in nm, of the uneven blocking.
REMAINDER, BLOCKING, SHAPE_NM = 0.01, 0.001, 60.0
#: Prior σ of the logarithm of the peak: all positions have the same order of magnitude.
ANY_PEAK = 2.0
#: Run of the parameters along a strip: order of a polynomial, and scatter about it.
ALONG_THE_STRIP = {
    strip_problem.CENTRE: (3, 0.3),
    strip_problem.LOG_WIDTH: (2, 0.02),
    strip_problem.SKEW: (1, 0.05),
    strip_problem.LOG_PEAK: (2, 0.04),
    strip_problem.LEAKAGE: (1, 0.0005),
}
#: σ of the bend with one turn more than the map has, and least σ of its coefficients, in nm.
THIRD_ORDER_NM, EXACT_NM = 5.0, 0.01
#: Lower limit of the map's σ: strips are not smooth to a tenth of a nanometre.
CENTRE_FLOOR_NM = 0.5
#: Correlation length of errors of a gel's transmittance, which closer positions share.
ALIKE_NM = 40.0
MIN_FILTERS = 6
#: Number of updates of the prior from the other positions, and steps in between.
ROUNDS, STEPS = 4, 4


@dataclass(frozen=True, eq=False)
class LvfCalibration:
    """A calibrated filter.

    Attributes
    ----------
    lvf
        Bands with σ, transmission relative to one unknown factor that is common to all positions.
    misfit
        Root mean square of the residuals in σ, shape (p,); where it is above 1, σ was multiplied by
        it.
    camera
        Camera with its curves as fitted with the filters; the transmission belongs to these.
    """

    lvf: Lvf
    misfit: FloatArray
    camera: CameraResponse


def calibrate_lvf(
    position: ArrayLike,
    value: ArrayLike,
    sigma: ArrayLike,
    *,
    filters: Sequence[Transmittance],
    lamp: Spectrum,
    card: Transmittance,
    camera: CameraResponse,
    wavelengths: WavelengthMap,
    curve_error: CurveError | None = CurveError(),  # noqa: B008 (frozen)
) -> LvfCalibration:
    """Fit T_p(λ) at every position.

    Parameters
    ----------
    position
        Rising positions, shape (p,).
    value, sigma
        Values and σ, shape (p, filters, channels), every channel in units in which the card without
        filter and strip gives ∫ L R S_c dλ; NaN leaves a value out (clipped, missing).
    filters
        Colour filters, in front of the grey card one at a time; a `Transmittance` of 1 is none.
    lamp, card, camera
        Relative irradiance of the lamp, reflectance of the card, and curves of the camera.
    wavelengths
        Wavelength along the strip from mercury lines.
    curve_error
        Error of the camera's curves; None takes them for exact.

    Raises
    ------
    FitError
        There are too few filters, or a position has too few values or no light.
    """
    positions = np.asarray(position, dtype=np.float64)
    values, sigmas = np.asarray(value, dtype=np.float64), np.asarray(sigma, dtype=np.float64)
    shape = (len(positions), len(filters), camera.sensitivity.shape[1])
    if values.shape != shape or sigmas.shape != shape:
        raise FitError(
            f"expected values of shape {shape} (positions, filters, channels), got "
            f"{values.shape} and σ of shape {sigmas.shape}"
        )
    if len(filters) < MIN_FILTERS:
        raise FitError(f"expected {MIN_FILTERS} or more filters, got {len(filters)}")
    centre_nm = wavelengths.wavelength_nm(positions)
    repetition = np.sqrt(max(1.0, ALIKE_NM / float(np.abs(np.diff(centre_nm)).mean())))
    problem = StripProblem(values, sigmas * repetition, filters, lamp, card, camera, curve_error)
    prior = _prior(centre_nm, wavelengths.sigma_nm(positions), problem.knots_nm)
    start = _start(problem, prior, positions)
    prior.mean[:, strip_problem.LOG_PEAK] = np.median(start.figures[:, strip_problem.LOG_PEAK])
    expected, solution = prior, start
    for number in range(ROUNDS):
        if number:
            expected = _prior_from_others(
                positions, solution, problem.sigmas(solution, expected), prior
            )
        solution = problem.solve(solution, expected, STEPS)
    misfit = np.maximum(1.0, repetition * problem.misfit(solution))
    runs = _runs_along_strip(positions, wavelengths)
    joint = problem.joint_sigmas(solution, prior, runs, LOG_ORDER_SIGMA)
    try:
        lvf = _lvf(positions, solution.figures, joint, misfit, problem.knots_nm)
    except ValueError as error:
        raise FitError(f"{error}; check the order of the pictures") from None
    return LvfCalibration(lvf, misfit, problem.camera(solution.curves))


def _prior(centre_nm: FloatArray, sigma_nm: FloatArray, knots_nm: FloatArray) -> Expected:
    """Return the prior of all parameters."""
    mean = np.zeros((len(centre_nm), strip_problem.FIGURES + len(knots_nm)))
    sigma = np.empty_like(mean)
    is_near = np.abs(knots_nm - centre_nm[:, np.newaxis]) < SHAPE_NM
    sigma[:, strip_problem.FIGURES :] = np.where(is_near, REMAINDER, BLOCKING)
    mean[:, strip_problem.CENTRE] = centre_nm
    sigma[:, strip_problem.CENTRE] = np.maximum(sigma_nm, CENTRE_FLOOR_NM)
    for figure, (centre, spread) in (
        (strip_problem.LOG_WIDTH, LOG_FWHM),
        (strip_problem.SKEW, SKEW),
        (strip_problem.LOG_PEAK, (0.0, ANY_PEAK)),
        (strip_problem.LEAKAGE, LEAKAGE),
    ):
        mean[:, figure], sigma[:, figure] = centre, spread
    return Expected(mean, sigma)


def _start(problem: StripProblem, prior: Expected, positions: FloatArray) -> StripSolution:
    """Return the expected bands, scaled to the measured light.

    Raises
    ------
    FitError
        A position has too few values or no light.
    """
    for place, count in zip(positions, problem.used.sum(axis=1), strict=True):
        if count < strip_problem.FIGURES:
            raise FitError(
                f"position {place:g}: only {count} values are neither clipped nor missing"
            )
    scale = problem.scales(prior.mean)
    if (is_dark := ~(scale > 0)).any():
        raise FitError(
            f"position {positions[is_dark][0]:g}: no light above the noise; expose longer"
        )
    figures = prior.mean.copy()
    figures[:, strip_problem.LOG_PEAK] = np.log(scale)
    return StripSolution(figures, np.zeros(problem.modes))


def _prior_from_others(
    positions: FloatArray, solution: StripSolution, sigmas: FloatArray, prior: Expected
) -> Expected:
    """Return the prior of each position from all others, by polynomials along the strip, with σ.

    A strip is coated in one process; at its ends, where a position is poorly constrained, the
    neighbours constrain it.
    """
    scaled = (positions - positions.mean()) / (np.ptp(positions) / 2)
    mean, sigma = prior.mean.copy(), prior.sigma.copy()
    for figure, (order, floor) in ALONG_THE_STRIP.items():
        powers = np.vander(scaled, min(order, len(positions) - 2) + 1, increasing=True)
        spread = np.hypot(sigmas[:, figure], floor)
        for k in range(len(positions)):
            others = np.arange(len(positions)) != k
            rows = powers[others] / spread[others, np.newaxis]
            covariance = np.linalg.pinv(rows.T @ rows, hermitian=True)
            coefficients = covariance @ (
                rows.T @ (solution.figures[others, figure] / spread[others])
            )
            mean[k, figure] = powers[k] @ coefficients
            sigma[k, figure] = np.hypot(np.sqrt(powers[k] @ covariance @ powers[k]), floor)
    mean[:, strip_problem.LEAKAGE] = np.maximum(mean[:, strip_problem.LEAKAGE], 0.0)
    return Expected(mean, sigma)


def _runs_along_strip(positions: FloatArray, wavelengths: WavelengthMap) -> list[AlongStrip]:
    """Return the run of each parameter along the strip, before the colour filters are looked at."""
    scaled = (positions - positions.mean()) / (np.ptp(positions) / 2)
    runs = []
    for figure, sigma in (
        (strip_problem.LOG_WIDTH, LOG_FWHM[1]),
        (strip_problem.SKEW, SKEW[1]),
        (strip_problem.LOG_PEAK, ANY_PEAK),
        (strip_problem.LEAKAGE, LEAKAGE[1]),
    ):
        order, scatter = ALONG_THE_STRIP[figure]
        powers = np.vander(scaled, order + 1, increasing=True)
        runs.append(AlongStrip(figure, powers, np.eye(order + 1) / sigma, scatter))
    order, scatter = ALONG_THE_STRIP[strip_problem.CENTRE]
    low, high = wavelengths.span
    powers = np.vander((2 * positions - low - high) / (high - low), order + 1, increasing=True)
    covariance = THIRD_ORDER_NM**2 * np.eye(order + 1)
    if wavelengths.covariance is not None:
        known = len(wavelengths.covariance)
        covariance[:known, :known] = wavelengths.covariance + EXACT_NM**2 * np.eye(known)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    return [*runs, AlongStrip(strip_problem.CENTRE, powers, root, scatter)]


def _lvf(
    positions: FloatArray,
    figures: FloatArray,
    sigmas: StripSigmas,
    misfit: FloatArray,
    knots_nm: FloatArray,
) -> Lvf:
    centre, log_width, skew, log_peak, leakage = figures[:, : strip_problem.FIGURES].T
    width, peak = np.exp(log_width), np.exp(log_peak)
    sigma_columns = sigmas.figures.T * misfit
    return Lvf(
        positions,
        Bands(centre, width, skew, peak, leakage * peak),
        Bands(
            sigma_columns[strip_problem.CENTRE],
            width * sigma_columns[strip_problem.LOG_WIDTH],
            sigma_columns[strip_problem.SKEW],
            peak * sigmas.log_area * misfit,
            peak * sigma_columns[strip_problem.LEAKAGE],
        ),
        knots_nm,
        figures[:, strip_problem.FIGURES :] * peak[:, np.newaxis],
    )


#: Centres in nm of the bands that are to be found, and full width of each at half maximum.
CENTRES_NM: FloatArray = np.linspace(400.0, 700.0, 31)
FWHM_NM = 25.0
#: What is known without filters of a band's centre and width in nm, and of its leakage.
KNOWN = np.array([5.0, 5.0, 0.01])
#: σ of a measured transmittance: a fraction of it, by the filter's table, and noise.
RELATIVE, NOISE = 0.02, 0.003
#: Steps in nm, and of the leakage, of derivatives.
DIFFERENCE_STEPS = np.array([1.0, 1.0, 0.001])

#: Wavelengths in nm over which bands are integrated.
NODES_NM: FloatArray = np.arange(360.0, 761.0, 1.0)


def most_informative_filters(filters: Sequence[Transmittance], count: int) -> tuple[str, ...]:
    """Return the names of the colour filters that tell most of a strip's bands.

    Filters are added one by one, each the one with which the determinant of the information on
    centre, width and leakage of all bands grows most (D-optimal; Fedorov, *Theory of Optimal
    Experiments*, 1972). A filter tells of a band where it changes steeply within it.

    Parameters
    ----------
    filters
        Transmittances of all filters at hand.
    count
        Number of filters to choose; all are returned if there are fewer.

    Returns
    -------
    tuple of str
        Names in the order of `filters`.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.lvf import most_informative_filters
    >>> from labrig.optics import Transmittance
    >>> nm = np.array([300.0, 540.0, 560.0, 800.0])
    >>> edge = Transmittance("edge", nm, np.array([0.0, 0.0, 0.9, 0.9]))
    >>> grey = Transmittance("grey", nm, np.full(4, 0.5))
    >>> most_informative_filters([grey, edge], 1)
    ('edge',)
    """
    slopes = np.stack([_slopes(transmittance) for transmittance in filters])
    information = np.broadcast_to(np.diag(KNOWN**-2.0), (len(CENTRES_NM), 3, 3)).copy()
    left, chosen = list(range(len(filters))), list[int]()
    while left and len(chosen) < count:
        products = slopes[left][..., :, np.newaxis] * slopes[left][..., np.newaxis, :]
        gains = np.linalg.slogdet(information + products)[1].sum(axis=1)
        best = left.pop(int(np.argmax(gains)))
        information += slopes[best][..., :, np.newaxis] * slopes[best][..., np.newaxis, :]
        chosen.append(best)
    return tuple(filters[number].name for number in sorted(chosen))


def _slopes(transmittance: Transmittance) -> FloatArray:
    """Return the derivatives of what a filter leaves of each band, in σ, shape (bands, 3)."""
    passed = transmittance.at(NODES_NM)
    value = _left(passed, np.zeros(3))
    sigma = np.hypot(RELATIVE * value, NOISE)
    changed = [_left(passed, step) for step in np.diag(DIFFERENCE_STEPS)]
    columns = [
        (more - value) / (step * sigma)
        for more, step in zip(changed, DIFFERENCE_STEPS, strict=True)
    ]
    return np.stack(columns, axis=1)


def _left(passed: FloatArray, change: FloatArray) -> FloatArray:
    """Return the fraction that a filter leaves of Gaussian bands with changed parameters."""
    shift_nm, wider_nm, leakage = change
    away = (NODES_NM - (CENTRES_NM[:, np.newaxis] + shift_nm)) / (FWHM_NM + wider_nm)
    bands = np.exp(-4 * np.log(2.0) * away**2) + leakage
    fraction: FloatArray = bands @ passed / bands.sum(axis=1)
    return fraction
