"""Joint fit of a strip's bands at all positions and the camera's curves.

The curves have the same error at every position, so that all positions together constrain what one
alone could attribute to leakage. Given the curves the positions are independent: a step solves them
one by one, and the curves from the rest (a Schur complement).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.fit.spectrum.system import CurveError, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Transmittance,
    hat_functions,
    peak_shape,
    quadrature,
)

#: Parameters of a position: centre, log width, skew, log peak, and leakage in units of the peak;
#: then the remainder in units of the peak, at knots with a distance of `REMAINDER_STEP_NM`.
CENTRE, LOG_WIDTH, SKEW, LOG_PEAK, LEAKAGE = range(5)
FIGURES = 5
REMAINDER_STEP_NM = 20.0
#: Step of the grid on which T_p is linear: a band of 25 nm loses 0.1 % of its height.
GRID_NM = 1.0
MAX_SKEW = 1.0
_STEP = 1e-4
#: Initial damping, its factor of change, and the value at which the search stops.
_DAMPING, _FACTOR, _HOPELESS = 1e-3, 8.0, 1e6
#: Decrease of χ² below which the search stops.
_ENOUGH = 0.1


@dataclass(frozen=True, eq=False)
class Expected:
    """Prior of every position's parameters: mean and σ, shape (p, figures) each."""

    mean: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class StripSolution:
    """Parameters (p, figures) and amplitudes z of the curves' modes (modes,) at the minimum."""

    figures: FloatArray
    curves: FloatArray


@dataclass(frozen=True, eq=False)
class AlongStrip:
    """Run of one parameter along the strip: a polynomial, and scatter about it.

    Attributes
    ----------
    figure
        Number of the parameter.
    powers
        Design of the polynomial, shape (p, c).
    root
        Root of the inverse covariance of its coefficients before any measurement, shape (c, c).
    scatter
        σ of the parameter about the polynomial.
    """

    figure: int
    powers: FloatArray
    root: FloatArray
    scatter: float


@dataclass(frozen=True, eq=False)
class StripSigmas:
    """Standard uncertainties of all parameters (p, figures), and of the logarithm of ∫ T_p dλ."""

    figures: FloatArray
    log_area: FloatArray


@dataclass(frozen=True, eq=False)
class _Step:
    """Damped Gauss–Newton step."""

    figures: FloatArray
    curves: FloatArray
    #: For every position, R of its own columns, and the curves' columns rotated by its Q.
    triangles: list[tuple[FloatArray, FloatArray]]
    #: Inverse covariance of the curves' modes.
    information: FloatArray


class StripProblem:
    """Least squares of value_pfc = ∫ T_p F_f L R (S_c + Σ_m z_m mode_m) dλ, z_m ~ N(0, 1).

    Parameters
    ----------
    value, sigma
        Values and σ, shape (p, filters, channels), in units in which the card alone gives ∫ L R S_c
        dλ; NaN leaves a value out.
    filters, lamp, card, camera
        Colour filters, irradiance of the lamp, reflectance of the card and curves of the camera.
    curve_error
        Error of the curves; None takes them for exact.
    """

    def __init__(
        self,
        value: FloatArray,
        sigma: FloatArray,
        filters: Sequence[Transmittance],
        lamp: Spectrum,
        card: Transmittance,
        camera: CameraResponse,
        curve_error: CurveError | None,
    ) -> None:
        low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
        knots = [camera.wavelength_nm, lamp.wavelength_nm, card.wavelength_nm]
        nodes, weights = quadrature(low, high, *knots, *(f.wavelength_nm for f in filters))
        self.grid_nm = np.append(np.arange(low, high, GRID_NM), high)
        self.knots_nm = np.arange(low, high + REMAINDER_STEP_NM / 2, REMAINDER_STEP_NM)
        self._hat_functions = hat_functions(self.knots_nm, self.grid_nm)
        sensitivity = camera.at(nodes)
        illumination = weights * lamp.at(nodes) * card.at(nodes)
        modes = np.array(camera_modes(camera, nodes, curve_error))
        modes = modes.reshape(-1, *sensitivity.shape)
        # The card by itself is as bright in every channel as was measured, however curves are bent.
        fraction = np.einsum("q,mqc->mc", illumination, modes) / (illumination @ sensitivity)
        self._modes = modes - fraction[:, np.newaxis] * sensitivity
        self._camera, self._nodes = camera, nodes
        onto_grid = hat_functions(self.grid_nm, nodes)
        light = np.stack([illumination * f.at(nodes) for f in filters])
        self._design = _on_grid(light, sensitivity, onto_grid)
        self._mode_designs = np.array([_on_grid(light, mode, onto_grid) for mode in self._modes])
        self._mode_designs = self._mode_designs.reshape(-1, *self._design.shape)
        flat_value, flat_sigma = value.reshape(len(value), -1), sigma.reshape(len(sigma), -1)
        used = np.isfinite(flat_value) & np.isfinite(flat_sigma) & (flat_sigma > 0)
        self.used = used
        self._value = np.where(used, flat_value, 0.0)
        self._inverse = np.where(used, 1 / np.where(used, flat_sigma, 1.0), 0.0)

    @property
    def modes(self) -> int:
        """Number of error modes of the curves."""
        return len(self._modes)

    def scales(self, figures: FloatArray) -> FloatArray:
        """Return the factors (p,) from the light of these parameters to the measured light."""
        expected = self._transmission(figures) @ self._design.T
        weight = expected * self.used
        total = (weight**2).sum(axis=1)
        scales: FloatArray = (weight * self._value).sum(axis=1) / np.where(total > 0, total, 1.0)
        return scales

    def camera(self, curves: FloatArray) -> CameraResponse:
        """Return the camera with the fitted curves; the highest value of all is 1."""
        order = np.argsort(self._nodes)
        changes = np.tensordot(curves, self._modes, axes=1)[order]
        columns = [
            np.interp(self._camera.wavelength_nm, self._nodes[order], change)
            for change in changes.T
        ]
        sensitivity = np.maximum(self._camera.sensitivity + np.stack(columns, axis=1), 0.0)
        return replace(self._camera, sensitivity=sensitivity / sensitivity.max(), sigma=None)

    def misfit(self, solution: StripSolution) -> FloatArray:
        """Return the root mean square of the residuals in σ, shape (p,)."""
        residuals, _ = self._residuals(solution)
        rms: FloatArray = np.sqrt((residuals**2).sum(axis=1) / self.used.sum(axis=1))
        return rms

    def solve(self, start: StripSolution, expected: Expected, iterations: int) -> StripSolution:
        """Minimise χ² by Levenberg–Marquardt from `begin`, in at most `iterations` steps."""
        solution, chi2, damping = start, self._chi2(start, expected), _DAMPING
        for _ in range(iterations):
            trial, trial_chi2 = self._trial(solution, chi2, expected, damping)
            while trial_chi2 >= chi2 and damping < _HOPELESS:
                damping *= _FACTOR
                trial, trial_chi2 = self._trial(solution, chi2, expected, damping)
            if trial_chi2 >= chi2:
                return solution
            decrease, solution, chi2, damping = (
                chi2 - trial_chi2,
                trial,
                trial_chi2,
                damping / _FACTOR,
            )
            if decrease < _ENOUGH:
                break
        return solution

    def sigmas(self, solution: StripSolution, expected: Expected) -> FloatArray:
        """Return standard uncertainties (p, figures), those of the curves included."""
        step = self._step(solution, expected, 0.0)
        curves = np.linalg.inv(step.information)
        rows = []
        for triangle, by_curves in step.triangles:
            inverse = np.linalg.inv(triangle)
            coupled = inverse @ by_curves
            rows.append(np.sqrt(np.diag(inverse @ inverse.T + coupled @ curves @ coupled.T)))
        return np.array(rows)

    def joint_sigmas(
        self,
        solution: StripSolution,
        prior: Expected,
        runs: Sequence[AlongStrip],
        log_order_sigma: float,
    ) -> StripSigmas:
        """Return the uncertainties with the errors that all positions share.

        These are those of the curves, of the polynomials along the strip, which a position's prior
        from all others takes for exact, and of the order of the peaks' shape, which is not fitted:
        what the light through filters says of it is what it says of the width.

        Parameters
        ----------
        solution
            Parameters at the minimum.
        prior
            Prior of the parameters without a run.
        runs
            Runs of the others.
        log_order_sigma
            σ of the logarithm of the order.
        """
        _, design = self._residuals(solution)
        slopes = self._derivatives(solution.figures) @ design.T
        by_order = log_order_sigma * self._by_log_order(solution.figures)
        by_curves = np.tensordot(
            self._transmission(solution.figures), self._mode_designs, axes=(1, 2)
        )
        count = solution.figures.shape[1]
        coefficients = np.cumsum([self.modes + 1, *(run.powers.shape[1] for run in runs)])
        information = np.eye(coefficients[-1])
        for first, last, run in zip(coefficients[:-1], coefficients[1:], runs, strict=True):
            information[first:last, first:last] = run.root.T @ run.root
        positions = []
        for k, inverse in enumerate(self._inverse):
            precision = 1 / prior.sigma[k]
            shared = np.zeros((len(inverse) + count, coefficients[-1]))
            shared[: len(inverse), : self.modes] = by_curves[k].T * inverse[:, np.newaxis]
            shared[: len(inverse), self.modes] = design @ by_order[k] * inverse
            for first, last, run in zip(coefficients[:-1], coefficients[1:], runs, strict=True):
                precision[run.figure] = 1 / run.scatter
                shared[len(inverse) + run.figure, first:last] = -run.powers[k] / run.scatter
            own = np.vstack([slopes[k].T * inverse[:, np.newaxis], np.diag(precision)])
            q, triangle = np.linalg.qr(own)
            coupling = q.T @ shared
            information += shared.T @ shared - coupling.T @ coupling
            positions.append((np.linalg.inv(triangle), coupling))
        covariance = _with_unfitted(information, self.modes)
        areas = self._derivatives(solution.figures).sum(axis=2)
        total = self._transmission(solution.figures).sum(axis=1)
        figures, log_area = [], []
        for k, (root, coupling) in enumerate(positions):
            by_shared = -root @ coupling
            figures.append(np.sqrt(np.square(root).sum(axis=1) + _variances(by_shared, covariance)))
            area_by_shared = areas[k] @ by_shared
            area_by_shared[self.modes] += by_order[k].sum()
            variance = np.square(areas[k] @ root).sum() + _variances(area_by_shared, covariance)
            log_area.append(np.sqrt(variance) / total[k])
        return StripSigmas(np.array(figures), np.array(log_area))

    def _by_log_order(self, figures: FloatArray) -> FloatArray:
        """Return the derivatives of T_p by the logarithm of the peaks' order, shape (p, grid)."""
        difference = _shapes(self.grid_nm, figures, 2 * np.exp(_STEP)) - _shapes(
            self.grid_nm, figures, 2 * np.exp(-_STEP)
        )
        slope: FloatArray = np.exp(figures[:, [LOG_PEAK]]) * difference / (2 * _STEP)
        return slope

    def _trial(
        self, solution: StripSolution, chi2: float, expected: Expected, damping: float
    ) -> tuple[StripSolution, float]:
        step = self._step(solution, expected, damping)
        figures = solution.figures + step.figures
        figures[:, SKEW] = np.clip(figures[:, SKEW], -MAX_SKEW, MAX_SKEW)
        figures[:, LEAKAGE] = np.maximum(figures[:, LEAKAGE], 0.0)
        trial = StripSolution(figures, solution.curves + step.curves)
        if not np.isfinite(figures).all():
            return solution, chi2
        return trial, self._chi2(trial, expected)

    def _chi2(self, solution: StripSolution, expected: Expected) -> float:
        residuals, _ = self._residuals(solution)
        prior = (solution.figures - expected.mean) / expected.sigma
        return float((residuals**2).sum() + (prior**2).sum() + solution.curves @ solution.curves)

    def _residuals(self, solution: StripSolution) -> tuple[FloatArray, FloatArray]:
        """Return measured − expected in σ (p, values), and the fitted design (values, grid)."""
        design = self._design + np.tensordot(solution.curves, self._mode_designs, axes=1)
        expected = self._transmission(solution.figures) @ design.T
        return (self._value - expected) * self._inverse, design

    def _step(self, solution: StripSolution, expected: Expected, damping: float) -> _Step:
        residuals, design = self._residuals(solution)
        shape = self._transmission(solution.figures)
        slopes = self._derivatives(solution.figures) @ design.T
        by_curves = np.tensordot(shape, self._mode_designs, axes=(1, 2))
        information, target = np.eye(self.modes), -solution.curves
        solved = []
        for k, inverse in enumerate(self._inverse):
            columns = np.vstack(
                [slopes[k].T * inverse[:, np.newaxis], np.diag(1 / expected.sigma[k])]
            )
            columns = np.vstack([columns, np.diag(np.sqrt(damping * (columns**2).sum(axis=0)))])
            misfit = np.zeros(len(columns))
            misfit[: len(inverse)] = residuals[k]
            priors = slice(len(inverse), len(inverse) + len(solution.figures[k]))
            misfit[priors] = (expected.mean[k] - solution.figures[k]) / expected.sigma[k]
            shared = by_curves[k].T * inverse[:, np.newaxis]
            q, triangle = np.linalg.qr(columns)
            coupling = q[: len(inverse)].T @ shared
            projected = q.T @ misfit
            information += shared.T @ shared - coupling.T @ coupling
            target = target + shared.T @ residuals[k] - coupling.T @ projected
            solved.append((triangle, coupling, projected))
        damped = information + damping * np.diag(np.diag(information))
        curves: FloatArray = np.asarray(np.linalg.solve(damped, target), dtype=np.float64)
        figures = [
            np.linalg.solve(r, projected - coupling @ curves) for r, coupling, projected in solved
        ]
        triangles = [(r, coupling) for r, coupling, _ in solved]
        return _Step(np.array(figures), curves, triangles, information)

    def _transmission(self, figures: FloatArray) -> FloatArray:
        """Return T_p on the wavelength grid, shape (p, grid)."""
        relative = _shapes(self.grid_nm, figures) + figures[:, [LEAKAGE]]
        relative = relative + figures[:, FIGURES:] @ self._hat_functions.T
        transmission: FloatArray = np.exp(figures[:, [LOG_PEAK]]) * relative
        return transmission

    def _derivatives(self, figures: FloatArray) -> FloatArray:
        """Return the derivatives of T_p by the parameters, shape (p, figures, grid)."""
        peak = np.exp(figures[:, [LOG_PEAK]])
        columns = []
        for number in (CENTRE, LOG_WIDTH, SKEW):
            step = np.zeros(figures.shape[1])
            step[number] = _STEP
            difference = _shapes(self.grid_nm, figures + step) - _shapes(
                self.grid_nm, figures - step
            )
            columns.append(peak * difference / (2 * _STEP))
        columns += [self._transmission(figures), peak * np.ones_like(self.grid_nm)]
        hat_functions = peak[:, np.newaxis] * self._hat_functions.T
        return np.concatenate([np.stack(columns, axis=1), hat_functions], axis=1)


def _on_grid(light: FloatArray, sensitivity: FloatArray, onto_grid: FloatArray) -> FloatArray:
    """Return the design (filters · channels, grid) from transmission on the grid to values."""
    rows = [light * column @ onto_grid for column in sensitivity.T]
    return np.stack(rows, axis=1).reshape(-1, onto_grid.shape[1])


def _with_unfitted(information: FloatArray, number: int) -> FloatArray:
    """Return the covariance of parameters of which one, of unit variance, is not fitted."""
    others = np.arange(len(information)) != number
    covariance = np.zeros_like(information)
    covariance[np.ix_(others, others)] = np.linalg.inv(information[np.ix_(others, others)])
    by_unfitted = -covariance @ information[number]
    by_unfitted[number] = 1.0
    total: FloatArray = covariance + np.outer(by_unfitted, by_unfitted)
    return total


def _variances(by_shared: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the variances of what depends linearly on errors of some covariance."""
    variances: FloatArray = ((by_shared @ covariance) * by_shared).sum(axis=-1)
    return variances


def _shapes(nm: FloatArray, figures: FloatArray, order: float = 2.0) -> FloatArray:
    """Return peaks of height 1, shape (p, grid)."""
    centre, log_width, skew = (figures[:, [number]] for number in (CENTRE, LOG_WIDTH, SKEW))
    return peak_shape(nm - centre, np.exp(log_width), skew, order)
