"""Test whether the camera's signal is proportional to the glow.

A sensor that misses some of a large signal makes the glow of bright places and of long exposures
too dim. Since exposures differ in length, that is neither a law of charging nor one of the decay.
"""

import numpy as np

from labrig.fit.excitation.band_tests import UNKNOWN_VARIANCE, change_along, column_space
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.fit.least_squares import LeastSquaresFit
from labrig.results import Measured

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
