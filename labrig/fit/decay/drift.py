"""Effect of a temperature that drifts while a sample glows on the fitted rates and amplitudes.

If all rates grow as k (1 + γ t), a state's signal is a (1 + γ t) e^(−k (t + γ t²/2)). A fit with
constant rates takes what it can of the derivative c by γ, and its parameters move by J⁺c a unit of
γ, J the Jacobian. Of a drift of some kelvins an hour the rest is below the noise of a decay of
minutes, so that nothing in the data tells it.
"""

import numpy as np

from labrig.fit.decay.further_state import RCOND
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.foundation.arrays import FloatArray

#: Gauss–Legendre nodes and weights on [0, 1].
_NODES, _FRACTIONS = np.polynomial.legendre.leggauss(8)
NODES, FRACTIONS = (_NODES + 1) / 2, _FRACTIONS / 2


def drift_effect(data: WhitenedSeries, fit: StatesFit) -> FloatArray:
    """Return the change of the fitted parameters by a drift γ of 1 per span, shape (p,).

    The values without it are those of the temperature at lamp off.
    """
    series, joint = data.series, fit.joint
    rates = np.exp(fit.log_rates)
    # Amplitudes are those at the first frame, times are counted from lamp off.
    amplitudes = fit.amplitudes * np.exp(rates * series.start)
    time = (series.t + series.start)[:, None] + series.exposure[:, None] * NODES
    by_drift = np.zeros(time.shape)
    for rate, amplitude in zip(rates, amplitudes, strict=True):
        by_drift += amplitude * np.exp(-rate * time) * (time - rate * time**2 / 2)
    column = data.signal_design(data.constant(joint.weights), (by_drift @ FRACTIONS)[:, None])
    jacobian = joint.least_squares.jacobian
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    effect = np.linalg.lstsq(jacobian / scale, column, rcond=RCOND)[0][:, 0] / scale
    return np.asarray(effect)
