"""Tests of the rate equation, the camera and the light by the glow itself.

The rate equation of a thin layer has one Λ and one k_r of each state, whatever light excites it. In
a thick layer the light that is absorbed most charges the surface only, and saturates sooner; light
that empties traps shortens the decay of what it charges. Each test lets one quantity differ between
the places that different bands excite, all parameters of the fit free besides, and asks how much χ²
falls. The fit is linear within its σ, so that one step of Gauss and Newton is the whole of it.

A sensor that misses some of a large signal makes the glow of bright places and of long exposures
too dim. Since exposures differ in length, that is neither a law of charging nor one of the decay.

Kinetic orders are tested by Rao's score: the fit itself, which takes many evaluations of states of
general order, is only worth while where its residuals go along the derivatives by the orders.

Every charge's lamp has a brightness of its own, known within a prior. Where charges of different
lengths do not obey the rate equation, the fit makes good for it by lamps that are darker the
shorter they shine, or brighter, and leaves a χ² that is hardly large. Under the prior these pulls
are standard normal, or smaller, and have no order.

A calibration states the errors that it knows. That a lamp's brightness scatters from charge to
charge, or that places behind a filter do, is known by kind only; by how much shows in the glow,
since many charges and places share a few rates. A size that was assumed too large makes every σ too
large; one too small, too small. The size of each kind is found by its evidence: the probability of
the glow given the size, all other parameters integrated out, is a Gaussian integral of what one fit
with any size has found.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from labrig.fit.excitation.parameters import Parameters, Rates, RelativeSigmas, is_fitted
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.fit.nonlinear_least_squares import EPSILON, LeastSquaresFit
from labrig.foundation.arrays import FloatArray, IntArray
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.results import BandQuantity, BandTests, ChargingSeries, Measured

#: Step of the derivatives by logarithms.
STEP = 1e-4
#: Step of the second derivatives by the light.
DEPTH_STEP = 1e-2
#: σ of a logarithm above which a band's glow says nothing about a quantity, and of the light's
#: variance above which the glow says nothing about the layer.
UNKNOWN, UNKNOWN_VARIANCE = 1.0, 1e3
#: Relative σ of a channel over another on a place: in a colour filter array they lie up to a pixel
#: apart, and the glow is steep along the filter.
HUE_SIGMA = 0.02
#: Relative σ of rate and amplitude from band to band: no bench is steadier. 0.03 K change a rate by
#: so much, and the noise of a bright glow is far less.
RATE_SIGMA, AMPLITUDE_SIGMA = 0.0025, 0.01


def band_tests(problem: ExcitationProblem, solution: LeastSquaresFit) -> BandTests | None:
    """Test all quantities at a fit's solution, by the first series; None if one band excites all.

    Parameters
    ----------
    problem, solution
        A fit, and its solution.
    """
    theta = solution.parameters
    rates = problem.parameters.unpack(theta)
    through = problem.illuminated_series(rates)[0]
    growth = (rates.amplitude[:, None] * rates.k_e_per_s).sum(axis=0)
    band_of_row: IntArray = np.argmax(growth * through.irradiance, axis=1)
    bands = np.unique(band_of_row)
    if len(bands) < 2:
        return None
    residual, jacobian = problem.residuals(theta)
    basis = column_space(jacobian)
    reduced = max(solution.chi2 / max(problem.n_values - solution.rank, 1), 1.0)
    band_of_shot = band_of_row[through.row_of_shots()]
    masks = (band_of_shot == bands[:, None, None]).astype(np.float64)

    def quantity(changes: Sequence[FloatArray], tolerance: float) -> BandQuantity:
        columns = np.stack([mask[..., None] * change for change in changes for mask in masks], -1)
        whitened = np.zeros((len(residual), columns.shape[-1]))
        of_series = problem.whitened(0, columns)
        whitened[: len(of_series)] = of_series
        return change_along(
            residual, whitened, basis, reduced, (len(changes), len(bands)), tolerance
        )

    columns, signal = problem.parameters.columns, problem.signal(theta)[0]
    by_amplitude = np.zeros(len(theta))
    by_amplitude[columns.inverse_gain] = -theta[columns.inverse_gain]
    by_rate = np.zeros(len(theta))
    by_rate[columns.k_r] = 1.0
    channels = [np.eye(signal.shape[2])[channel] * signal for channel in problem.parameters.others]

    def along(direction: FloatArray) -> FloatArray:
        after, before = (problem.signal(theta + s * STEP * direction)[0] for s in (1, -1))
        slope: FloatArray = (after - before) / (2 * STEP)
        return slope

    depth = np.concatenate(
        [
            problem.whitened(number, change[..., None])
            for number, change in enumerate(_by_depth(problem, rates))
        ]
    )
    whitened = np.zeros((len(residual), 1))
    whitened[: len(depth)] = depth
    of_depth = change_along(residual, whitened, basis, reduced, (1, 1), 0.0, UNKNOWN_VARIANCE)
    return BandTests(
        bands=bands,
        light_variance=Measured(float(of_depth.deviation[0, 0]), float(of_depth.sigma[0, 0])),
        charged_glow_by_variance=_charged_glow_change(problem, rates, jacobian, whitened[:, 0]),
        amplitude=quantity([along(by_amplitude)], AMPLITUDE_SIGMA),
        rate=quantity([along(by_rate)], RATE_SIGMA),
        hue=quantity(channels, HUE_SIGMA) if channels else None,
    )


def _charged_glow_change(
    problem: ExcitationProblem, rates: Rates, jacobian: FloatArray, column: FloatArray
) -> float:
    """Return the relative change of Σ A that a fit without a further column (m,) makes of it."""
    norm = np.linalg.norm(jacobian, axis=0)
    norm = np.where(norm > 0, norm, 1.0)
    change = np.linalg.lstsq(jacobian / norm, column, rcond=None)[0] / norm
    # θ has the inverse of a gain, of which A is the power b.
    by_state = -rates.order * rates.gain * change[problem.parameters.columns.inverse_gain]
    return float(by_state @ rates.amplitude / rates.amplitude.sum())


def _by_depth(problem: ExcitationProblem, rates: Rates) -> list[FloatArray]:
    """Return the change (n, P, C) of every series' signal by the variance of the light in depth.

    Light of band b falls in a layer as 1 − c a_b z, z the depth, where a_b is the absorption by all
    states. Its mean is part of k_e. Its variance c²/12, where a_b = 1, lowers the signal s by
    ½ ∂²s/∂ε², E_b (1 + ε a_b), as far as the sites are saturated.
    """
    absorption = rates.k_e_per_s.sum(axis=0)
    absorption = absorption / max(float(absorption.max()), 1e-300)
    changes = []
    for charging in problem.illuminated_series(rates):
        signals = [
            problem.glow(
                replace(charging, irradiance=charging.irradiance * (1 + epsilon * absorption)),
                rates,
            )
            for epsilon in (-DEPTH_STEP, 0.0, DEPTH_STEP)
        ]
        second = (signals[0] - 2 * signals[1] + signals[2]) / DEPTH_STEP**2
        changes.append(np.multiply.outer(second / 2, rates.weights))
    return changes


def column_space(jacobian: FloatArray) -> FloatArray:
    """Return an orthonormal basis (m, rank) of the changes that the fit's own parameters make."""
    norm = np.linalg.norm(jacobian, axis=0)
    left, values, _ = np.linalg.svd(jacobian[:, norm > 0] / norm[norm > 0], full_matrices=False)
    return np.asarray(left[:, values > EPSILON * len(jacobian) * values[0]])


def change_along(
    residual: FloatArray,
    columns: FloatArray,
    basis: FloatArray,
    reduced_chi2: float,
    shape: tuple[int, int],
    tolerance: float,
    unknown: float = UNKNOWN,
) -> BandQuantity:
    """Return the deviations by further columns (m, k), and the probability of such large ones."""
    own = columns - basis @ (basis.T @ columns)
    values, vectors = np.linalg.eigh(own.T @ own / reduced_chi2)
    known = values > 1 / unknown**2
    variance = np.where(known, 1 / np.maximum(values, 1 / unknown**2), unknown**2)
    along = np.where(known, -(vectors.T @ (own.T @ residual)) / reduced_chi2 * variance, 0.0)
    chi2 = float((along**2 / (variance + tolerance**2)).sum())
    sigma = np.sqrt(vectors**2 @ (variance + tolerance**2))
    return BandQuantity(
        deviation=(vectors @ along).reshape(shape),
        sigma=sigma.reshape(shape),
        p_value=float(chdtrc(known.sum(), chi2)) if known.any() else 1.0,
    )


#: σ of the fraction, beside that by noise: exposures of different lengths are known relative to one
#: another to some tenths of a per cent, by the camera's calibration.
EXPOSURE_SIGMA = 0.002


def missing_signal(problem: ExcitationProblem, solution: LeastSquaresFit) -> Measured:
    """Return the fraction that is missing of the largest signal.

    Of smaller ones less is missing, in proportion. All parameters of the fit are free besides; it
    is one step of Gauss and Newton.

    Parameters
    ----------
    problem, solution
        A fit, and its solution.
    """
    theta = solution.parameters
    residual, jacobian = problem.residuals(theta)
    signals = problem.signal(theta)
    collected = [
        signal * np.concatenate([charge.exposure_s for charge in charging.charges])[:, None, None]
        for charging, signal in zip(problem.series, signals, strict=True)
    ]
    largest = max(float(each.max()) for each in collected)
    column = np.zeros((len(residual), 1))
    missing = np.concatenate(
        [
            problem.whitened(number, -(signal * each / largest)[..., None])
            for number, (signal, each) in enumerate(zip(signals, collected, strict=True))
        ]
    )
    column[: len(missing)] = missing
    reduced = max(solution.chi2 / max(problem.n_values - solution.rank, 1), 1.0)
    basis = column_space(jacobian)
    found = change_along(residual, column, basis, reduced, (1, 1), EXPOSURE_SIGMA, UNKNOWN_VARIANCE)
    return Measured(float(found.deviation[0, 0]), float(found.sigma[0, 0]))


def order_gain(
    problem: ExcitationProblem, theta: FloatArray, reference: int, uncertain: RelativeSigmas
) -> float:
    """Return the expected fall of χ² by orders above 1; 0 where they are not held at 1.

    Parameters
    ----------
    problem, theta
        The problem and its solution.
    reference, uncertain
        Reference channel and further sources of scatter, as those of the problem.
    """
    if not problem.parameters.is_first_order:
        return 0.0
    rates = problem.parameters.unpack(theta)
    states = problem.parameters.states
    free = ExcitationProblem(problem.series, states, reference, uncertain, None)
    start = free.parameters.as_stated(
        rates.k_r_per_s, rates.amplitude, rates.k_e_per_s, rates.weights, np.ones(states)
    )
    priors = len(free.parameters.prior_sigma)
    start[len(start) - priors :] = theta[len(theta) - priors :]
    free.rewhiten(start)
    misfit, jacobian = free.residuals(start)
    lower, _ = free.parameters.bounds()
    orders = np.arange(free.parameters.columns.order.start, free.parameters.columns.order.stop)
    is_other = start > lower
    is_other[orders] = False
    others = jacobian[:, is_other]
    lengths = np.linalg.norm(others, axis=0)
    basis, _ = np.linalg.qr(others[:, lengths > 0] / lengths[lengths > 0])
    left = -(misfit - basis @ (basis.T @ misfit))
    along = jacobian[:, orders] - basis @ (basis.T @ jacobian[:, orders])
    step = nonnegative_least_squares(along, left)
    return float(left @ left - np.square(left - along @ step).sum())


#: Probability of all pulls together below which the law does not hold, as of all misfit tests.
UNLIKELY = 5e-4
#: Significance of a course of the pulls with the length of the charge.
CLEAR_SIGMAS = 3.5


class LawTest(NamedTuple):
    """Pulls of the lamp in standard deviations of its prior.

    Attributes
    ----------
    trend
        Largest course with the logarithm of the length of the charge in any series, in σ; positive
        if long charges glow more than short ones by the law.
    probability
        Probability of pulls as large as these.
    """

    trend: float
    probability: float

    @property
    def fails(self) -> bool:
        """True if charges of different lengths do not follow the rate equation."""
        return abs(self.trend) > CLEAR_SIGMAS or self.probability < UNLIKELY


def law_test(
    parameters: Parameters, rates: Rates, theta: FloatArray, series: tuple[ChargingSeries, ...]
) -> LawTest | None:
    """Test whether charges of different lengths follow the rate equation.

    Returns None where the lamp's brightness is not fitted.

    Parameters
    ----------
    parameters, rates, theta
        Layout and values of the fitted parameters.
    series
        The charging series.
    """
    columns = parameters.columns
    if not is_fitted(columns.brightness):
        return None
    first_prior = len(theta) - len(parameters.prior_sigma)
    pulls = theta[first_prior:] / parameters.prior_sigma
    of_lamp = slice(columns.scale.start - first_prior, columns.lacking.stop - first_prior)
    lamp_sigma = parameters.prior_sigma[columns.brightness.start - first_prior]
    trends = [
        _trend(charging, rates.log_brightness[parameters.charges(number)] / lamp_sigma)
        for number, charging in enumerate(series)
    ]
    power = float(np.square(pulls[of_lamp]).sum())
    count = columns.lacking.stop - columns.scale.start
    return LawTest(max(trends, key=abs), float(chdtrc(count, power)))


def _trend(charging: ChargingSeries, pulls: FloatArray) -> float:
    """Return the component of the pulls along the logarithm of the charges' lengths, in σ."""
    length_s = np.array([charge.off_s - charge.on_s for charge in charging.charges])
    along = np.log(length_s) - np.log(length_s).mean()
    norm = float(np.linalg.norm(along))
    return float(along @ pulls) / norm if norm > 0 else 0.0


#: Sizes of a kind of error that are tried, the denser the smaller they are.
TRIED = 13
#: Kind of the lamp's scatter, before those of the sites.
LAMP = 0


class LightErrors(NamedTuple):
    """Sizes of the errors of the light, relative to those given.

    Attributes
    ----------
    lamp
        Size of the lamp's scatter from charge to charge.
    sites
        Size of each kind of the sites' error modes.
    """

    lamp: float
    sites: tuple[float, ...]

    def applied(
        self, series: Sequence[ChargingSeries], uncertain: RelativeSigmas
    ) -> tuple[list[ChargingSeries], RelativeSigmas]:
        """Return the series and the scatter with errors of these sizes."""
        sizes = np.array([*self.sites, 1.0])
        scaled = [
            charging
            if charging.site_modes is None or charging.mode_kind is None
            else replace(
                charging, site_modes=charging.site_modes * sizes[charging.mode_kind][:, None, None]
            )
            for charging in series
        ]
        lamp = max(uncertain.lamp * self.lamp, uncertain.least_lamp)
        return scaled, replace(uncertain, lamp=lamp)


def found_errors(
    parameters: Parameters,
    solution: LeastSquaresFit,
    series: Sequence[ChargingSeries],
    largest: float,
) -> LightErrors:
    """Return the expected size of each kind of error.

    Before the fit, all roots of sizes up to the largest are as probable as each other. The expected
    size is not 0 where a size of 0 fits best.

    Parameters
    ----------
    parameters
        Layout of θ.
    solution
        Fit with errors of size 1.
    series
        The charging series.
    largest
        Largest size.
    """
    kind = _kinds(parameters, series)
    kinds = int(kind.max(initial=LAMP)) + 1
    sigma, first = parameters.prior_sigma, parameters.count - len(parameters.prior_sigma)
    covariance = solution.covariance[first:, first:] / np.outer(sigma, sigma)
    # What the glow alone says: the fit's information less that of its own prior.
    inverse = np.linalg.inv(covariance)
    values, vectors = np.linalg.eigh(inverse - np.eye(len(sigma)))
    information = (vectors * np.maximum(values, 0.0)) @ vectors.T
    linear = inverse @ (solution.parameters[first:] / sigma)
    step = np.linspace(0.0, 1.0, TRIED)
    steps = np.stack(np.meshgrid(*[step] * kinds, indexing="ij"), -1).reshape(-1, kinds)
    grid = largest * steps**2
    log_evidence = np.array(
        [_log_evidence(information, linear, np.append(sizes, 1.0)[kind]) for sizes in grid]
    )
    probability = np.exp(log_evidence - log_evidence.max())
    lamp, *sites = (probability @ grid / probability.sum()).tolist()
    return LightErrors(lamp, tuple(sites))


def _kinds(parameters: Parameters, series: Sequence[ChargingSeries]) -> NDArray[np.intp]:
    """Return the kind of every parameter with a prior; −1 for those of known size."""
    first, columns = parameters.count - len(parameters.prior_sigma), parameters.columns
    kind = np.full(len(parameters.prior_sigma), -1)
    if is_fitted(columns.brightness):
        kind[columns.brightness.start - first : columns.brightness.stop - first] = LAMP
    for number, charging in enumerate(series):
        if charging.mode_kind is not None:
            modes, begin = parameters.modes(number), columns.off.start - first
            of_sites = np.where(charging.mode_kind < 0, -1, charging.mode_kind + LAMP + 1)
            kind[begin + modes.start : begin + modes.stop] = of_sites
    return kind


def _log_evidence(information: FloatArray, linear: FloatArray, size: FloatArray) -> float:
    """Return the logarithm of the integral over all errors with standard deviations `size`."""
    precision = np.eye(len(size)) + size[:, None] * information * size
    lower = np.linalg.cholesky(precision)
    along = np.linalg.solve(lower, size * linear)
    return float(along @ along / 2 - np.log(np.diag(lower)).sum())
