"""Tests of the rate equation by what a fit has to take for errors of the lamp.

Every charge's lamp has a brightness of its own, known within a prior. Where charges of different
lengths do not obey the rate equation, the fit makes good for it by lamps that are darker the
shorter they shine, or brighter, and leaves a χ² that is hardly large. Under the prior these pulls
are standard normal, or smaller, and have no order.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from labrig.fit.excitation.parameters import Parameters, Rates, is_fitted
from labrig.foundation.arrays import FloatArray
from labrig.results import ChargingSeries

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
        """Whether charges of different lengths do not follow the rate equation."""
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
