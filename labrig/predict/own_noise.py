"""What a fit makes of flicker that it has to tell from its own frames.

The rates scatter by what `information` says. But a fit that does not know ρ estimates it from the
scatter of its bright frames; where these are few it takes the noisy side and widens every σ as
Student's t asks for. `labrig.fit` does so frame by frame; here it is what that comes to on average.
"""

from dataclasses import replace

import numpy as np

from labrig.fit.decay.envelope import FEWEST_NOISE_DOF, LEAST_SPARE, MOST_FLICKER
from labrig.fit.decay.fit import FEWEST_FOR_FLICKER
from labrig.fit.least_squares import FloatArray
from labrig.predict.information import Information, information
from labrig.predict.series import ExpectedSeries


def reported_sigma(series: ExpectedSeries, found: Information) -> FloatArray:
    """(2m,) σ of k1, a1, … that the fit itself will give."""
    if len(series.t_s) < FEWEST_FOR_FLICKER or not series.curve.any():
        return found.sigma
    variance = series.flicker**2
    sigma, dof = _told(series, found, variance)
    if dof < FEWEST_NOISE_DOF:
        variance = min(variance + sigma, MOST_FLICKER**2)
        _, dof = _told(series, found, variance)
        found = information(replace(series, flicker=float(np.sqrt(variance))))
    return np.asarray(found.sigma * np.sqrt(dof / max(dof - 2, 1.0)))


def _told(series: ExpectedSeries, found: Information, variance: float) -> tuple[float, float]:
    """σ(ρ²) of the fit's estimate and its degrees of freedom, where ρ² is `variance`."""
    signal = np.multiply.outer(series.curve, series.weights)
    brightness2 = (signal**2 / series.variance).sum(axis=1)
    told = brightness2 / (1 + variance * brightness2)
    spare = np.maximum(1 - found.leverage, LEAST_SPARE)
    sigma = float(np.sqrt(2 / (told**2 @ spare)))
    return sigma, 2 / (sigma**2 * float((told**3).sum() / told.sum()))
