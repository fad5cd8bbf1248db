"""Whether the fit will see all states, or take two for one."""

import numpy as np
from scipy.special import fdtri, ncfdtr

from labrig.errors import FitError
from labrig.fit import fit_decay
from labrig.fit.decay import F_TEST_LEVEL
from labrig.predict.series import ExpectedSeries

#: Parameters that one more state takes.
ADDED = 2


def chance_of_all_states(series: ExpectedSeries) -> float:
    """Probability that the fit tells as many states as there are.

    One state fewer is fitted to what is expected without noise; the χ² that it leaves is the
    noncentrality of the F-test and of the BIC by which the fit chooses (`labrig.fit`).
    """
    states, frames = len(series.k_r_per_s), len(series.t_s)
    if states == 1:
        return 1.0
    try:
        fewer = fit_decay(
            series.t_s,
            np.multiply.outer(series.curve, series.weights),
            np.sqrt(series.variance),
            exposure_s=series.exposure_s,
            channels=[str(number) for number in range(len(series.weights))],
            n_states=states - 1,
            offset_sigma=series.offset_sigma,
            flicker=series.flicker,
        )
    except FitError:
        return 0.0
    left = frames - 2 * states
    if left < 1:
        return 0.0
    by_f_test = float(fdtri(ADDED, left, 1 - F_TEST_LEVEL))
    by_bic = float(np.log(series.variance.size))
    return float(1 - ncfdtr(ADDED, left, fewer.chi2, max(by_f_test, by_bic)))
