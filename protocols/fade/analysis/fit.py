"""Fit of the lamp's transients to photographs.

The start of a photograph after the switch is known up to a constant lag and some jitter, which all
its places and colours share, as they share its flicker. The camera's curves and its dark level have
errors that all photographs share, and so has the steady light to which those of a pass are
relative: without these in the noise, every colour's fade would be a little off that of a glowing
body.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.protocols.fade.analysis.change import (
    LAG,
    REFERENCE_NM,
    SCALE_S,
    Cooling,
    Fit,
    FittedChange,
    Heating,
    Shape,
    Smooth,
    fraction_of,
)
from labrig.protocols.fade.result import SwitchedFrames

#: Step in seconds of the grid on which fractions are integrated.
STEP_S = 2e-3
DEGREES = (2, 3, 4)
#: Prior standard deviations of p, and of the lag in seconds: relays take up to 15 ms.
EXPONENT_SIGMA, LAG_SIGMA_S = 0.2, 15e-3
#: Standard deviation in seconds between the delays of a relay's closing and opening.
RELAY_S = 1e-3
#: Jitters in seconds that are compared, and the initial one.
JITTERS_S = np.geomspace(3e-4, 2e-2, 31)
FIRST_JITTER_S = 3e-3
#: Tolerances of the fits with the covariance by the one before, and most steps of a fit.
TOLERANCES, MAX_STEPS = (1e-3, 1e-3, 1e-6), 100
#: Difference in −2 ln L from which another shape replaces the filament.
CLEARLY = 10.0


def fit_change(
    frames: SwitchedFrames,
    weights: FloatArray,
    weight_errors: FloatArray,
    nm: FloatArray,
    flicker: float,
    *,
    rises: bool,
    fade: FittedChange | None = None,
) -> FittedChange:
    """Fit the transient of the lamp to photographs.

    Parameters
    ----------
    frames
        Photographs after the switch.
    weights
        Weights of the steady lamp's light at `nm` in each place or colour, which sum to 1, shape
        (S, wavelengths).
    weight_errors
        Standard deviations of these weights in independent directions, shape (q, S, wavelengths).
    nm
        Wavelengths in nm.
    flicker
        Relative scatter common to the values of a photograph.
    rises
        Whether the lamp is turned on.
    fade
        Fade of the same lamp on the same bench, with whose filament and lag it rises, too.

    Raises
    ------
    FitError
        The photographs show no such transient.
    """
    last_s = float(frames.start_s.max())
    smooth = [Smooth(rises, degree, last_s) for degree in DEGREES]
    shapes: list[Shape] = [Heating() if rises else Cooling(), *smooth]
    fits = [
        _fit(
            _Problem(frames, weights, weight_errors, nm, flicker, shape, _prior(shape, fade)), shape
        )
        for shape in shapes
        if len(frames.start_s) > shape.free + 3
    ]
    if not fits:
        raise FitError(f"expected more photographs of the lamp, got {len(frames.start_s)}")
    fits = [fit for fit in fits if np.isfinite(fit.covariance).all()]
    if not fits:
        raise FitError(
            f"the {'rise' if rises else 'fade'} is not that of a glowing body, nor like it: is it "
            "a halogen lamp, and the only light on the card?"
        )
    # What no shape explains (curves that are not quite this bench's) must not decide.
    scatter = max(min(fit.reduced_chi2 for fit in fits), 1.0)
    aic = np.array(
        [fit.log_determinant + fit.chi2 / scatter + 2 * len(fit.parameters) for fit in fits]
    )
    if isinstance(fits[0].shape, Cooling | Heating) and aic[0] < aic.min() + CLEARLY:
        return FittedChange((fits[0],), np.ones(1))
    likely = np.exp((aic.min() - aic) / 2)
    return FittedChange(tuple(fits), likely / likely.sum())


@dataclass(frozen=True, eq=False)
class _Prior:
    """Prior of the parameters: their expected values, and a root of their inverse covariance."""

    expected: FloatArray
    root: FloatArray


def _prior(shape: Shape, fade: FittedChange | None) -> _Prior:
    """Return the prior of a shape's parameters, p and the lag; of a rise, by the lamp's fade."""
    expected, sigma = shape.expected()
    expected = np.array([*expected, 1.0, 0.0])
    sigma = np.array([*sigma, EXPONENT_SIGMA, LAG_SIGMA_S])
    if fade is None:
        return _Prior(expected, np.diag(1 / sigma))
    expected[LAG], sigma[LAG] = fade.lag.value, np.hypot(fade.lag.sigma, RELAY_S)
    cooling = fade.fits[0]
    is_filament = len(fade.fits) == 1 and isinstance(cooling.shape, Cooling)
    if isinstance(shape, Heating) and is_filament:
        # Not by the fade's p, which the errors of the same curves have shifted.
        filament = [*range(cooling.shape.free), LAG]
        expected[filament] = cooling.parameters[filament]
        covariance = np.diag(np.square(sigma))
        covariance[np.ix_(filament, filament)] = cooling.covariance[np.ix_(filament, filament)]
        covariance[LAG, LAG] += RELAY_S**2
        return _Prior(expected, np.linalg.inv(np.linalg.cholesky(covariance)))
    return _Prior(expected, np.diag(1 / sigma))


def _fit(problem: "_Problem", shape: Shape) -> Fit:
    theta, jitter_s = problem.start(), FIRST_JITTER_S
    for tolerance in TOLERANCES:
        problem.whiten(theta, jitter_s)
        result = least_squares(
            problem.residuals, theta, max_iterations=MAX_STEPS, tolerance=tolerance
        )
        theta = result.parameters
        jitter_s = problem.likeliest_jitter(theta)
    problem.whiten(theta, jitter_s)
    chi2, dof = problem.chi2(theta), max(problem.values - len(theta), 1)
    covariance = result.covariance * max(chi2 / dof, 1.0)
    return Fit(
        shape,
        theta,
        covariance,
        jitter_s,
        chi2,
        dof,
        problem.log_determinant(),
        problem.light_sigma_s(theta, jitter_s),
    )


@dataclass(frozen=True, eq=False)
class _CommonModes:
    """Noise Σ v e eᵀ besides one of unit variance, in unit vectors e that are orthogonal.

    Attributes
    ----------
    along
        Unit vectors, shape (..., values, k).
    variance
        Variances v, shape (..., k).
    """

    along: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, modes: FloatArray) -> "_CommonModes":
        """Return the noise of independent modes of one standard deviation, (..., values, k)."""
        variance, rotation = np.linalg.eigh(np.swapaxes(modes, -1, -2) @ modes)
        variance = np.maximum(variance, np.finfo(np.float64).tiny)
        return cls(modes @ rotation / np.sqrt(variance)[..., np.newaxis, :], variance)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Return (1 + Σ v e eᵀ)^(−1/2) times columns, shape (..., values, c)."""
        shrunk = 1 - 1 / np.sqrt(1 + self.variance)
        common = shrunk[..., np.newaxis] * (np.swapaxes(self.along, -1, -2) @ columns)
        result: FloatArray = columns - self.along @ common
        return result

    def log_determinant(self) -> float:
        """Return the logarithm of the determinant of 1 + Σ v e eᵀ."""
        return float(np.log1p(self.variance).sum())


@dataclass(frozen=True, eq=False)
class _Noise:
    """Common-mode noise in σ: each photograph's own, then what all of them share.

    Attributes
    ----------
    photographs
        Flicker and jitter, `along` of shape (n, S, 2).
    all_share
        Errors of curves, dark level and steady light, whitened by the former, `along` of shape
        (n S, q + S + passes).
    """

    photographs: _CommonModes
    all_share: _CommonModes

    def whiten(self, residual: FloatArray) -> FloatArray:
        """Return whitened residuals (n S,) of residuals in σ, shape (n, S)."""
        own = self.photographs.whiten(residual[..., np.newaxis])
        return self.all_share.whiten(own.reshape(-1, 1))[:, 0]

    def log_determinant(self) -> float:
        """Return the logarithm of the determinant of the covariance in units of σ²."""
        return self.photographs.log_determinant() + self.all_share.log_determinant()


class _Problem:
    """Residuals of all photographs, whitened by the common-mode noise of each."""

    def __init__(
        self,
        frames: SwitchedFrames,
        weights: FloatArray,
        weight_errors: FloatArray,
        nm: FloatArray,
        flicker: float,
        shape: Shape,
        prior: _Prior,
    ) -> None:
        self._frames, self._weights, self._nm = frames, weights, nm
        self._weight_errors = weight_errors
        self._flicker, self._shape = flicker, shape
        self._prior = prior
        last_s = float((frames.start_s + frames.exposure_s).max()) + 0.05
        self._grid_s = np.arange(0.0, last_s + STEP_S, STEP_S)
        self._used = np.isfinite(frames.light_s) & np.isfinite(frames.light_sigma_s)
        self.values = int(self._used.sum())
        sigma_s = np.where(self._used, frames.light_sigma_s, 1.0)
        self._inverse_sigma = np.where(self._used, 1 / sigma_s, 0.0)
        self._noise: _Noise

    def start(self) -> FloatArray:
        """Return initial parameters by the photographs' brightest colour."""
        frames = self._frames
        column = int(np.argmax(frames.steady_dn_per_s))
        value, start_s = frames.light_s[:, column], frames.start_s
        middle_nm = float(self._weights[column] @ self._nm)
        used = self._used[:, column] & (value > 5 * frames.light_sigma_s[:, column])
        if self._shape.rises:
            fraction = np.clip(value / frames.exposure_s, 1e-6, 1 - 1e-6)
            used &= (fraction > 0.02) & (fraction < 0.95)
            target = np.log(-np.log(fraction[used]) * middle_nm / REFERENCE_NM)
        else:
            target = np.log(value[used])
        if np.count_nonzero(used) < 3:
            changes = "comes on" if self._shape.rises else "fades"
            raise FitError(
                f"expected photographs of a lamp that {changes}, got none that show it: is the "
                "card lit, does the lamp's relay switch?"
            )
        slope, level = np.polyfit(start_s[used] / SCALE_S, target, 1)
        if not self._shape.rises:
            slope *= middle_nm / REFERENCE_NM
        first = self._shape.start(float(level), float(slope))
        return np.array([*first, 1.0, self._prior.expected[LAG]])

    def model(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ∫ fraction dt of every photograph, and its slope by the start; (n, S) each."""
        return self._integrals(theta, self._weights)

    def _integrals(self, theta: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ∫ fraction dt, and its slope by the start, in k weightings (k, wavelengths)."""
        fraction = fraction_of(self._shape, theta, self._nm, self._grid_s) @ weights.T
        steps = STEP_S * (fraction[1:] + fraction[:-1]) / 2
        integral = np.vstack([np.zeros(fraction.shape[1]), np.cumsum(steps, axis=0)])
        begin_s = self._frames.start_s + theta[-1]
        first, before = _integral_until(begin_s, integral, fraction)
        last, after = _integral_until(begin_s + self._frames.exposure_s, integral, fraction)
        return last - first, after - before

    def whiten(self, theta: FloatArray, jitter_s: float) -> None:
        """Set the covariance to that of the model at these parameters."""
        self._noise = self._noise_at(*self.model(theta), self._shared_errors(theta), jitter_s)

    def light_sigma_s(self, theta: FloatArray, jitter_s: float) -> FloatArray:
        """Return the σ of every photograph's light by all but the curves, NaN where it clips."""
        value, slope = self.model(theta)
        by_dark, by_steady = self._dark_errors(), self._steady_errors(value)
        variance = np.square(self._frames.light_sigma_s) + np.square(self._flicker * value)
        variance += np.square(jitter_s * slope)
        variance += np.square(by_dark).sum(axis=2) + np.square(by_steady).sum(axis=2)
        sigma_s: FloatArray = np.sqrt(variance)
        return sigma_s

    def log_determinant(self) -> float:
        """Return the logarithm of the determinant of the photographs' covariance."""
        log_variance = np.log(np.square(self._frames.light_sigma_s[self._used]))
        return float(log_variance.sum()) + self._noise.log_determinant()

    def likeliest_jitter(self, theta: FloatArray) -> float:
        """Return the most probable of `JITTERS_S` by the residuals of the photographs."""
        (value, slope), shared = self.model(theta), self._shared_errors(theta)
        residual = self._scaled_residuals(value)

        def negative_log_likelihood(jitter_s: float) -> float:
            noise = self._noise_at(value, slope, shared, jitter_s)
            return float(np.square(noise.whiten(residual)).sum()) + noise.log_determinant()

        return float(
            JITTERS_S[np.argmin([negative_log_likelihood(jitter_s) for jitter_s in JITTERS_S])]
        )

    def _scaled_residuals(self, value: FloatArray) -> FloatArray:
        """Return the residuals of a model in σ; 0 of values that are not used."""
        return np.where(self._used, (self._frames.light_s - value) * self._inverse_sigma, 0.0)

    def _shared_errors(self, theta: FloatArray) -> FloatArray:
        """Return the values' errors in σ that photographs share, shape (n, S, q + S + passes)."""
        by_wavelength, _ = self._integrals(theta, np.eye(len(self._nm)))
        by_curves = np.tensordot(by_wavelength, self._weight_errors, axes=(1, 2))
        by_steady = self._steady_errors(by_wavelength @ self._weights.T)
        errors = np.concatenate(
            [np.moveaxis(by_curves, 1, 2), self._dark_errors(), by_steady], axis=2
        )
        scaled: FloatArray = errors * self._inverse_sigma[..., np.newaxis]
        return scaled

    def _dark_errors(self) -> FloatArray:
        """Return the values' errors by that of the dark level, shape (n, S, S)."""
        frames = self._frames
        dark = np.diag(frames.dark_dn_per_s_sigma / frames.steady_dn_per_s)
        errors: FloatArray = frames.exposure_s[:, np.newaxis, np.newaxis] * dark
        return errors

    def _steady_errors(self, value: FloatArray) -> FloatArray:
        """Return the values' errors by the flicker of their pass's steady light, (n, S, passes)."""
        frames = self._frames
        by_pass = self._flicker / np.sqrt(frames.steady_frames) * np.eye(len(frames.steady_frames))
        errors: FloatArray = value[..., np.newaxis] * by_pass[frames.pass_number, np.newaxis]
        return errors

    def _noise_at(
        self, value: FloatArray, slope: FloatArray, shared: FloatArray, jitter_s: float
    ) -> _Noise:
        modes = np.stack([self._flicker * value, jitter_s * slope], axis=2)
        photographs = _CommonModes.of(modes * self._inverse_sigma[..., np.newaxis])
        whitened = photographs.whiten(shared)
        return _Noise(photographs, _CommonModes.of(whitened.reshape(-1, shared.shape[-1])))

    def _whitened_residuals(self, theta: FloatArray) -> FloatArray:
        return self._noise.whiten(self._scaled_residuals(self.model(theta)[0]))

    def chi2(self, theta: FloatArray) -> float:
        """Return χ² of the photographs alone."""
        return float(np.square(self._whitened_residuals(theta)).sum())

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the whitened residuals, then those of the prior, and the slopes of all."""

        def whitened_residuals(parameters: FloatArray) -> FloatArray:
            return np.append(
                self._whitened_residuals(parameters),
                self._prior.root @ (parameters - self._prior.expected),
            )

        residual = whitened_residuals(theta)
        jacobian = np.empty((len(residual), len(theta)))
        for number in range(len(theta)):
            step = np.zeros_like(theta)
            step[number] = 1e-6
            jacobian[:, number] = (
                whitened_residuals(theta + step) - whitened_residuals(theta - step)
            ) / (2 * step[number])
        return residual, jacobian


def _integral_until(
    at_s: FloatArray, integral: FloatArray, fraction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return integral and value of a fraction that is linear between the times of the grid."""
    index = np.clip((at_s / STEP_S).astype(np.intp), 0, len(fraction) - 2)
    offset_s = (at_s - index * STEP_S)[:, np.newaxis]
    slope = (fraction[index + 1] - fraction[index]) / STEP_S
    return integral[index] + (fraction[index] + slope * offset_s / 2) * offset_s, fraction[
        index
    ] + slope * offset_s
