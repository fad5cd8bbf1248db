"""What a variable filter lets through at every position, from colour filters over a grey card.

I_pfc = ∫ T_p F_f L R S_c dλ (paper, section 4.2) says little about T_p by itself, so T_p is a
skewed peak on a leakage, plus a remainder on a coarse grid that is held small. The mercury lines'
map comes in as what is known of the centres beforehand.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from labrig.errors import FitError
from labrig.fit.least_squares import FloatArray, least_squares
from labrig.fit.spectrum.system import CurveError, curve_modes
from labrig.optics import Bands, CameraResponse, Lvf, Spectrum, Transmittance, WavelengthMap
from labrig.optics.band import peak_shape
from labrig.optics.lvf import NOMINAL_FWHM_NM
from labrig.optics.piecewise import hats, quadrature

#: What is known of a band before it is measured: mean and σ. Leakage and remainder in units of the
#: peak, the width as its logarithm.
LOG_FWHM = (float(np.log(NOMINAL_FWHM_NM)), 0.3)
SKEW = (0.0, 0.2)
LEAKAGE = (0.0, 0.01)
REMAINDER = (0.0, 0.01)
#: Distance of the remainder's knots.
REMAINDER_STEP_NM = 20.0
#: How centre, log width and skew run along a strip: order of a polynomial, and scatter about it.
ALONG_THE_STRIP = ((3, 0.3), (2, 0.03), (1, 0.05))
#: The map's σ is not believed below this: strips are not smooth to a tenth of a nanometre.
CENTRE_FLOOR_NM = 0.5
#: At dim ends what leaks could stand for a whole band: one is there, of this much of its start.
LEAST_PEAK = 0.1
FEWEST_FILTERS = 6
_STEP = 1e-4
_FIGURES = 5


@dataclass(frozen=True, eq=False)
class LvfCalibration:
    """A calibrated filter.

    Attributes
    ----------
    lvf
        Its bands with their σ, transmission relative to the same unknown factor at all positions.
    misfit
        (p,) root of χ² per degree of freedom; where it is above 1 σ has been raised by it.
    """

    lvf: Lvf
    misfit: FloatArray


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
    """T_p(λ) at every position.

    Parameters
    ----------
    position
        (p,) rising.
    value, sigma
        (p, filters, channels); NaN leaves a value out (clipped, missing).
    filters
        One after the other over the grey card; a `Transmittance` of 1 is none.
    lamp, card, camera
        Known irradiance (relative), reflectance and curves.
    wavelengths
        Position → wavelength from mercury lines.
    curve_error
        How well the camera's curves are known.

    Raises
    ------
    FitError
        Too few filters, or a position with too few values or no light.
    """
    places = np.asarray(position, dtype=np.float64)
    values, sigmas = np.asarray(value, dtype=np.float64), np.asarray(sigma, dtype=np.float64)
    expected = (len(places), len(filters), camera.sensitivity.shape[1])
    if values.shape != expected or sigmas.shape != expected:
        raise FitError(
            f"expected values of shape {expected} (positions, filters, channels), got "
            f"{values.shape} and σ of shape {sigmas.shape}"
        )
    if len(filters) < FEWEST_FILTERS:
        raise FitError(f"expected {FEWEST_FILTERS} or more filters, got {len(filters)}")
    room = _Room(filters, lamp, card, camera, curve_error)
    count = len(places)
    mean = np.column_stack(
        [
            wavelengths.wavelength_nm(places),
            np.full(count, LOG_FWHM[0]),
            np.full(count, SKEW[0]),
        ]
    )
    known = np.column_stack(
        [
            np.maximum(wavelengths.sigma_nm(places), CENTRE_FLOOR_NM),
            np.full(count, LOG_FWHM[1]),
            np.full(count, SKEW[1]),
        ]
    )
    alone = [room.fit(values[k], sigmas[k], mean[k], known[k], places[k]) for k in range(count)]
    for figure, (order, floor) in enumerate(ALONG_THE_STRIP):
        mean[:, figure], known[:, figure] = _from_the_others(
            places,
            np.array([f.parameters[figure] for f in alone]),
            np.array([f.sigma[figure] for f in alone]),
            order,
            floor,
        )
    fitted = [room.fit(values[k], sigmas[k], mean[k], known[k], places[k]) for k in range(count)]
    x, errors = np.array([f.parameters for f in fitted]), np.array([f.sigma for f in fitted])
    width, peak = np.exp(x[:, 1]), x[:, 3]
    bands = Bands(x[:, 0], width, x[:, 2], peak, x[:, 4] * peak)
    unsure = Bands(
        errors[:, 0], width * errors[:, 1], errors[:, 2], errors[:, 3], errors[:, 4] * peak
    )
    try:
        lvf = Lvf(places, bands, unsure, room.knots_nm, x[:, _FIGURES:] * peak[:, np.newaxis])
    except ValueError as error:
        raise FitError(f"{error}; check the order of the pictures") from None
    return LvfCalibration(lvf, np.array([f.misfit for f in fitted]))


def _from_the_others(
    places: FloatArray, values: FloatArray, sigmas: FloatArray, order: int, floor: float
) -> tuple[FloatArray, FloatArray]:
    """What all other positions let expect of each one, by a polynomial along the strip, and σ.

    A strip is coated in one go; what a position at the end says badly its neighbours say well.
    """
    scaled = (places - places.mean()) / (np.ptp(places) / 2)
    powers = np.vander(scaled, min(order, len(places) - 2) + 1, increasing=True)
    expected, unsure = np.empty_like(values), np.empty_like(values)
    spread = np.hypot(sigmas, floor)
    for k in range(len(places)):
        others = np.arange(len(places)) != k
        rows = powers[others] / spread[others, np.newaxis]
        covariance = np.linalg.pinv(rows.T @ rows, hermitian=True)
        coefficients = covariance @ (rows.T @ (values[others] / spread[others]))
        expected[k] = powers[k] @ coefficients
        unsure[k] = np.hypot(np.sqrt(powers[k] @ covariance @ powers[k]), floor)
    return expected, unsure


@dataclass(frozen=True, eq=False)
class _Fitted:
    parameters: FloatArray
    sigma: FloatArray
    misfit: float


class _Room:
    """All but the filter on the strip: what reaches the camera at which wavelength."""

    def __init__(
        self,
        filters: Sequence[Transmittance],
        lamp: Spectrum,
        card: Transmittance,
        camera: CameraResponse,
        curve_error: CurveError | None,
    ) -> None:
        low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
        knots = [camera.wavelength_nm, lamp.wavelength_nm, card.wavelength_nm]
        self.nodes, weights = quadrature(low, high, *knots, *(f.wavelength_nm for f in filters))
        lit = weights * lamp.at(self.nodes) * card.at(self.nodes)
        self.light = np.stack([lit * f.at(self.nodes) for f in filters])
        self.sensitivity = camera.at(self.nodes)
        peaks = camera.sensitivity.max(axis=0)
        self.modes = curve_modes(curve_error, self.nodes, self.sensitivity, peaks)
        self.knots_nm = np.arange(low, high + REMAINDER_STEP_NM / 2, REMAINDER_STEP_NM)
        self.tents = hats(self.knots_nm, self.nodes)
        # (filters · channels, q): a value is this times the transmission.
        self.design = np.concatenate(
            [of_filter[:, np.newaxis] * self.sensitivity for of_filter in self.light], axis=1
        ).T

    def fit(
        self,
        value: FloatArray,
        sigma: FloatArray,
        before: FloatArray,
        before_sigma: FloatArray,
        at: float,
    ) -> _Fitted:
        """Figures and remainder of one position; `before` is what is known of the first three."""
        y, s = value.ravel(), sigma.ravel()
        used = np.isfinite(y) & np.isfinite(s) & (s > 0)
        if used.sum() < _FIGURES:
            raise FitError(
                f"position {at:g}: only {used.sum()} values are neither clipped nor missing"
            )
        count = _FIGURES + len(self.knots_nm)
        mean, known = np.zeros(count), np.full(count, REMAINDER[1])
        mean[:_FIGURES] = *before, 1.0, LEAKAGE[0]
        known[:_FIGURES] = *before_sigma, np.inf, LEAKAGE[1]
        shape = self._transmission(mean)
        expected = self.design @ shape
        scale = float(y[used] @ expected[used]) / float(expected[used] @ expected[used])
        if not scale > 0:
            raise FitError(f"position {at:g}: no light above the noise; expose longer")
        covariance = np.diag(s**2)
        for mode in self.modes:
            wrong = scale * ((self.light * shape) @ mode).ravel()
            covariance = covariance + np.outer(wrong, wrong)
        lower = np.linalg.cholesky(covariance[np.ix_(used, used)])
        design = np.linalg.solve(lower, self.design[used] * scale)
        target = np.linalg.solve(lower, y[used])

        def residuals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            left = design @ self._transmission(x) - target
            slopes = design @ self._derivatives(x)
            rows, prior = np.concatenate([left, (x - mean) / known]), np.diag(1 / known)
            return rows, np.vstack([slopes, prior])

        low, high = np.full(count, -np.inf), np.full(count, np.inf)
        low[2], high[2], low[3], low[4] = -1.0, 1.0, LEAST_PEAK, 0.0
        found = least_squares(residuals, mean, lower=low, upper=high, tolerance=1e-6)
        data = found.residuals[: len(target)]
        misfit = max(1.0, float(np.sqrt(data @ data / max(len(target) - _FIGURES, 1))))
        x, errors = found.parameters.copy(), found.sigma * misfit
        x[3], errors[3] = x[3] * scale, errors[3] * scale
        x[4:], errors[4:] = x[4:] * scale / x[3], errors[4:] * scale / x[3]
        return _Fitted(x, errors, misfit)

    def _transmission(self, x: FloatArray) -> FloatArray:
        """T(λ) at the nodes, in units of the starting scale."""
        shape = peak_shape(self.nodes - x[0], np.exp(x[1]), x[2])
        transmission: FloatArray = x[3] * shape + x[4] + self.tents @ x[_FIGURES:]
        return transmission

    def _derivatives(self, x: FloatArray) -> FloatArray:
        """(q, parameters)."""
        columns = []
        for k in range(3):
            step = np.zeros_like(x)
            step[k] = _STEP
            change = self._transmission(x + step) - self._transmission(x - step)
            columns.append(change / (2 * _STEP))
        shape = peak_shape(self.nodes - x[0], np.exp(x[1]), x[2])
        columns += [shape, np.ones_like(shape)]
        return np.column_stack([*columns, self.tents])
