"""The linear system from a spectrum to the measured values, and its errors."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cholesky, lapack, solve_triangular

from labrig.fit.nonlinear_least_squares import EPSILON
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.optics import Bands, CameraResponse, Lvf, hat_functions, quadrature

#: Steps of the derivatives by an LVF's parameters, relative to their σ.
_STEP = 0.1


@dataclass(frozen=True)
class CurveError:
    """Error of a camera's curves as one standard deviation, smooth over wavelength.

    The defaults are the difference between two laboratories' curves of one Canon EOS 5D Mark II,
    and cover spectra from pictures taken with one and fitted with the other.

    Attributes
    ----------
    relative
        Error as a fraction of the curve itself.
    added
        Error as a fraction of the channel's peak: stray light, other infrared filters.
    correlation_nm
        Distance in nm at which errors are independent.
    """

    relative: float = 0.06
    added: float = 0.012
    correlation_nm: float = 40.0


@dataclass(frozen=True, eq=False)
class SpectralSystem:
    """Linear system value = (design + Σ_k z_k modes_k) · spectrum, z_k of unit variance.

    Attributes
    ----------
    knots_nm
        Rising knots in nm, shape (n,): the spectrum is piecewise linear between them, and zero
        outside.
    design
        Values per unit of the spectrum at every knot, shape (m, n).
    modes
        One standard deviation of the design in each independent error mode, shape (k, m, n).
    """

    knots_nm: FloatArray
    design: FloatArray
    modes: FloatArray = field(default_factory=lambda: np.empty((0, 0, 0)))

    def of(self, rows: NDArray[np.bool_]) -> "SpectralSystem":
        """Return the system of a selection of its values."""
        modes = self.modes[:, rows] if len(self.modes) else self.modes
        return SpectralSystem(self.knots_nm, self.design[rows], modes)

    def covariance(self, spectrum: FloatArray) -> FloatArray:
        """Return the covariance (m, m) of the values from the errors of the design alone."""
        deviations = self.modes @ spectrum if len(self.modes) else np.zeros((0, len(self.design)))
        result: FloatArray = deviations.T @ deviations
        return result


def system_through_lvf(
    lvf: Lvf, camera: CameraResponse, knots_nm: FloatArray, curve_error: CurveError | None = None
) -> SpectralSystem:
    """Return the system of a picture through a variable filter, values by (position, channel).

    Parameters
    ----------
    lvf
        Filter at the positions that were read; its σ, where known, adds modes.
    camera
        Camera with its curves on their own wavelengths.
    knots_nm
        Knots of the spectrum in nm, shape (n,).
    curve_error
        Error of the camera's curves; None takes them for exact.
    """
    nodes, weights = quadrature(
        float(knots_nm[0]), float(knots_nm[-1]), camera.wavelength_nm, knots_nm
    )
    onto_knots = weights[:, np.newaxis] * hat_functions(knots_nm, nodes)
    sensitivity = camera.at(nodes)

    def design(transmission: FloatArray, curves: FloatArray) -> FloatArray:
        """Return the design matrix, shape (positions · channels, n)."""
        values = np.stack([(transmission * curve) @ onto_knots for curve in curves.T], axis=1)
        return values.reshape(-1, len(knots_nm))

    transmission = lvf.transmission(nodes)
    exact = design(transmission, sensitivity)
    modes = [design(transmission, error) for error in camera_modes(camera, nodes, curve_error)]
    for position, change in _filter_changes(lvf, nodes):
        mode = np.zeros((len(transmission), sensitivity.shape[1], len(knots_nm)))
        mode[position] = (change[:, np.newaxis] * sensitivity).T @ onto_knots
        modes.append(mode.reshape(exact.shape))
    stacked = np.array(modes) if modes else np.empty((0, 0, 0))
    return SpectralSystem(knots_nm, exact, stacked)


def curve_modes(
    error: CurveError | None, nodes: FloatArray, sensitivity: FloatArray, peaks: FloatArray
) -> list[FloatArray]:
    """Return changes of the curves (q, channels), each one σ of one channel about one wavelength.

    Parameters
    ----------
    error
        Error of the curves; None for none.
    nodes, sensitivity
        Wavelengths in nm (q,) and curves at them (q, channels).
    peaks
        Maximum of each curve, shape (channels,).
    """
    if error is None:
        return []
    smooth = smooth_modes(nodes, error.correlation_nm)
    modes = []
    for channel, peak in enumerate(peaks):
        for fraction, shape in (
            (error.relative, sensitivity[:, channel]),
            (error.added * peak, 1.0),
        ):
            for mode in smooth if fraction > 0 else ():
                change = np.zeros_like(sensitivity)
                change[:, channel] = fraction * mode * shape
                modes.append(change)
    return modes


def camera_modes(
    camera: CameraResponse, nodes: FloatArray, unknown: CurveError | None
) -> list[FloatArray]:
    """Return changes of a camera's curves (q, channels), of one σ about one wavelength each.

    Curves that were measured with their σ have that one; others err as published curves do.

    Parameters
    ----------
    camera
        Curves of the camera.
    nodes
        Wavelengths in nm, shape (q,).
    unknown
        Error of curves without σ, and distance at which errors are independent; None for none.
    """
    if unknown is None or camera.sigma is None:
        return curve_modes(unknown, nodes, camera.at(nodes), camera.sensitivity.max(axis=0))
    modes = []
    for channel, sigma in enumerate(camera.sigma.T):
        own = np.interp(nodes, camera.wavelength_nm, sigma, left=0.0, right=0.0)
        for mode in smooth_modes(nodes, unknown.correlation_nm):
            change = np.zeros((len(nodes), len(camera.channels)))
            change[:, channel] = own * mode
            modes.append(change)
    return modes


def smooth_modes(nodes: FloatArray, distance_nm: float) -> FloatArray:
    """Return (k, q) functions whose sum with unit normal weights is smooth and of unit variance."""
    knots = np.arange(nodes[0] - distance_nm, nodes[-1] + 2 * distance_nm, distance_nm)
    fraction = np.clip(hat_functions(knots, nodes), 0.0, 1.0)
    modes: FloatArray = np.sin(np.pi / 2 * fraction).T
    return modes[modes.any(axis=1)]


def _filter_changes(lvf: Lvf, nodes: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Yield changes of the transmission (q,) at one position, each by one of its parameters."""
    if lvf.sigma is None:
        return
    for name in (f.name for f in fields(Bands)):
        step = _STEP * getattr(lvf.sigma, name)
        change = (
            lvf.changed_bands(name, _STEP).transmission(nodes) - lvf.bands.transmission(nodes)
        ) / _STEP
        for position in np.flatnonzero(step > 0).tolist():
            yield position, change[position]


MIN_VALUES = 3


def measured(
    value: ArrayLike, sigma: ArrayLike, system: SpectralSystem
) -> tuple[NDArray[np.bool_], SpectralSystem, FloatArray, FloatArray]:
    """Return which values are usable, the system of those, their values and σ.

    Raises
    ------
    FitError
        There are too few values, none above its noise, or a σ of 0.
    """
    values, sigmas = np.asarray(value, dtype=np.float64), np.asarray(sigma, dtype=np.float64)
    used = np.isfinite(values) & np.isfinite(sigmas) & system.design.any(axis=1)
    if (sigmas[used] <= 0).any():
        raise FitError("expected every σ above 0, got some of 0; give the noise of every value")
    if used.sum() < MIN_VALUES:
        raise FitError(
            f"expected {MIN_VALUES} or more values that are neither clipped nor missing, got "
            f"{used.sum()}; expose shorter or light more of the filter"
        )
    part = system.of(used)
    if not values[used] @ part.design.sum(axis=1) > 0:
        raise FitError("expected values above 0, got none above their noise; expose longer")
    return used, part, values[used], sigmas[used]


#: Grid of weights of the prior, for a spectrum of about 1.
WEIGHTS = np.geomspace(1e-4, 1e8, 73)
#: Added to the curvature of the fit, for a spectrum of about 1.
MIN_CURVATURE = 1e-6
#: Distance in nm (1 σ) over which a spectrum is about as rough, rounds in which its roughness is
#: found, and second differences that the roughness of the whole counts as among those near by.
ROUGHNESS_NM = 8.0
ROUGHNESS_ROUNDS = 8
ROUGHNESS_OF_ALL = 0.1
#: Gain of log evidence from which a spectrum is rougher in one place than in another.
UNEVEN = 10.0


@dataclass(frozen=True, eq=False)
class Whitened:
    """Values in units of their errors, for a spectrum of about 1.

    Attributes
    ----------
    target, design
        Values (m,) and design (m, n) in units of the total error.
    knots_nm
        Knots in nm, shape (n,).
    lower
        Cholesky factor of the covariance, shape (m, m).
    """

    target: FloatArray
    design: FloatArray
    knots_nm: FloatArray
    lower: FloatArray

    @classmethod
    def of(
        cls,
        system: SpectralSystem,
        y: FloatArray,
        s: FloatArray,
        spectrum: FloatArray,
        scale: float,
    ) -> "Whitened":
        """Whiten values y with noise s and the design's errors for a spectrum, over a scale."""
        covariance = np.diag((s / scale) ** 2) + system.covariance(spectrum)
        lower = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        columns = np.column_stack([system.design, y / scale])
        solution = np.asarray(np.linalg.solve(lower, columns), dtype=np.float64)
        return cls(solution[:, -1], solution[:, :-1], system.knots_nm, lower)


@dataclass(frozen=True, eq=False)
class Prior:
    """Smoothness prior: its roughness matrix (n − 2, n)."""

    roughness: FloatArray

    @classmethod
    def on(cls, knots: int) -> "Prior":
        """Return the prior on evenly spaced knots."""
        return cls(np.diff(np.eye(knots), n=2, axis=0))

    def local(self, values: Whitened, weight: float, stiffest: float) -> "Prior":
        """Return the prior that is as rough in each place as the values have it there.

        The variance of second differences near by is the sum of their squares over the number of
        them that the values determine (MacKay, *Bayesian interpolation*, Neural Comput. 4, 1992).
        The least rough place has the roughness of this prior, others have more. So many variances
        fit noise, too: without decisive evidence for them all places stay alike.

        Parameters
        ----------
        values
            Values in units of their errors.
        weight
            Weight that suits all places together.
        stiffest
            Largest weight of a place.
        """
        knots = values.knots_nm[1:-1]
        near = np.exp(-(((knots - knots[:, np.newaxis]) / ROUGHNESS_NM) ** 2) / 2)
        information, linear = values.design.T @ values.design, values.design.T @ values.target
        variance = np.full(len(knots), 1 / weight)
        for _ in range(ROUGHNESS_ROUNDS):
            rows = self.roughness / np.sqrt(variance)[:, np.newaxis]
            covariance = np.linalg.inv(information + Prior(rows).precision(1.0))
            bend = self.roughness @ (covariance @ linear)
            left = np.einsum("ij,jk,ik->i", self.roughness, covariance, self.roughness)
            determined = np.clip(1 - left / variance, 0.0, 1.0)
            squares = near @ bend**2 + ROUGHNESS_OF_ALL / weight
            variance = squares / (near @ determined + ROUGHNESS_OF_ALL)
            variance = np.maximum(variance, 1 / stiffest)
        varied = self.roughness / np.sqrt(variance)[:, np.newaxis]
        even = self.roughness * np.sqrt(weight)
        gained = _evidence(information, linear, Prior(varied)) - _evidence(
            information, linear, Prior(even)
        )
        gained -= (np.log(variance).sum() + len(variance) * np.log(weight)) / 2
        if gained < UNEVEN:
            return self
        return Prior(self.roughness * np.sqrt(variance.min() / variance)[:, np.newaxis])

    def precision(self, weight: float) -> FloatArray:
        """Return the precision (n, n), with a ridge for what nothing else constrains."""
        matrix = weight * self.roughness.T @ self.roughness
        matrix.flat[:: len(matrix) + 1] += MIN_CURVATURE
        return matrix

    def log_determinant(self, weight: ArrayLike) -> FloatArray:
        """Return the logarithm of the precision's determinant, up to a constant."""
        result: FloatArray = len(self.roughness) * np.log(np.asarray(weight, dtype=np.float64))
        return result

    def log_evidence(self, values: Whitened) -> FloatArray:
        """Return the log evidence of each of `WEIGHTS` without lines, ignoring x ≥ 0."""
        information, linear = values.design.T @ values.design, values.design.T @ values.target
        log_evidence = np.empty(len(WEIGHTS))
        for number, weight in enumerate(WEIGHTS):
            lower = np.linalg.cholesky(information + self.precision(weight))
            along = solve_triangular(lower, linear, lower=True)
            log_determinant = 2 * float(np.log(np.diag(lower)).sum())
            log_evidence[number] = (along @ along - log_determinant) / 2
        return log_evidence + self.log_determinant(WEIGHTS) / 2


def _evidence(information: FloatArray, linear: FloatArray, prior: Prior) -> float:
    """Return the log evidence of a prior but for its own determinant."""
    lower = np.linalg.cholesky(information + prior.precision(1.0))
    along = solve_triangular(lower, linear, lower=True)
    return float(along @ along) / 2 - float(np.log(np.diag(lower)).sum())


def normalised(log_probability: FloatArray) -> FloatArray:
    """Return probabilities that add up to 1."""
    probability = np.exp(log_probability - log_probability.max())
    result: FloatArray = probability / probability.sum()
    return result


#: Number of exchanges after which block pivoting counts as cycling.
MAX_EXCHANGES = 25
#: Rounding errors of slopes, and of coordinates relative to the largest.
ROUNDING = 100 * EPSILON
SMALLEST = 1e-9


def nonnegative_minimum(
    curvature: FloatArray, linear: FloatArray, free: NDArray[np.bool_]
) -> FloatArray:
    """Minimise xᵀGx/2 − bᵀx over x ≥ 0, started from the solution of a similar problem.

    Block principal pivoting: all coordinates on the wrong side change sides at once (Júdice and
    Pires, *A block principal pivoting algorithm for large-scale strictly monotone linear
    complementarity problems*, Comput. Oper. Res. 21, 1994). Where that cycles, Lawson and Hanson's
    active sets are used.

    Parameters
    ----------
    curvature, linear
        Positive definite G (n, n) and b (n,).
    free
        Initial guess of the coordinates that are not zero, shape (n,).

    Returns
    -------
    ndarray
        Minimum x, exactly 0 where the bound is active, shape (n,).
    """
    free = free.copy()
    size = np.abs(curvature)
    for _ in range(MAX_EXCHANGES):
        x = np.zeros_like(linear)
        if free.any():
            x[free] = _solved(curvature[free][:, free], linear[free])
        slope = curvature @ x - linear
        slack = ROUNDING * (size @ np.abs(x) + np.abs(linear))
        below = x < -SMALLEST * float(np.abs(x).max(initial=0.0))
        wrong = np.where(free, below, slope < -slack)
        if not wrong.any():
            return np.maximum(x, 0.0)
        free ^= wrong
    upper = cholesky(curvature)
    return nonnegative_least_squares(upper, solve_triangular(upper, linear, trans="T"))


def _solved(curvature: FloatArray, linear: FloatArray) -> FloatArray:
    # SciPy's own Cholesky functions take ten times as long to call as such a system to solve.
    _, solution, info = lapack.dposv(curvature, linear)
    if info:
        raise LinAlgError("expected a positive definite matrix")
    return np.asarray(solution)
