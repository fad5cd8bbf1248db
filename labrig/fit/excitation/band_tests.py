"""Tests whether light of every band excites the same glow: as much, as lasting, of the same hue.

The rate equation of a thin layer has one Λ and one k_r of each state, whatever light excites it. In
a thick layer the light that is absorbed most charges the surface only, and saturates sooner; light
that empties traps shortens the decay of what it charges. Each test lets one quantity differ between
the places that different bands excite, all parameters of the fit free besides, and asks how much χ²
falls. The fit is linear within its σ, so that one step of Gauss and Newton is the whole of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from labrig.fit.excitation.parameters import Rates
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.fit.least_squares import EPSILON, LeastSquaresFit
from labrig.foundation.arrays import FloatArray, IntArray
from labrig.results import BandQuantity, BandTests, Measured

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
