"""What a fit of first order would gain if kinetic orders were fitted, by one linear step.

Rao's score test: the fit itself, which takes many evaluations of states of general order, is only
worth while where its residuals go along the derivatives by the orders.
"""

import numpy as np

from labrig.fit.excitation.parameters import RelativeSigmas
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares


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
